"""BNO08x in SHTP over UART: the decoder, and the host that tells it what to send."""

from __future__ import annotations

from collections import deque

from foottrack_service.imu.formats import sh2
from foottrack_service.imu.formats.pairing import Pairing
from foottrack_service.imu.formats.sh2 import Command, Damaged, Report, SensorReport
from foottrack_service.imu.formats.shtp import Cargo, Channel, ShtpReceiver, ShtpSender
from foottrack_service.imu.sample import Decoder, DeviceClock, DeviceSample, unit_quaternion

SEQUENCE_MODULUS = 256
RATE_TOLERANCE = 0.1
"""The chip rounds rates to what its sensors can do and runs off its own oscillator."""

QUATERNION_SLACK = 0.05
"""The transport has no checksum: a damaged quaternion shows in its length."""

MAX_AGE_US = 1_000_000
"""Reports are never batched: an older one has a damaged time base."""

MIN_INTERVAL_US, MAX_INTERVAL_US = 500, 1_000_000
"""What the chip can be set to, for these sensors."""

REPLY_S = 1.0
"""After a reset or a Set Feature without an answer, it is sent again; a reset takes a few tenths."""

_DAMAGED_AT = 5
"""A cycle with one report lost makes four that complete nothing: with this one, what waits must be damaged ..."""

_OUT_OF_STEP_AT = 10
"""... and with this one, the kinds are no longer in step."""


class Bno08xDecoder(Decoder):
    """SHTP frames to samples; resets the chip, enables its reports, and does so again when it started anew.

    The chip stamps nothing absolute: its clock here is the accelerometer's sequence number times the interval that it
    announced. Reports of one cycle belong together by their own sequence numbers, so a lost one shifts nothing.
    Drops: those of ``ShtpReceiver``, ``report_id``, ``report_length``, ``age``, ``interval``, ``quaternion``,
    ``unpaired``.
    """

    def __init__(self, interval_us: int = 2500) -> None:
        super().__init__()
        self.clock: DeviceClock = DeviceClock(SEQUENCE_MODULUS, float(interval_us), RATE_TOLERANCE)
        self.answers: deque[tuple[int, int]] = deque(maxlen=16)
        """(command, status) of what ``send_command`` asked, oldest first."""
        self._interval_us = interval_us
        self._receiver = ShtpReceiver(self.drops)
        self._sender = ShtpSender()
        self._outbox: list[bytes] = []
        self._commands = 0
        self._epoch = 0
        self._pairing = Pairing(tuple(kind.name for kind in sh2.SENSORS), SEQUENCE_MODULUS, 0, self.drops)
        self._origin: dict[Report, int] = {}
        self._latest: dict[Report, SensorReport] = {}
        self._misses = 0
        self._missing: set[Report] = set()
        self._resetting = True
        self._due_s: float | None = None

    def feed(self, data: bytes) -> list[DeviceSample]:
        samples = []
        for cargo in self._receiver.feed(data):
            if cargo.channel in (Channel.INPUT, Channel.WAKE):
                samples += self._input(cargo.payload)
            elif cargo.channel == Channel.EXECUTABLE and cargo.payload == sh2.RESET:
                self._started_anew()
            elif cargo.channel == Channel.CONTROL:
                self._control(cargo)
        return samples

    def to_send(self, now_s: float) -> list[bytes]:
        if self._due_s is None or now_s >= self._due_s:
            if self._resetting:
                self._outbox.append(self._sender.frame(Channel.EXECUTABLE, sh2.RESET))
            for sensor in sorted(self._missing):
                self._outbox.append(self._sender.frame(Channel.CONTROL, sh2.set_feature(sensor, self._interval_us)))
            self._due_s = now_s + REPLY_S
        frames, self._outbox = self._outbox, []
        return frames

    def send_command(self, code: Command, *parameters: int) -> None:
        """Queue a command, for instance to save the chip's own calibration; ``answers`` will hold its status."""
        self._outbox.append(self._sender.frame(Channel.CONTROL, sh2.command(self._commands, code, *parameters)))
        self._commands += 1

    def _started_anew(self) -> None:
        self._epoch += 1
        self._resetting = False
        self._missing = set(sh2.SENSORS)
        self._due_s = None
        self._receiver.restart()
        self._out_of_step()

    def _out_of_step(self) -> None:
        self._origin.clear()
        self._latest.clear()
        self._pairing.clear()
        self._misses = 0

    def _control(self, cargo: Cargo) -> None:
        feature = sh2.read_feature(cargo.payload)
        if feature is not None and feature[0] in sh2.SENSORS:
            sensor, interval_us = Report(feature[0]), feature[1]
            if not MIN_INTERVAL_US <= interval_us <= MAX_INTERVAL_US:
                # Turned off, or damaged on the way: ask again.
                self.drops["interval"] += 1
                self._missing.add(sensor)
                return
            self._missing.discard(sensor)
            if sensor == Report.ACCELEROMETER and float(interval_us) != self.clock.tick_us:
                self.clock = self.clock._replace(tick_us=float(interval_us))
                self._epoch += 1
        answer = sh2.read_command_response(cargo.payload)
        if answer is not None:
            self.answers.append(answer)

    def _input(self, payload: bytes) -> list[DeviceSample]:
        samples = []
        for report in sh2.input_reports(payload):
            if isinstance(report, Damaged):
                self.drops[report.reason] += 1
                continue
            sample = self._report(report)
            if sample is not None:
                samples.append(sample)
        return samples

    def _report(self, report: SensorReport) -> DeviceSample | None:
        if not abs(report.age_us) <= MAX_AGE_US:
            self.drops["age"] += 1
            return None
        if not self._origin:
            self._latest[report.kind] = report
            # The rotation is computed from the other two, so it closes a cycle.
            if report.kind != Report.GAME_ROTATION_VECTOR or len(self._latest) < len(sh2.SENSORS):
                return None
            self._origin = {kind: latest.sequence for kind, latest in self._latest.items()}
            cycle = {kind.name: (0, latest) for kind, latest in self._latest.items()}
            self._latest.clear()
            return self._sample(cycle)
        key = (report.sequence - self._origin[report.kind]) % SEQUENCE_MODULUS
        complete = self._pairing.add(report.kind.name, key, report)
        if complete is not None:
            self._misses = 0
            return self._sample(complete)
        self._misses += 1
        if self._misses == _DAMAGED_AT:
            self._pairing.clear()
        elif self._misses == _OUT_OF_STEP_AT:
            self._out_of_step()
        return None

    def _sample(self, cycle: dict[str, tuple[int, SensorReport]]) -> DeviceSample | None:
        acc, gyro, rotation = (cycle[kind.name][1] for kind in sh2.SENSORS)
        x, y, z, w = rotation.values
        q = unit_quaternion(x, y, z, w, QUATERNION_SLACK)
        if q is None:
            self.drops["quaternion"] += 1
            return None
        a, g = acc.values, gyro.values
        return DeviceSample(
            acc.sequence,
            (a[0], a[1], a[2]),
            (g[0], g[1], g[2]),
            q,
            min(acc.accuracy, gyro.accuracy, rotation.accuracy),
            acc.age_us,
            self._epoch,
        )
