"""Recorded bytes through the decoders again: what the service made of them, at a desk."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import NamedTuple

from foottrack_protocol import Message
from foottrack_protocol.messages import RawImu
from foottrack_service.imu.formats import SERIAL_FORMATS
from foottrack_service.imu.settings import ImuDeviceSettings
from foottrack_service.imu.slimevr import Address, SlimeVrServer
from foottrack_service.imu.stream import SerialStream, Stamped, Stamper


class Decoded(NamedTuple):
    """Samples in the order of their bytes, and what was dropped, by reason."""

    samples: list[Stamped]
    drops: Counter[str]


def decode_again(recorded: Iterable[Message], device: ImuDeviceSettings) -> Decoded:
    """The samples in one foot's raw messages, with the settings that its IMU had.

    They are those that were published. Their stamps are, too, when the bytes are there from the connection's beginning
    (the dejitter learns), except that the share of a SlimeVR tracker's round trip is not known any more.
    """
    samples: list[Stamped] = []
    drops: Counter[str] = Counter()
    decoder: _Serial | _Tracker | None = None
    run: tuple[str, str] | None = None
    for message in recorded:
        raw: RawImu = message.data
        if run != (message.sid, raw.format):
            run = (message.sid, raw.format)
            if decoder is not None:
                drops += decoder.drops
            decoder = _decoder(raw.format, device)
        if decoder is None:
            drops["format"] += 1
        else:
            samples += decoder.feed(raw, message.t)
    return Decoded(samples, drops if decoder is None else drops + decoder.drops)


class _Serial:
    def __init__(self, device: ImuDeviceSettings) -> None:
        self._stream = SerialStream(device)
        self._connection: int | None = None

    @property
    def drops(self) -> Counter[str]:
        return self._stream.drops

    def feed(self, raw: RawImu, t_arr: int) -> list[Stamped]:
        if raw.connection != self._connection:
            self._connection = raw.connection
            self._stream.replugged()
        return self._stream.feed(raw.bytes, t_arr)


class _Tracker:
    def __init__(self, device: ImuDeviceSettings) -> None:
        self._server = SlimeVrServer(lambda name: device.acc_turn)
        self._stamper = Stamper(device, None)

    @property
    def drops(self) -> Counter[str]:
        return self._server.drops + self._stamper.drops

    def feed(self, raw: RawImu, t_arr: int) -> list[Stamped]:
        found, _ = self._server.receive(raw.bytes, _address(raw.source), t_arr * 1e-9)
        stamped = (self._stamper.stamp(each.sample, t_arr, None) for each in found if each.name == raw.tracker)
        return [sample for sample in stamped if sample is not None]


def _decoder(format_: str, device: ImuDeviceSettings) -> _Serial | _Tracker | None:
    if format_ == "slimevr":
        return _Tracker(device.model_copy(update={"format": format_}))
    if format_ in SERIAL_FORMATS:
        return _Serial(device.model_copy(update={"format": format_}))
    return None


def _address(source: str) -> Address:
    host, _, port = source.rpartition(":")
    return host, int(port) if port.isdecimal() else 0
