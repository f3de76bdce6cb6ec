"""The mount's calibration in the background of the whole core: from wrong to right in ordinary use, and said."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from foottrack_protocol import Message, encode
from foottrack_protocol.messages import MountCalibration, MountValues
from foottrack_service import rotations as rot
from foottrack_service.config import FusionSettings, Settings
from foottrack_service.evaluation.jobs import ScenarioTruth
from foottrack_service.evaluation.run import collect
from foottrack_service.fusion.core import FusionCore
from foottrack_service.fusion.offline import fuse
from foottrack_service.simulation.faults import ClockJump
from foottrack_service.simulation.scenario import simulate

TURN = rot.from_rotation_vector(np.deg2rad([0.7, -0.4, 0.6]))
SHIFT = np.array([0.006, -0.005, 0.006])
SECONDS = 22.0
ON = Settings(fusion=FusionSettings(max_output_hz=50.0))
OFF = Settings(fusion=FusionSettings(max_output_hz=50.0, mount_calibration=False))


def arrivals(seconds: float = SECONDS, frm: float = 0.0) -> Iterator[tuple[int, Message]]:
    """A head that looks about, through a mount that lacks TURN and SHIFT from ``frm`` s on."""
    for arrival, message in simulate("head-moving", 31, seconds=seconds).messages():
        body = message.data
        if message.stream.startswith(("marker/", "depth/")) and message.t * 1e-9 >= frm:
            moved = {"p": tuple(rot.unrotate(TURN, np.array(body.p) - SHIFT).tolist())}
            for name in ("q", "q_alt"):
                q = getattr(body, name)
                if q is not None:
                    moved[name] = tuple(rot.multiply(rot.conjugate(TURN), np.array(q)).tolist())
            message = message._replace(data=body.model_copy(update=moved))
        yield arrival, message


def late_error_mm(outs: list[Message]) -> float:
    """Mean of both feet, last quarter."""
    scenario = simulate("head-moving", 31, seconds=SECONDS)
    errors = []
    for side, run in collect(outs).items():
        late = run.cut(run.t > 0.75 * SECONDS * 1e9)
        errors.append(np.linalg.norm(late.p - ScenarioTruth(scenario, side).position(late.t), axis=1))
    return float(1e3 * np.concatenate(errors).mean())


@pytest.fixture(scope="module")
def calibrated() -> list[Message]:
    return list(fuse(arrivals(), FusionCore(ON)))


def test_a_wrong_mount_is_found_said_and_applied(calibrated: list[Message]) -> None:
    said = [out for out in calibrated if out.stream == "calibration"]
    assert said
    assert np.diff([out.t for out in said]) == pytest.approx(5e9, rel=0.02)
    values = said[-1].data.values
    assert values.base == ON.camera.mount_hash
    assert np.rad2deg(rot.angle_between(np.array(values.q), TURN)) < 0.3
    without = list(fuse(arrivals(), FusionCore(OFF)))
    assert not [out for out in without if out.stream == "calibration"]
    assert late_error_mm(without) > 20.0
    assert late_error_mm(calibrated) < 6.0


def test_a_replay_finds_the_same_to_the_bit_though_the_recording_holds_what_was_found(
    calibrated: list[Message],
) -> None:
    recorded = [(out.t_pub, out) for out in calibrated if out.stream == "calibration"]
    both = sorted([*arrivals(), *recorded], key=lambda each: each[0])
    again = fuse(both, FusionCore(ON))
    assert [encode(out) for out in again] == [encode(out) for out in calibrated]


def test_its_own_result_that_somebody_kept_and_repeats_changes_nothing(calibrated: list[Message]) -> None:
    kept = [(out.t_pub + 10**8, out._replace(src="calibration")) for out in calibrated if out.stream == "calibration"]
    again = fuse(sorted([*arrivals(), *kept], key=lambda each: each[0]), FusionCore(ON))
    assert [encode(out) for out in again] == [encode(out) for out in calibrated]


def test_a_correction_of_another_mount_takes_nothing_away(calibrated: list[Message]) -> None:
    values = MountValues(p=(0.1, 0.0, 0.0), q=(0.0, 0.0, 0.0, 1.0), sigma_p=1e-3, sigma_q=1e-3, base="another")
    at = round(0.7 * SECONDS * 1e9)
    said = Message("user", "calibration", "calibration", "s", 0, at, at, True, MountCalibration(values=values))
    again = fuse(sorted([*arrivals(), (at, said)], key=lambda each: each[0]), FusionCore(ON))
    assert [encode(out) for out in again] == [encode(out) for out in calibrated]


def test_what_was_kept_counts_from_the_first_picture_and_is_not_given_up_for_less(calibrated: list[Message]) -> None:
    kept = [out for out in calibrated if out.stream == "calibration"][-1]
    seconds = 9.0
    outs = list(fuse([(0, kept._replace(src="calibration", t=0, t_pub=0)), *arrivals(seconds)], FusionCore(ON)))
    said = [out.data.values for out in outs if out.stream == "calibration"]
    assert said
    for values in said:
        assert values.sigma_q <= np.hypot(kept.data.values.sigma_q, np.deg2rad(0.1))
        assert np.rad2deg(rot.angle_between(np.array(values.q), TURN)) < 0.3
    scenario = simulate("head-moving", 31, seconds=seconds)
    for side, run in collect(outs).items():
        late = run.cut(run.t > 2e9)
        assert np.linalg.norm(late.p - ScenarioTruth(scenario, side).position(late.t), axis=1).mean() < 0.008


def test_without_the_watch_a_recording_s_own_result_is_applied(calibrated: list[Message]) -> None:
    found = next(out for out in calibrated if out.stream == "calibration")
    with_it = list(fuse([(0, found._replace(t=0, t_pub=0)), *arrivals()], FusionCore(OFF)))
    assert late_error_mm(with_it) < 8.0


def test_what_a_person_calibrated_is_taken() -> None:
    x, y, z, w = TURN.tolist()
    a, b, c = SHIFT.tolist()
    values = MountValues(p=(a, b, c), q=(x, y, z, w), sigma_p=1e-3, sigma_q=1e-3, base=ON.camera.mount_hash)
    said = Message("user", "calibration", "calibration", "s", 0, 0, 0, True, MountCalibration(values=values))
    outs = list(fuse([(0, said), *arrivals(8.0)], FusionCore(ON)))
    errors = [
        np.linalg.norm(
            run.p[run.t > 4e9]
            - ScenarioTruth(simulate("head-moving", 31, seconds=8.0), side).position(run.t[run.t > 4e9]),
            axis=1,
        ).mean()
        for side, run in collect(outs).items()
    ]
    assert max(errors) < 0.008


def test_a_slip_is_said_once(caplog: pytest.LogCaptureFixture) -> None:
    core = FusionCore(ON)
    list(fuse(arrivals(34.0, frm=16.0), core))
    assert core.mount_health is not None and core.mount_health.rejected == {"slipped": 1}
    assert len([record for record in caplog.records if "moved on the headset" in record.getMessage()]) == 1


def test_a_clock_that_jumps_in_a_walk_is_no_other_mount() -> None:
    """Fixes by a head that is 6 cm further on fit a foot that stands 6 cm further on."""
    jumps = [ClockJump(source="headset", start=at, end=at + 1.0, offset=-0.05) for at in (4.0, 9.0, 14.0)]
    run = simulate("walk", 1001, seconds=20.0, faults=jumps)
    found = [out for out in fuse(run.messages(), FusionCore(ON)) if out.stream == "calibration"]
    assert all(np.linalg.norm(out.data.values.p) < 0.005 for out in found)
