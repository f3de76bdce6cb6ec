"""VMC: poses of a headset or of an avatar's head as OSC over UDP, in Unity's axes (protocol.vmc.info, version 2.7).

Latency: unknown to one side, so what is known of it is a setting; what varies is taken out. Clock: the sender's own
relative time (``/VMC/Ext/T``, a float32) against arrivals by recursive least squares; without it, or while it stands
still or has grown coarse, the arrival.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from typing import Any

from pythonosc.osc_bundle import ParseError as BundleError
from pythonosc.osc_message import ParseError as MessageError
from pythonosc.osc_packet import OscPacket
from pythonosc.osc_packet import ParseError as PacketError

from foottrack_service.headset.rigid import NOWHERE, Rigid, mirrored, rigid
from foottrack_service.headset.settings import VmcSettings
from foottrack_service.headset.stream import HeadMessage, HeadStream
from foottrack_service.imu.dejitter import Dejitter
from foottrack_service.imu.sample import DeviceClock

SPINE = ("Hips", "Spine", "Chest", "UpperChest", "Neck")
"""Bones are sent in their parent's frame: these lie between the root and the head. Who leaves one out means none."""
HOLD_S = 1.0
"""So long the better source of a pose is waited for, before a worse one is taken."""

_QUALITY = {"/VMC/Ext/Hmd/Pos/Local": 2, "/VMC/Ext/Hmd/Pos": 1, "/VMC/Ext/Bone/Pos": 0}
"""Local is the runtime's own stage, the other is scaled to the avatar; the bone is where the avatar's head ended up."""
_COARSE_S = 2.0**14
"""From here on a float32 is 2 ms coarse and soon 4, and a day later it jumps over whole frames."""
_CLOCK = DeviceClock(modulus=1 << 62, tick_us=1.0, tolerance=1e-3)
_UNIT_SLACK = 0.01
_ERRORS = (PacketError, BundleError, MessageError, ValueError, IndexError, OverflowError, RecursionError)


class VmcReceiver:
    """Datagrams in, messages out. Sans-I/O, never raises for what arrives."""

    def __init__(self, settings: VmcSettings) -> None:
        self.stream = HeadStream()
        self._take = settings.take
        self._eyes = rigid(settings.eyes.p, settings.eyes.q)
        self._latency = round(settings.latency * 1e9)
        self._dejitter = Dejitter(_CLOCK)
        self._ticks: int | None = None
        self._last_ticks: int | None = None
        self._root = NOWHERE
        self._spine: dict[str, Rigid] = {}
        self._heads: dict[str, Rigid] = {}
        self._best: tuple[int, int] | None = None
        self._ok = True

    @property
    def drops(self) -> Counter[str]:
        """What was left out, by reason."""
        return self.stream.drops

    @property
    def skew(self) -> float:
        """How much faster the bus clock runs than the sender's, relative."""
        return self._dejitter.skew

    def receive(self, datagram: bytes, t_arr: int) -> list[HeadMessage]:
        """The message that a datagram completes, if any. ``t_arr`` is its arrival, bus clock, ns."""
        self._heads.clear()
        for address, values in self._messages(datagram):
            try:
                self._on_message(address, values)
            except (ValueError, TypeError):
                self.drops["bad_values"] += 1
        chosen = self._chosen(t_arr)
        if chosen is None:
            return []
        moved = self._ticks != self._last_ticks
        self._last_ticks = self._ticks
        t = self._dejitter.stamp(self._ticks if moved else None, t_arr).t - self._latency
        message = self.stream.pose(t, self._heads[chosen]) if self._ok else self.stream.lost(t)
        return [] if message is None else [message]

    def idle(self, now: int) -> list[HeadMessage]:
        """What silence means. Call it a few times a second."""
        return [self.stream.lost(now)] if self.stream.silent(now) else []

    def _messages(self, datagram: bytes) -> Iterator[tuple[str, list[Any]]]:
        try:
            for timed in OscPacket(datagram).messages:
                yield timed.message.address, timed.message.params
        except _ERRORS:
            self.drops["not_osc"] += 1

    def _on_message(self, address: str, values: list[Any]) -> None:
        if address == "/VMC/Ext/T":
            (seconds,) = _finite(values[:1])
            self._ticks = round(seconds * 1e6) if abs(seconds) < _COARSE_S else None
        elif address == "/VMC/Ext/OK":
            # loaded, calibration state, calibration mode, tracking status: the last since version 2.7.
            self._ok = bool(values[:1] != [0] and values[3:4] != [0])
        elif address == "/VMC/Ext/Root/Pos":
            self._root = _place(values)
        elif address == "/VMC/Ext/Bone/Pos":
            if values[:1] == ["Head"]:
                self._heads[address] = self._neck().then(_place(values)).then(self._eyes)
            elif values and values[0] in SPINE:
                self._spine[values[0]] = _place(values)
        elif address in _QUALITY:
            self._heads[address] = _place(values)

    def _neck(self) -> Rigid:
        place = self._root
        for bone in SPINE:
            place = place.then(self._spine.get(bone, NOWHERE))
        return place

    def _chosen(self, now: int) -> str | None:
        """The best of the datagram's heads, unless a better kind was there a moment ago."""
        wanted = [a for a in self._heads if self._take == "auto" or (self._take == "bone") == (_QUALITY[a] == 0)]
        address = max(wanted, key=_QUALITY.__getitem__, default=None)
        if address is None:
            return None
        quality = _QUALITY[address]
        if self._best is not None and quality < self._best[0] and now - self._best[1] < HOLD_S * 1e9:
            return None
        self._best = (quality, now)
        return address


def _place(values: list[Any]) -> Rigid:
    """Name, position, rotation, in Unity's axes, in ours. Raises ValueError, TypeError."""
    numbers = _finite(values[1:8])
    if len(numbers) != 7 or abs(math.hypot(*numbers[3:]) - 1.0) > _UNIT_SLACK:
        raise ValueError("not a place")
    return mirrored(rigid(numbers[:3], numbers[3:]))


def _finite(values: list[Any]) -> list[float]:
    numbers = [float(value) for value in values]
    if not numbers or not all(map(math.isfinite, numbers)):
        raise ValueError("not numbers")
    return numbers
