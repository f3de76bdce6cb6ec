"""What every foot's filter must pass, whatever its method; and what one that recovers must pass beyond that."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from foot_runs import START, Run, remember, run

from foottrack_service import rotations as rot
from foottrack_service.config import Settings
from foottrack_service.evaluation.run import run_filter
from foottrack_service.fusion.interface import FootFilter, HeadSample, ImuSample, OpticalFix
from foottrack_service.simulation import faults as f
from foottrack_service.simulation import people
from foottrack_service.simulation.footwear import Feet
from foottrack_service.simulation.scenario import Scenario, simulate
from foottrack_service.simulation.stride import CAUTIOUS, Planner
from foottrack_service.simulation.truth import Truth

FROM, TO = 3.0, 4.0
"""s: when faults begin and end."""
LENGTH = 5.5
WINDOW = {"start": FROM, "end": TO}
FAULTS: dict[str, tuple[f.Fault, ...]] = {
    "dropped packets": (f.PacketLoss(side="left", **WINDOW),),
    "a hole of 0.3 s": (f.ImuDropout(side="left", start=FROM, end=FROM + 0.3),),
    "a hole of 2 s": (f.ImuDropout(side="left", start=FROM - 1.0, end=TO),),
    "repeated stamps": (f.RepeatedStamps(side="left", **WINDOW),),
    "reversed stamps": (f.ReversedStamps(side="left", **WINDOW),),
    "a saturated accelerometer": (f.Saturation(side="left", **WINDOW),),
    "NaN": (f.NotANumber(side="left", **WINDOW),),
    "false tags on the floor": (f.FalseTags(side="left", **WINDOW),),
    "the other shoe's tag": (f.WrongIdentity(side="left", **WINDOW),),
    "swapped sides": (f.SwappedSides(**WINDOW),),
    "the IMU's clock jumps": (f.ClockJump(source="imu-left", **WINDOW),),
    "the camera's clock jumps": (f.ClockJump(source="camera", **WINDOW),),
    "the headset's clock jumps": (f.ClockJump(source="headset", **WINDOW),),
    "no pictures": (f.CameraBlackout(**WINDOW),),
    "no headset": (f.HeadsetLost(**WINDOW),),
    "a known recentring": (f.HeadsetRecentred(start=FROM),),
    "an unknown recentring": (f.HeadsetRecentred(start=FROM, known=False),),
}


@cache
def scenario(task: str, fault: str | None, hz: float = 200.0, kind: str = "fused", left_imu: bool = True) -> Scenario:
    """A short run of a task, or of the half turn, with a fault of FAULTS."""
    faults = FAULTS[fault] if fault else ()
    motion = _half_turn if task == "half turn" else None
    made = simulate(
        task,
        11,
        seconds=LENGTH,
        imu_hz=hz,
        imu=kind,
        left_imu=left_imu,
        faults=faults,
        start=START,
        motion=motion,
    )
    return remember(made, faults)


def _half_turn(seconds: float, settings: Settings, feet: Feet, random: np.random.Generator) -> Truth:
    """Half a turn to the left on the spot."""
    plan = Planner(random)
    plan.turn(np.pi, CAUTIOUS, 0.45)
    return people.scene(seconds, settings, feet, random, plan, people.Bearing())


class FiniteMixin:
    """No number that is none gets out, nothing is raised, whatever comes in."""

    believes_numbers = False
    """Whether it relies on the codec and on the core to keep NaN away; then that is what is tested."""
    settings = Settings()
    """With which the core makes this filter."""
    left_imu = True
    after_a_turn = (0.015, 0.06)
    """m and rad, half a second after a turn on the spot."""

    def make(self) -> FootFilter:
        """A new left foot's filter with default settings."""
        raise NotImplementedError

    def test_nothing_is_known_before_anything_came(self) -> None:
        assert self.make().estimate(START) is None

    @pytest.mark.parametrize("fault", FAULTS)
    def test_stays_finite(self, fault: str) -> None:
        faulty = scenario("tracker-moving", fault, left_imu=self.left_imu)
        if fault == "NaN" and self.believes_numbers:
            _assert_the_core_guards(self.settings, faulty)
            return
        found = run(self.make, faulty)
        assert len(found.t) > 300
        _assert_sound(found)

    def test_standing_still(self) -> None:
        still = scenario("still", None, left_imu=self.left_imu)
        assert np.median(run(self.make, still).errors(still, "left", 1.0)) < 0.02

    def test_a_half_turn(self) -> None:
        turning = scenario("half turn", None, left_imu=self.left_imu)
        found = run(self.make, turning)
        _assert_sound(found)
        late = [i for i, t in enumerate(found.t) if t > LENGTH - 0.4]
        assert found.errors(turning, "left", LENGTH - 0.4).max() < self.after_a_turn[0]
        _, true = turning.truth.feet["left"].pose(np.array(found.t)[late])
        ours = np.array([found.estimates[i].q for i in late])
        assert float(np.max(rot.angle_between(ours, true))) < self.after_a_turn[1]

    def test_a_sudden_brake(self) -> None:
        flicked = scenario("sudden-move", None, left_imu=self.left_imu)
        found = run(self.make, flicked)
        _assert_sound(found)
        t = np.array(found.t)
        speed = np.linalg.norm(flicked.truth.feet["left"].velocity(t), axis=1)
        stood = np.array([(speed[(t > moment - 0.5) & (t <= moment)] < 0.01).all() for moment in t])
        assert (speed > 1.0).any() and (stood & (t > 3.0)).any()
        assert found.errors(flicked, "left")[stood & (t > 1.0)].max() < 0.02

    @pytest.mark.parametrize("t", [0, -(2**62), 2**62])
    def test_any_stamp(self, t: int) -> None:
        filter_ = self.make()
        for stamp in (START, START + 5_000_000, t, START + 10_000_000, START + 15_000_000):
            filter_.on_imu(ImuSample(stamp, np.array([0.0, 9.8, 0.0]), np.zeros(3), None))
        estimate = filter_.estimate(START + 20_000_000)
        assert estimate is None or np.isfinite([*estimate.p, *estimate.q, *estimate.v]).all()

    def test_two_runs_give_the_same_bits(self) -> None:
        twice = [run(self.make, scenario("tracker-moving", "false tags on the floor")) for _ in range(2)]
        assert all((a.p == b.p).all() for a, b in zip(twice[0].estimates, twice[1].estimates, strict=True))


class RecoveryMixin(FiniteMixin):
    """Errors in millimetres, and back within 10 of them after half a second of good measurements."""

    @pytest.mark.parametrize("fault", FAULTS)
    @pytest.mark.parametrize("task", ["tracker-moving", "head-moving"])
    def test_nothing_poisons_it(self, task: str, fault: str) -> None:
        run_ = scenario(task, fault)
        over = FROM if "recentring" in fault else min(TO, max(each.end for each in FAULTS[fault]))
        found = run(self.make, run_)
        assert found.errors(run_, "left", over + 0.5, over + 0.7).max() < 0.010

    @pytest.mark.parametrize("kind", ["fused", "raw"])
    def test_a_moving_foot_in_sight(self, kind: str) -> None:
        moving = scenario("tracker-moving", None, kind=kind)
        errors = run(self.make, moving).errors(moving, "left", 1.0)
        assert errors.mean() < 0.007
        assert errors.max() < 0.03

    def test_standing_still_in_millimetres(self) -> None:
        still = scenario("still", None)
        found = run(self.make, still)
        assert found.errors(still, "left", 1.0).max() < 0.008
        places = np.array([e.p for t, e in zip(found.t, found.estimates, strict=True) if t > 2.0])
        moves = np.linalg.norm(np.diff(places, axis=0), axis=1)
        assert np.sqrt(np.mean(moves**2)) < 1e-4
        assert moves.max() < 7e-4

    def test_false_fixes_are_rejected_and_good_ones_kept(self) -> None:
        found = run(self.make, scenario("tracker-moving", "false tags on the floor"))
        false = {v: n for (is_false, v), n in found.verdicts.items() if is_false}
        assert sum(false.values()) > 20
        assert false.get("accepted", 0) == 0
        good = {v: n for (is_false, v), n in found.verdicts.items() if not is_false and v != "unused"}
        assert good["accepted"] > 0.95 * sum(good.values())

    @pytest.mark.parametrize("yaw", [0.7, -2.5])
    def test_a_turned_room_gives_turned_results(self, yaw: float) -> None:
        plain, turn = scenario("tracker-moving", None), rot.from_yaw(yaw)

        def turned(given: object) -> object:
            if isinstance(given, ImuSample):
                return given  # the device's yaw is arbitrary anyhow
            assert isinstance(given, OpticalFix)
            heads = [HeadSample(h.t, rot.rotate(turn, h.p), rot.multiply(turn, h.q)) for h in _heads(given)]
            return replace(given, head=heads[0], head_at_arrival=heads[1])

        straight, other = run(self.make, plain), run(self.make, plain, change=turned)
        for a, b in zip(straight.estimates[200:], other.estimates[200:], strict=True):
            assert np.allclose(rot.rotate(turn, a.p), b.p, atol=2e-3)

    def test_a_stance_never_begins_before_the_foot_is_there(self) -> None:
        moving = scenario("sudden-move", None)
        found = run(self.make, moving)
        t = np.array(found.t)
        speed = np.linalg.norm(moving.truth.feet["left"].velocity(t), axis=1)
        contact = np.array([e.contact for e in found.estimates])
        assert contact[(speed < 0.01) & (t > 0.5)].mean() > 0.5
        assert not contact[speed > 0.5].any()


def _heads(fix: OpticalFix) -> tuple[HeadSample, HeadSample]:
    return fix.head, fix.head_at_arrival


def _assert_the_core_guards(settings: Settings, faulty: Scenario) -> None:
    runs, core = run_filter(faulty.messages(), settings)
    assert core.health["user/left"].rejected["not_finite"] > 0
    for run_ in runs.values():
        assert len(run_.t) > 300
        assert np.isfinite(run_.p).all() and np.isfinite(run_.q).all() and np.isfinite(run_.sigma).all()


def _assert_sound(found: Run) -> None:
    for estimate in found.estimates:
        assert np.isfinite([*estimate.p, *estimate.q, *estimate.v, estimate.sigma]).all()
        assert abs(np.linalg.norm(estimate.q) - 1.0) < 1e-6
        assert estimate.sigma > 0.0
