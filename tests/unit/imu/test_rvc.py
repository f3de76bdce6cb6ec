"""UART-RVC: the data sheet's worked packet, angles against rotations, false headers."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_service import rotations
from foottrack_service.imu.devices.serial_devices import RvcDevice
from foottrack_service.imu.formats.rvc import LENGTH, RvcDecoder, quaternion
from foottrack_service.imu.sample import DeviceSample

RECORDING = Path(os.environ.get("FOOTTRACK_DATA", Path(__file__).parents[4] / "shared" / "data")) / "bno08x_rvc"
PACKET = bytes.fromhex("AAAADE01 0092FF25 088DFEEC FFD10300 0000E7")


@pytest.mark.real
@pytest.mark.skipif(not RECORDING.is_dir(), reason=f"no recordings at {RECORDING}")
def test_the_worked_packet_here_is_the_data_sheets() -> None:
    assert bytes.fromhex((RECORDING / "datasheet_example.hex").read_text()) == PACKET


def test_the_data_sheets_worked_packet() -> None:
    (sample,) = RvcDecoder().feed(PACKET)
    assert sample.ticks == 222
    assert sample.acc == pytest.approx(tuple(mg * STANDARD_GRAVITY / 1000.0 for mg in (-371, -20, 977)))
    yaw, pitch, roll = np.radians([-0.01, -1.10, 20.85])
    expected = rotations.multiply(
        rotations.multiply(rotations.from_axis_angle([0, 0, 1], yaw), rotations.from_axis_angle([1, 0, 0], pitch)),
        rotations.from_axis_angle([0, 1, 0], roll),
    )
    np.testing.assert_allclose(sample.q, expected, atol=1e-12)


def test_its_accelerations_agree_with_its_angles() -> None:
    """The chip was still: what it felt is gravity, which its angles place within what noise and scale allow."""
    (sample,) = RvcDecoder().feed(PACKET)
    assert sample.q is not None
    up = rotations.rotate(sample.q, np.asarray(sample.acc) / np.linalg.norm(sample.acc))
    assert np.degrees(np.arccos(up[2])) < 0.1


@given(st.integers(-18000, 18000), st.integers(-9000, 9000), st.integers(-18000, 18000))
def test_any_angles_survive_the_wire(yaw: int, pitch: int, roll: int) -> None:
    q = quaternion(yaw, pitch, roll)
    (sample,) = RvcDecoder().feed(RvcDevice().measure(DeviceSample(0, (0.0, 0.0, 9.8), q=q)))
    assert sample.q is not None
    # Near the pole yaw and roll share what rounding leaves.
    assert rotations.angle_between(sample.q, q) < 4e-4


def test_yaw_counts_as_a_compass_does_unless_told_otherwise() -> None:
    turned_left = rotations.from_axis_angle([0, 0, 1], 0.5)
    sent = RvcDevice().measure(DeviceSample(0, (0.0, 0.0, 9.8), q=tuple(turned_left)))
    assert int.from_bytes(sent[3:5], "little", signed=True) == -2865
    (sample,) = RvcDecoder(yaw_clockwise=False).feed(sent)
    np.testing.assert_allclose(sample.q, rotations.conjugate(turned_left), atol=1e-4)


def test_a_header_inside_the_data_and_one_byte_before() -> None:
    decoder = RvcDecoder()
    stream = b"\xaa" + PACKET + b"\xaa\xaa\x01" + PACKET + PACKET
    assert len(decoder.feed(stream)) == 3
    assert decoder.drops["checksum"] >= 1
    assert decoder.drops["garbage"] == 4


def test_the_start_banner_is_garbage() -> None:
    decoder = RvcDecoder()
    banner = b"%Hillcrest Labs 10003608\n%SW Ver 3.2.x\n"
    assert len(decoder.feed(banner + PACKET)) == 1
    assert decoder.drops == {"garbage": len(banner)}


def test_angles_that_cannot_be_are_dropped_despite_a_right_sum() -> None:
    body = bytearray(PACKET[2:-1])
    body[3:5] = (9001).to_bytes(2, "little")
    decoder = RvcDecoder()
    assert decoder.feed(b"\xaa\xaa" + bytes(body) + bytes([sum(body) & 0xFF])) == []
    assert decoder.drops["range"] == 1
    assert LENGTH == 19
