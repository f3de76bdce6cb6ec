"""VMC's datagrams: poses by hand, clocks, losses, and what is no VMC."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from foottrack_service import rotations
from foottrack_service.headset.devices.vmc import VmcSender, osc_bundle
from foottrack_service.headset.rigid import rigid
from foottrack_service.headset.settings import RigidSettings, VmcSettings
from foottrack_service.headset.sources.vmc import VmcReceiver

ARRIVAL = 5 * 10**12
HALF = math.sqrt(0.5)
NO_TURN = (0.0, 0.0, 0.0, 1.0)
HEAD = rigid((0.3, 1.6, -0.5), rotations.from_rotation_vector([0.2, 0.7, -0.1]))


def bone(name: str, p: tuple[float, ...], q: tuple[float, ...] = NO_TURN) -> tuple[str, list[Any]]:
    return "/VMC/Ext/Bone/Pos", [name, *p, *q]


@pytest.mark.parametrize("by_bone", [False, True])
def test_a_pose_survives_the_wire(by_bone: bool) -> None:
    (message,) = VmcReceiver(VmcSettings()).receive(VmcSender(by_bone).datagram(1.0, HEAD), ARRIVAL)
    assert message.t == ARRIVAL
    assert message.body.p is not None and message.body.q is not None
    np.testing.assert_allclose(message.body.p, HEAD.p, atol=1e-6)
    assert rotations.angle_between(message.body.q, HEAD.q) < 1e-6


def test_the_head_bone_hangs_on_its_spine() -> None:
    """A root a metre ahead (Unity: +Z) that looks right; hips at 1 m, and 0.6 m of spine that leans 90 deg forward."""
    datagram = osc_bundle(
        [
            ("/VMC/Ext/Root/Pos", ["root", 0.0, 0.0, 1.0, 0.0, HALF, 0.0, HALF]),
            bone("Hips", (0.0, 1.0, 0.0)),
            bone("Spine", (0.0, 0.1, 0.0), (HALF, 0.0, 0.0, HALF)),
            bone("LeftHand", (9.0, 9.0, 9.0)),
            bone("Neck", (0.0, 0.3, 0.0)),
            bone("Head", (0.0, 0.2, 0.0), (-HALF, 0.0, 0.0, HALF)),
        ]
    )
    settings = VmcSettings(eyes=RigidSettings(p=(0.0, 0.1, -0.05)))
    (message,) = VmcReceiver(settings).receive(datagram, ARRIVAL)
    assert message.body.p is not None and message.body.q is not None
    # Ours: the root is at z = -1 and looks to +x; the spine then lies along +x, and the eyes look there.
    np.testing.assert_allclose(message.body.p, (0.5 + 0.05, 1.1 + 0.1, -1.0), atol=1e-6)
    np.testing.assert_allclose(rotations.rotate(message.body.q, [0.0, 0.0, -1.0]), (1.0, 0.0, 0.0), atol=1e-6)


def test_a_spine_in_an_earlier_datagram_counts() -> None:
    receiver = VmcReceiver(VmcSettings())
    assert receiver.receive(osc_bundle([bone("Hips", (0.0, 1.0, 0.0))]), ARRIVAL) == []
    (message,) = receiver.receive(osc_bundle([bone("Head", (0.0, 0.6, 0.0))]), ARRIVAL)
    assert message.body.p == pytest.approx((0.0, 1.6, 0.0))


def test_the_runtime_s_own_pose_goes_before_the_scaled_one_and_the_bone() -> None:
    def frame(height: float, *kinds: str) -> bytes:
        messages: list[tuple[str, list[Any]]] = [bone("Head", (0.0, height, 0.0))]
        messages += [
            (f"/VMC/Ext/Hmd/Pos{kind}", ["serial", 0.0, height + 0.1 * k, 0.0, *NO_TURN])
            for k, kind in enumerate(kinds, start=1)
        ]
        return osc_bundle(messages)

    receiver = VmcReceiver(VmcSettings())
    (best,) = receiver.receive(frame(1.5, "", "/Local"), ARRIVAL)
    assert best.body.p == pytest.approx((0.0, 1.7, 0.0))
    # A datagram without it is not the end of it; a second without is.
    assert receiver.receive(frame(1.5), ARRIVAL + 10**7) == []
    (later,) = receiver.receive(frame(1.5), ARRIVAL + 2 * 10**9)
    assert later.body.p == pytest.approx((0.0, 1.5, 0.0))
    (chosen,) = VmcReceiver(VmcSettings(take="bone")).receive(frame(1.5, "/Local"), ARRIVAL)
    assert chosen.body.p == pytest.approx((0.0, 1.5, 0.0))
    assert VmcReceiver(VmcSettings(take="hmd")).receive(frame(1.5), ARRIVAL) == []


def test_stamps_follow_the_sender_s_clock_and_the_known_latency_is_taken_off() -> None:
    """Sender 200 ppm slow, arrivals 8 ms late plus an exponential of 3 ms."""
    receiver = VmcReceiver(VmcSettings(latency=0.008))
    sender = VmcSender()
    rng = np.random.default_rng(1)
    errors = []
    for k in range(2000):
        true = k / 90.0
        arrival = true + 0.008 + rng.exponential(0.003)
        (message,) = receiver.receive(sender.datagram(100.0 + true * (1.0 - 2e-4), HEAD), ARRIVAL + int(arrival * 1e9))
        errors.append((message.t - ARRIVAL) * 1e-9 - true)
    assert np.abs(errors[300:]).max() < 1.5e-3
    assert np.std(errors[300:]) < 0.4e-3
    assert receiver.skew == pytest.approx(2e-4, abs=1e-4)


def test_a_sender_without_a_clock_is_stamped_by_arrival() -> None:
    receiver = VmcReceiver(VmcSettings(latency=0.005))
    (message,) = receiver.receive(osc_bundle([bone("Head", (0.0, 1.6, 0.0))]), ARRIVAL)
    assert message.t == ARRIVAL - 5_000_000


@pytest.mark.parametrize("begun_s", [12 * 3600.0, 40 * 3600.0], ids=["coarse by 4 ms", "coarse by 16 ms"])
def test_a_sender_that_has_run_for_a_day_loses_no_pose_and_no_millisecond(begun_s: float) -> None:
    receiver = VmcReceiver(VmcSettings())
    errors = []
    for k in range(600):
        arrival = ARRIVAL + round(k * 1e9 / 90.0)
        (message,) = receiver.receive(VmcSender().datagram(begun_s + k / 90.0, HEAD), arrival)
        errors.append(message.t - arrival)
    assert max(map(abs, errors)) < 1_000_000
    assert not receiver.drops


def test_a_sender_whose_clock_stands_still_is_stamped_by_arrival() -> None:
    receiver = VmcReceiver(VmcSettings())
    stamps = [receiver.receive(VmcSender().datagram(0.0, HEAD), ARRIVAL + k * 11_000_000)[0].t for k in range(200)]
    assert stamps == [ARRIVAL + k * 11_000_000 for k in range(200)]


def test_a_sender_that_lost_its_head_says_so_and_so_does_silence() -> None:
    receiver, sender = VmcReceiver(VmcSettings()), VmcSender()
    assert receiver.idle(ARRIVAL) == []
    receiver.receive(sender.datagram(0.0, HEAD), ARRIVAL)
    (lost,) = receiver.receive(sender.datagram(0.011, None), ARRIVAL + 11_000_000)
    assert not lost.body.tracked and lost.body.p is None
    (found,) = receiver.receive(sender.datagram(0.022, HEAD), ARRIVAL + 22_000_000)
    assert found.body.tracked
    assert receiver.idle(ARRIVAL + 100_000_000) == []
    (silent,) = receiver.idle(ARRIVAL + 400_000_000)
    assert not silent.body.tracked and silent.t == ARRIVAL + 400_000_000


@pytest.mark.parametrize(
    "values",
    [
        ["Head", 0.0, 1.6, 0.0, 0.0, 0.0, 0.0, 0.5],
        ["Head", 0.0, math.nan, 0.0, *NO_TURN],
        ["Head", 0.0, 1.6],
        ["Head", 0.0, "high", 0.0, *NO_TURN],
        [],
    ],
)
def test_values_that_cannot_be_are_counted(values: list[Any]) -> None:
    receiver = VmcReceiver(VmcSettings())
    assert receiver.receive(osc_bundle([("/VMC/Ext/Bone/Pos", values)]), ARRIVAL) == []
    assert sum(receiver.drops.values()) == (1 if values else 0)


@given(st.binary(max_size=300))
@example(b"#bundle\x00" + b"\x00" * 7 + b"\x01" + b"\x7f\xff\xff\xff")
@example(b"/VMC/Ext/T\x00\x00,f\x00\x00")
def test_nothing_that_arrives_harms(data: bytes) -> None:
    receiver = VmcReceiver(VmcSettings())
    good = VmcSender().datagram(1.0, HEAD)
    assert receiver.receive(data, ARRIVAL) == []
    assert len(receiver.receive(good, ARRIVAL + 1)) == 1


@given(st.data())
def test_nor_does_a_datagram_with_bytes_changed(data: st.DataObject) -> None:
    good = bytearray(VmcSender(bone=True).datagram(1.0, HEAD))
    for _ in range(data.draw(st.integers(1, 6))):
        good[data.draw(st.integers(0, len(good) - 1))] = data.draw(st.integers(0, 255))
    for message in VmcReceiver(VmcSettings()).receive(bytes(good), ARRIVAL):
        assert message.body.p is None or np.all(np.isfinite(message.body.p))
