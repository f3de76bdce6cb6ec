"""A simulated sender of VMC: poses in, datagrams out."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message_builder import OscMessageBuilder

from foottrack_service.headset.rigid import NOWHERE, Rigid, mirrored


class VmcSender:
    """An application that sends its headset's raw pose, or the head bone of an avatar without other bones."""

    def __init__(self, bone: bool = False) -> None:
        self._bone = bone

    def datagram(self, t_s: float, head: Rigid | None) -> bytes:
        """One frame. ``t_s`` is the application's own time, s; ``head`` to stage, None while it is not tracked."""
        messages: list[tuple[str, list[Any]]] = [
            ("/VMC/Ext/OK", [1, 3, 0, int(head is not None)]),
            ("/VMC/Ext/T", [float(t_s)]),
            ("/VMC/Ext/Root/Pos", ["root", *_seven(NOWHERE)]),
        ]
        place = _seven(NOWHERE if head is None else head)
        if self._bone:
            messages.append(("/VMC/Ext/Bone/Pos", ["Head", *place]))
        else:
            messages.append(("/VMC/Ext/Hmd/Pos/Local", ["simulated", *place]))
        return osc_bundle(messages)


def osc_bundle(messages: Iterable[tuple[str, list[Any]]]) -> bytes:
    """Messages as one datagram; floats travel as float32."""
    bundle = OscBundleBuilder(IMMEDIATELY)
    for address, values in messages:
        message = OscMessageBuilder(address)
        for value in values:
            message.add_arg(value)
        bundle.add_content(message.build())
    return bytes(bundle.build().dgram)


def _seven(place: Rigid) -> list[float]:
    unity = mirrored(place)
    return [float(value) for value in (*unity.p, *unity.q)]
