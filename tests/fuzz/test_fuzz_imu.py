"""The fuzzing target on a fixed corpus: real streams of every format, damaged by a seeded generator."""

from __future__ import annotations

import random
import struct

import pytest
from fuzz_imu import NAMES, check

from foottrack_service.imu.devices.bno08x import Bno08xDevice
from foottrack_service.imu.devices.serial_devices import AsciiDevice, RawDevice, RvcDevice
from foottrack_service.imu.formats import slimevr
from foottrack_service.imu.formats.bno08x import Bno08xDecoder
from foottrack_service.imu.sample import DeviceSample

SAMPLE = DeviceSample(4294967000, (0.3, -0.2, 9.7), (0.1, -3.0, 25.0), (0.1, -0.7, 0.1, 0.7), accuracy=3)


def seeds() -> dict[str, bytes]:
    device, decoder = Bno08xDevice(), Bno08xDecoder()
    bno = b""
    for now_s in (0.0, 0.1):
        for frame in decoder.to_send(now_s):
            bno += device.hear(frame)
            decoder.feed(device.hear(frame))
    unit = SAMPLE._replace(q=(0.1, -0.7, 0.1, 0.7))
    streams = {
        "bno08x": bno + device.measure(unit) * 4 + device.start() + device.measure(unit),
        "raw": b"".join(RawDevice().measure(SAMPLE) for _ in range(6)),
        "rvc": b"%Hillcrest\n" + b"".join(RvcDevice().measure(SAMPLE) for _ in range(8)),
        "ascii": b"".join(AsciiDevice().measure(SAMPLE) for _ in range(4)),
    }
    datagrams = [
        slimevr.encode_handshake(slimevr.Handshake(22, "0.5", "A0:B1:C2:D3:E4:F5")),
        slimevr.encode_bundle(
            1,
            [
                slimevr.encode_rotation(0, slimevr.Rotation(0, (0.0, 0.0, 0.0, 1.0), 3)),
                slimevr.encode_acceleration(0, slimevr.Acceleration(0, (1.0, 2.0, 3.0))),
            ],
        ),
        struct.pack(">IQB", 22, 2, 1),
    ]
    step = max(map(len, datagrams))
    tracker = b"".join(datagram.ljust(step, b"\0") for datagram in datagrams)
    named = {name: bytes([NAMES.index(name), 7]) + stream for name, stream in streams.items()}
    return named | {"slimevr": bytes([len(NAMES), step - 12]) + tracker}


def damaged(seed: bytes, rng: random.Random) -> bytes:
    data = bytearray(seed)
    for _ in range(rng.randint(1, 8)):
        at = rng.randrange(len(data))
        kind = rng.randrange(5)
        if kind == 0:
            data[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            data[at : at + rng.randint(1, 12)] = b""
        elif kind == 2:
            data[at:at] = rng.randbytes(rng.randint(1, 12))
        elif kind == 3:
            data[at:at] = rng.choice([b"\x7e", b"\x7d", b"\x00", b";", b"\xaa\xaa", b",R,", b"nan"])
        else:
            data[at:at] = data[rng.randrange(len(data)) :][: rng.randint(1, 60)]
        if len(data) < 3:
            return bytes(seed)
    return bytes(data)


@pytest.mark.parametrize("name", [*NAMES, "slimevr"])
def test_damaged_streams_break_no_promise(name: str) -> None:
    rng = random.Random(name)
    seed = seeds()[name]
    check(seed)
    for _ in range(1500):
        check(damaged(seed, rng))


def test_the_target_notices_a_broken_promise(monkeypatch: pytest.MonkeyPatch) -> None:
    feed = Bno08xDecoder.feed
    monkeypatch.setattr(Bno08xDecoder, "feed", lambda self, data: feed(self, data[1:]))
    with pytest.raises(AssertionError, match="another split"):
        check(seeds()["bno08x"])
