"""Tags on the feet as a camera saw them, each with where the head was at that instant."""

from __future__ import annotations

from collections import deque

import numpy as np

from foottrack_protocol import Message
from foottrack_protocol.messages import HeadPose, Optical, Side
from foottrack_service.calibration.flow import side_of
from foottrack_service.fusion.head_history import HeadHistory
from foottrack_service.fusion.interface import HeadSample, OpticalFix

_WAIT_FOR_HEAD_S = 0.2


class Sight:
    """Joins ``marker/*`` with ``head/pose``, in order of arrival."""

    def __init__(self) -> None:
        self._heads = HeadHistory()
        self._waiting: deque[tuple[Side, Message]] = deque(maxlen=256)

    def take(self, message: Message) -> list[tuple[Side, OpticalFix]]:
        """Fixes whose head pose is known by now. Other messages are left out."""
        body, side = message.data, side_of(message.stream)
        if isinstance(body, HeadPose):
            if body.tracked:
                self._heads.add(HeadSample(message.t, np.array(body.p), np.array(body.q)))
            else:
                self._heads.add_untracked(message.t)
        elif isinstance(body, Optical) and side is not None and message.stream.startswith("marker/"):
            self._waiting.append((side, message))
        return self._settled()

    def _settled(self) -> list[tuple[Side, OpticalFix]]:
        newest = self._heads.newest
        settled: list[tuple[Side, OpticalFix]] = []
        while self._waiting and newest is not None:
            side, message = self._waiting[0]
            head = self._heads.at(message.t)
            if head is not None:
                settled.append((side, _fix(message, head, newest)))
            elif newest.t - message.t < _WAIT_FOR_HEAD_S * 1e9:
                break
            self._waiting.popleft()
        return settled


def _fix(message: Message, head: HeadSample, newest: HeadSample) -> OpticalFix:
    body = message.data
    xx, xy, xz, yy, yz, zz = body.cov
    return OpticalFix(
        message.t,
        "marker",
        np.array(body.p),
        None if body.q is None else np.array(body.q),
        None if body.q_alt is None else np.array(body.q_alt),
        np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]),
        body.size_ratio,
        body.edge_px,
        head,
        newest,
    )
