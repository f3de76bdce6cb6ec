"""SlimeVR trackers: packets by hand, the conversation, damage."""

from __future__ import annotations

import math
import struct
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from imu_streams import motion

from foottrack_service import rotations
from foottrack_service.imu.devices.slimevr import SlimeVrDevice
from foottrack_service.imu.formats import slimevr
from foottrack_service.imu.formats.slimevr import Acceleration, Handshake, Rotation, SensorInfo
from foottrack_service.imu.sample import DeviceSample, gravity_in_device
from foottrack_service.imu.slimevr import MAX_TRACKERS, SlimeVrServer

TRACKER = ("192.168.0.7", 6969)
MAC = "A0:B1:C2:D3:E4:F5"


def connected(protocol: int = 22, acc_turn_rad: float | None = None) -> SlimeVrServer:
    server = SlimeVrServer(lambda name: acc_turn_rad)
    server.receive(slimevr.encode_handshake(Handshake(protocol, "0.5.4", MAC)), TRACKER, 0.0)
    return server


def test_a_handshake_by_hand() -> None:
    # Type 3, number 0, board 1, sensor 2, MCU 3, three unused, protocol 22, "0.5.4", MAC, tracker type and texts.
    packet = struct.pack(">IQ7I", 3, 0, 1, 2, 3, 0, 0, 0, 22) + b"\x050.5.4" + bytes.fromhex("a0b1c2d3e4f5") + bytes(6)
    server = SlimeVrServer()
    samples, answers = server.receive(packet, TRACKER, 0.0)
    assert samples == []
    (answer,) = answers
    assert answer.address == TRACKER
    assert answer.data[:13] == b"\x03Hey OVR =D 5"
    assert server.trackers == [MAC]


def test_a_short_old_handshake_names_the_tracker_by_its_address() -> None:
    server = SlimeVrServer()
    server.receive(struct.pack(">IQ", 3, 0), TRACKER, 0.0)
    assert server.trackers == ["192.168.0.7"]


def test_rotation_then_acceleration_is_a_sample() -> None:
    server = connected()
    half = math.radians(15.0)
    rotation = struct.pack(">IQBB4fB", 17, 1, 0, 1, math.sin(half), 0.0, 0.0, math.cos(half), 3)
    acceleration = struct.pack(">IQ3fB", 4, 2, 0.5, 0.0, -1.0, 0)
    assert server.receive(rotation, TRACKER, 0.1) == ([], [])
    ((name, sample),), _ = server.receive(acceleration, TRACKER, 0.1)
    assert name == f"{MAC}/0"
    assert sample.acc == pytest.approx((0.5, 9.80665 * 0.5, 9.80665 * math.sqrt(0.75) - 1.0), abs=1e-5)
    assert sample.accuracy == 3
    assert sample.ticks is None


def test_two_sensors_of_one_tracker_in_a_bundle_are_two() -> None:
    server = connected()
    inner = [
        slimevr.encode_rotation(0, Rotation(0, (0.0, 0.0, 0.0, 1.0), 3)),
        slimevr.encode_rotation(0, Rotation(1, (1.0, 0.0, 0.0, 0.0), 3)),
        slimevr.encode_acceleration(0, Acceleration(1, (0.0, 0.0, 0.0))),
        slimevr.encode_acceleration(0, Acceleration(0, (0.0, 0.0, 0.0))),
    ]
    samples, _ = server.receive(slimevr.encode_bundle(1, inner), TRACKER, 0.1)
    assert [(name[-1], round(sample.acc[2], 2)) for name, sample in samples] == [("1", -9.81), ("0", 9.81)]


def test_the_compact_bundle_by_hand() -> None:
    server = connected()
    packed = struct.pack(">B7h", 2, 0, 0, 0, 32767, 128, -64, 0)
    datagram = struct.pack(">IQ", 101, 1) + bytes([len(packed) + 1, 23]) + packed
    ((name, sample),), _ = server.receive(datagram, TRACKER, 0.1)
    assert name == f"{MAC}/2"
    assert sample.acc == pytest.approx((1.0, -0.5, 9.80665))


@pytest.mark.parametrize(
    ("protocol", "turn", "expected"), [(22, None, (1, 0)), (21, None, (0, -1)), (22, math.pi, (-1, 0))]
)
def test_axes_of_older_firmwares(protocol: int, turn: float | None, expected: tuple[int, int]) -> None:
    server = connected(protocol, turn)
    server.receive(slimevr.encode_rotation(1, Rotation(0, (0.0, 0.0, 0.0, 1.0), 3)), TRACKER, 0.1)
    ((_, sample),), _ = server.receive(slimevr.encode_acceleration(2, Acceleration(0, (1.0, 0.0, 0.0))), TRACKER, 0.1)
    assert sample.acc[:2] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("bundles", [True, False])
def test_a_tracker_finds_the_server_and_streams(bundles: bool) -> None:
    server, tracker = SlimeVrServer(), SlimeVrDevice(MAC, bundles)
    sent = motion(50, 10_000)
    assert tracker.measure(sent[0]) == []
    got: list[DeviceSample] = []
    for k, sample in enumerate(sent):
        now_s = k * 0.01
        uplink = tracker.idle(now_s) + tracker.measure(sample)
        while uplink:
            downlink = []
            for datagram in uplink:
                samples, answers = server.receive(datagram, TRACKER, now_s)
                got += [item.sample for item in samples]
                downlink += answers
            uplink = [reply for answer in downlink for reply in tracker.hear(answer.data, now_s)]
        for answer in server.beat(now_s):
            for reply in tracker.hear(answer.data, now_s):
                server.receive(reply, TRACKER, now_s + 0.004)
    assert len(got) == 49
    for expected, sample in zip(sent[1:], got, strict=True):
        np.testing.assert_allclose(sample.acc, expected.acc, atol=1e-5)
        assert rotations.angle_between(sample.q, expected.q) < 1e-6
    # Half the round trip of the ping.
    assert got[-1].age_us == 2000
    assert not any(server.drops.values())


def test_a_silent_tracker_is_forgotten_and_searches_again() -> None:
    server, tracker = SlimeVrServer(), SlimeVrDevice(MAC)
    (search,) = tracker.idle(0.0)
    assert tracker.idle(0.5) == []
    for answer in server.receive(search, TRACKER, 0.5)[1]:
        tracker.hear(answer.data, 0.5)
    assert tracker.connected
    assert len(server.beat(1.0)) == 2
    assert server.beat(1.1) == []
    assert server.beat(4.0) == []
    assert server.trackers == []
    assert len(tracker.idle(5.0)) == 1
    assert not tracker.connected


def test_one_slow_echo_moves_no_stamp() -> None:
    """A radio that sleeps answers late now and then: the samples of that half second are no older than the others."""
    server = connected()
    ages = []
    for beat, round_trip_s in enumerate([0.006, 0.004, 0.2, 0.01, 0.15]):
        now_s = 1.0 + beat
        (ping,) = (answer.data for answer in server.beat(now_s) if answer.data[3] == slimevr.Kind.PING)
        server.receive(ping, TRACKER, now_s + round_trip_s)
        both = [slimevr.encode_rotation(0, Rotation(0, (0.0, 0.0, 0.0, 1.0), 3))]
        both.append(slimevr.encode_acceleration(0, Acceleration(0, (0.0, 0.0, 0.0))))
        ((_, sample),), _ = server.receive(slimevr.encode_bundle(beat + 1, both), TRACKER, now_s + 0.3)
        ages.append(sample.age_us)
    assert ages == [3000, 2000, 2000, 2000, 2000]


def test_sensor_info_and_features_are_answered() -> None:
    server = connected()
    _, (info,) = server.receive(struct.pack(">IQBBB", 15, 1, 0, 1, 4), TRACKER, 0.1)
    assert info.data == slimevr.sensor_info_reply(SensorInfo(0, 1)) == bytes.fromhex("0000000f0001")
    _, (features,) = server.receive(struct.pack(">IQB", 22, 2, 6), TRACKER, 0.1)
    assert features.data == bytes.fromhex("00000016000000000000000003")


def test_what_is_dropped_is_counted_by_reason() -> None:
    server = connected()
    good = slimevr.encode_rotation(5, Rotation(0, (0.0, 0.0, 0.0, 1.0), 3))
    server.receive(good, ("10.0.0.1", 1), 0.1)
    server.receive(good, TRACKER, 0.1)
    server.receive(good, TRACKER, 0.1)
    server.receive(slimevr.encode_rotation(6, Rotation(0, (0.0, 0.0, 0.0, 0.5), 3)), TRACKER, 0.1)
    server.receive(slimevr.encode_rotation(7, Rotation(0, (math.nan, 0.0, 0.0, 0.5), 3)), TRACKER, 0.1)
    server.receive(slimevr.encode_acceleration(8, Acceleration(0, (math.inf, 0.0, 0.0))), TRACKER, 0.1)
    server.receive(slimevr.encode_acceleration(9, Acceleration(3, (0.0, 0.0, 0.0))), TRACKER, 0.1)
    server.receive(good[:20], TRACKER, 0.1)
    server.receive(b"", TRACKER, 0.1)
    assert server.drops == {"stranger": 1, "late": 2, "quaternion": 2, "range": 1, "unpaired": 1, "short": 2}


def test_strangers_do_not_fill_the_memory() -> None:
    server = SlimeVrServer()
    for k in range(MAX_TRACKERS + 5):
        server.receive(struct.pack(">IQ", 3, 0), (f"10.0.0.{k}", 1), 0.0)
    assert len(server.trackers) == MAX_TRACKERS
    assert server.drops == {"crowded": 5}


@given(st.lists(st.binary(max_size=80), max_size=10), st.sampled_from([0, 3, 4, 10, 15, 17, 22, 23, 100, 101]))
@settings(max_examples=200, deadline=None)
def test_no_datagram_harms(bodies: list[bytes], kind: int) -> None:
    server = connected()
    for number, body in enumerate(bodies, start=1):
        samples, _ = server.receive(struct.pack(">IQ", kind, number) + body, TRACKER, 0.1)
        for _, sample in samples:
            assert all(map(math.isfinite, sample.acc))
            np.testing.assert_allclose(math.hypot(*(sample.q or ())), 1.0)
    assert slimevr.decode(b"\0" * 11, Counter()) is None
    assert gravity_in_device((0.0, 0.0, 0.0, 1.0))[2] > 9.8
