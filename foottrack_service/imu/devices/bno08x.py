"""A simulated BNO08x on SHTP over UART: silent until it is configured, and silent again after a reset."""

from __future__ import annotations

from collections import Counter

from foottrack_service.imu.devices.serial_devices import SimulatedDevice
from foottrack_service.imu.formats import sh2
from foottrack_service.imu.formats.sh2 import Command, Report, SensorReport
from foottrack_service.imu.formats.shtp import Channel, ShtpReceiver, ShtpSender
from foottrack_service.imu.sample import DeviceSample

FASTEST_US = 2500

# Tag 0 (GUID) and tag 8 (name) of the real one's start message; hosts may ignore the rest as well.
_ADVERTISEMENT = b"\x00\x01\x04\x00\x00\x00\x00\x08\x05SHTP\x00"


class Bno08xDevice(SimulatedDevice):
    """Answers reset, Set Feature and commands; reports what is enabled, each sensor with its own sequence numbers.

    The caller measures at the rate that it wants; ``interval_us`` is what the host asked for, at least ``FASTEST_US``.
    """

    def __init__(self) -> None:
        self.intervals_us: dict[Report, int] = {}
        self.commands: list[int] = []
        self.drops: Counter[str] = Counter()
        self._receiver = ShtpReceiver(self.drops)
        self._sender = ShtpSender()
        self._sequence: Counter[Report] = Counter()

    def measure(self, sample: DeviceSample) -> bytes:
        if sample.q is None or sample.gyro is None:
            raise ValueError("a BNO08x measures gyro and q")
        values = (sample.acc, sample.gyro, sample.q)
        out = b""
        for kind, value in zip(sh2.SENSORS, values, strict=True):
            if kind in self.intervals_us:
                accuracy = 3 if sample.accuracy is None else sample.accuracy
                report = SensorReport(kind, self._sequence[kind], accuracy, sample.age_us, value)
                out += self._sender.frame(Channel.INPUT, sh2.input_report(report))
                self._sequence[kind] += 1
        return out

    def hear(self, data: bytes) -> bytes:
        out = b""
        for cargo in self._receiver.feed(data):
            if cargo.channel == Channel.EXECUTABLE and cargo.payload == sh2.RESET:
                out += self.start()
            elif cargo.channel == Channel.CONTROL:
                out += self._control(cargo.payload)
        return out

    def start(self) -> bytes:
        """Power on, brown-out or reset: what it forgets and what it says then."""
        self.intervals_us.clear()
        self._sequence.clear()
        self._sender = ShtpSender()
        self._receiver.restart()
        initialised = sh2.command_response(Command.INITIALIZE, 0, 0)
        return (
            self._sender.frame(Channel.COMMAND, _ADVERTISEMENT)
            + self._sender.frame(Channel.EXECUTABLE, sh2.RESET)
            + self._sender.frame(Channel.CONTROL, initialised)
        )

    def _control(self, payload: bytes) -> bytes:
        feature = sh2.read_feature(payload)
        if feature is not None and payload[0] == Report.SET_FEATURE and feature[0] in sh2.SENSORS:
            sensor, interval_us = Report(feature[0]), feature[1]
            if interval_us:
                interval_us = self.intervals_us[sensor] = max(FASTEST_US, interval_us)
            else:
                self.intervals_us.pop(sensor, None)
            return self._sender.frame(Channel.CONTROL, sh2.feature_response(sensor, interval_us))
        if payload[:1] == bytes([Report.COMMAND_REQUEST]) and len(payload) == 12:
            self.commands.append(payload[2])
            if payload[2] == Command.CLEAR_CALIBRATION_AND_RESET:
                return self.start()
            answer = sh2.command_response(Command(payload[2]), payload[1], 0) if payload[2] in list(Command) else b""
            return self._sender.frame(Channel.CONTROL, answer) if answer else b""
        return b""
