"""Each fault does what it says, within its window, and leaves the rest as it was."""

from __future__ import annotations

from collections import defaultdict
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest

from foottrack_protocol import DecodeError, Message, Reason, decode, encode
from foottrack_service import rotations
from foottrack_service.rotations import Array
from foottrack_service.simulation import faults as f
from foottrack_service.simulation.scenario import simulate

S = 1_000_000_000
PICTURES = ("marker/left", "marker/right", "depth/left", "depth/right")


class Played(NamedTuple):
    streams: dict[str, list[Message]]
    false: frozenset[tuple[str, int]]


@cache
def scenario(*faults: f.Fault, task: str = "still") -> Played:
    simulated = simulate(task, 7, seconds=8.0, faults=faults)
    streams: dict[str, list[Message]] = defaultdict(list)
    for _, message in simulated.messages():
        streams[message.stream].append(message)
    return Played(streams, simulated.false_fixes())


def stream(of: Played, name: str) -> list[Message]:
    return of.streams[name]


HEALTHY = scenario()


def untouched(of: Played, *names: str) -> bool:
    """Whether all streams but these are as without the fault."""
    return all(stream(of, name) == stream(HEALTHY, name) for name in HEALTHY.streams if name not in names)


def inside(message: Message, start: float = 3.0, end: float = 5.0) -> bool:
    return start * S <= message.t < end * S


@pytest.mark.parametrize("fault", [f.ImuDropout(side="left", start=3.0, end=5.0), f.CameraBlackout(start=3.0, end=5.0)])
def test_silence(fault: f.Fault) -> None:
    hurt = scenario(fault)
    names = (
        ("imu/left",)
        if isinstance(fault, f.ImuDropout)
        else ("marker/left", "marker/right", "depth/left", "depth/right")
    )
    for name in names:
        messages = stream(hurt, name)
        assert not any(inside(m) for m in messages)
        assert len(messages) == len([m for m in stream(HEALTHY, name) if not inside(m)])
        assert [m.seq for m in messages] == list(range(len(messages)))
    assert untouched(hurt, *names)


def test_packet_loss_takes_a_share() -> None:
    hurt = scenario(f.PacketLoss(side="right", start=3.0, end=5.0, share=0.5))
    left = sum(inside(m) for m in stream(hurt, "imu/right")) / sum(inside(m) for m in stream(HEALTHY, "imu/right"))
    assert 0.35 < left < 0.65
    assert untouched(hurt, "imu/right")


def test_stamps_repeat_and_reverse() -> None:
    repeated = np.diff([m.t for m in stream(scenario(f.RepeatedStamps(side="left", start=3.0, end=5.0)), "imu/left")])
    assert 30 < (repeated == 0).sum() < 90
    assert repeated.min() == 0
    reversed_ = np.diff([m.t for m in stream(scenario(f.ReversedStamps(side="left", start=3.0, end=5.0)), "imu/left")])
    assert 25 < (reversed_ < 0).sum() < 90


@pytest.mark.parametrize("source", ["imu-left", "camera", "headset"])
def test_clocks_jump(source: Any) -> None:
    hurt = scenario(f.ClockJump(source=source, start=3.0, end=5.0, offset=0.25))
    names = [name for name, messages in hurt.streams.items() if messages[0].src == source]
    for name in names:
        shift = np.array([a.t - b.t for a, b in zip(stream(hurt, name), stream(HEALTHY, name), strict=True)])
        expected = np.array([inside(m) for m in stream(HEALTHY, name)]) * 250_000_000
        assert (np.abs(shift - expected) > 2).sum() <= 2, "the window's ends are decided on the sampling instants"
        assert shift.max() == pytest.approx(250_000_000, abs=2)
    assert untouched(hurt, *names)


def test_saturation_clips() -> None:
    hurt = stream(scenario(f.Saturation(side="left", start=3.0, end=5.0, limit=9.0)), "imu/left")
    assert max(m.data.acc[1] for m in hurt if inside(m)) == 9.0
    assert min(m.data.acc[1] for m in hurt if not inside(m)) > 9.1


def test_nan_is_refused_by_the_codec() -> None:
    hurt = stream(scenario(f.NotANumber(side="left", start=3.0, end=5.0, share=0.2)), "imu/left")
    broken = [m for m in hurt if not np.isfinite(m.data.acc).all()]
    assert 20 < len(broken) < 65
    assert all(inside(m) for m in broken)
    with pytest.raises(DecodeError) as error:
        decode(encode(broken[0]))
    assert error.value.reason is Reason.NOT_FINITE


def test_false_tags_lie_at_one_spot() -> None:
    hurt = scenario(f.FalseTags(side="left", start=3.0, end=5.0, share=0.8))
    false = hurt.false
    found = [m for m in stream(hurt, "marker/left") if ("marker/left", m.seq) in false and inside(m)]
    assert 70 < len(found) < 120
    spots = np.array([m.data.p for m in found])
    assert np.linalg.norm(spots - np.median(spots, axis=0), axis=-1).max() < 0.1
    honest = np.mean([m.data.p for m in stream(HEALTHY, "marker/left")], axis=0)
    assert np.linalg.norm(np.median(spots, axis=0) - honest) > 0.05
    assert untouched(hurt, "marker/left")


def test_sides_are_swapped() -> None:
    hurt = scenario(f.SwappedSides(start=3.0, end=5.0))
    middles = {
        side: np.median([m.data.p for m in stream(HEALTHY, f"marker/{side}")], axis=0) for side in ("left", "right")
    }
    for side, other in (("left", "right"), ("right", "left")):
        for name in (f"marker/{side}", f"depth/{side}"):
            swapped = np.median([m.data.p for m in stream(hurt, name) if inside(m)], axis=0)
            assert np.linalg.norm(swapped - middles[other]) < 0.08
            assert np.linalg.norm(swapped - middles[side]) > 0.2
            assert all((name, m.seq) in hurt.false for m in stream(hurt, name) if inside(m, 3.1, 4.9))
    assert untouched(hurt, *PICTURES)


def test_the_other_shoe_is_taken_for_this_one() -> None:
    hurt = scenario(f.WrongIdentity(side="left", start=3.0, end=5.0))
    left = {m.t: m for m in stream(hurt, "marker/left") if inside(m)}
    shared = [m for m in stream(hurt, "marker/right") if m.t in left]
    assert len(shared) > 100
    assert all(left[m.t].data == m.data for m in shared)
    assert untouched(hurt, "marker/left")


def test_the_headset_is_lost() -> None:
    hurt = scenario(f.HeadsetLost(start=3.0, end=5.0))
    for message in stream(hurt, "head/pose"):
        assert message.data.tracked is not inside(message)
        assert (message.data.p is None) is inside(message)
    assert untouched(hurt, "head/pose")


@pytest.mark.parametrize("known", [True, False])
def test_the_stage_is_recentred(known: bool) -> None:
    fault = f.HeadsetRecentred(start=4.0, yaw=0.5, shift=(0.4, -0.3), known=known)
    hurt = scenario(fault, task="head-bench")
    healthy = scenario(task="head-bench")
    turn, shift = rotations.from_yaw(0.5), np.array([0.4, 0.0, -0.3])
    for name in ("head/pose", "truth/left"):
        for old, new in zip(stream(healthy, name), stream(hurt, name), strict=True):
            moved: Array = shift + rotations.rotate(turn, old.data.p) if old.t >= 4.0 * S else np.array(old.data.p)
            np.testing.assert_allclose(new.data.p, moved, atol=1e-9)
    poses = stream(hurt, "head/pose")
    assert all(m.data.origin == int(m.t >= 4.0 * S) for m in poses)
    said = [m for m in poses if m.data.moved is not None]
    assert said == [m for m in poses if m.data.origin == 1][: int(known)], "the first message of the new origin says it"
    for message in said:
        np.testing.assert_allclose(message.data.moved.p, shift)
        np.testing.assert_allclose(message.data.moved.q, turn)
    assert stream(hurt, "marker/left") == stream(healthy, "marker/left"), "the camera knows no stage"


def test_recentring_twice_goes_on_from_where_it_was() -> None:
    hurt = scenario(
        f.HeadsetRecentred(start=2.0, yaw=0.5, shift=(0.4, 0.0)),
        f.HeadsetRecentred(start=5.0, yaw=-0.2, shift=(0.0, 1.0)),
    )
    first, last = stream(HEALTHY, "truth/left")[-1], stream(hurt, "truth/left")[-1]
    once = rotations.rotate(rotations.from_yaw(0.5), first.data.p) + [0.4, 0.0, 0.0]
    np.testing.assert_allclose(
        last.data.p, rotations.rotate(rotations.from_yaw(-0.2), once) + [0.0, 0.0, 1.0], atol=1e-9
    )


def test_faults_do_not_change_each_others_draws() -> None:
    loss = f.PacketLoss(side="left", start=3.0, end=5.0)
    one = stream(scenario(loss), "imu/left")
    both = stream(scenario(loss, f.PacketLoss(side="right", start=1.0, end=7.0)), "imu/left")
    assert one == both
