"""One device's bytes to the wire's messages: decode, stamp, turn the axes. No port and no clock."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

from pydantic import ValidationError

from foottrack_protocol.messages import Imu
from foottrack_service.imu.axes import Axes
from foottrack_service.imu.dejitter import Dejitter
from foottrack_service.imu.formats import SERIAL_FORMATS
from foottrack_service.imu.formats.ascii import AsciiDecoder
from foottrack_service.imu.formats.bno08x import Bno08xDecoder
from foottrack_service.imu.formats.rvc import RvcDecoder
from foottrack_service.imu.sample import Decoder, DeviceClock, DeviceSample
from foottrack_service.imu.settings import ImuDeviceSettings


class Stamped(NamedTuple):
    """A body and its sampling instant, bus clock, ns."""

    t: int
    imu: Imu


class Stamper:
    """Samples to bodies. ``drops`` counts under ``wire`` what the wire would refuse."""

    def __init__(self, settings: ImuDeviceSettings, clock: DeviceClock | None) -> None:
        self.drops: Counter[str] = Counter()
        self.dejitter = Dejitter(clock)
        self._axes = Axes(settings.axes)
        self._delay = round(settings.delay * 1e9)
        self._epoch: int | None = None

    def stamp(self, sample: DeviceSample, t_arr: int, clock: DeviceClock | None) -> Stamped | None:
        """The sample's message, or None. ``clock`` is the device's, as its decoder knows it now."""
        if sample.epoch != self._epoch:
            self._epoch = sample.epoch
            self.dejitter.restart(clock)
        t, t_dev_us = self.dejitter.stamp(sample.ticks, t_arr, sample.age_us)
        try:
            return Stamped(t - self._delay, self._axes.to_wire(sample, t_dev_us, t_arr))
        except ValidationError:
            self.drops["wire"] += 1
            return None

    def replugged(self) -> None:
        """Nothing that was known of the device's clock holds."""
        self._epoch = None


class SerialStream:
    """A device on a serial line."""

    def __init__(self, settings: ImuDeviceSettings) -> None:
        self._settings = settings
        self.decoder = decoder_for(settings)
        self.stamper = Stamper(settings, self.decoder.clock)

    @property
    def drops(self) -> Counter[str]:
        """By reason, of decoder and wire."""
        return self.decoder.drops + self.stamper.drops

    def feed(self, data: bytes, t_arr: int) -> list[Stamped]:
        """The messages that are complete with these bytes, which arrived at ``t_arr`` (bus clock, ns)."""
        messages = []
        for sample in self.decoder.feed(data):
            message = self.stamper.stamp(sample, t_arr, self.decoder.clock)
            if message is not None:
                messages.append(message)
        return messages

    def to_send(self, now_s: float) -> list[bytes]:
        """What the device is due."""
        return self.decoder.to_send(now_s)

    def replugged(self) -> None:
        """A new connection: half a message of the old one is worth nothing, and the device may have to be told anew."""
        drops = self.decoder.drops
        self.decoder = decoder_for(self._settings)
        self.decoder.drops.update(drops)
        self.stamper.replugged()


def decoder_for(settings: ImuDeviceSettings) -> Decoder:
    """The decoder of a serial format, with its options. Raises KeyError for one that is not serial."""
    if settings.format == "ascii":
        return AsciiDecoder(settings.separator, settings.tick * 1e6)
    if settings.format == "bno08x":
        return Bno08xDecoder(round(1e6 / settings.rate))
    if settings.format == "rvc":
        return RvcDecoder(settings.yaw_clockwise)
    return SERIAL_FORMATS[settings.format].decoder()
