"""One heading: the avatar goes where the pelvis faces, and a look aside is no turn."""

import math

import pytest

from foottrack_service import rotations as rot
from foottrack_service.body.facing import MOST_TURN, head_yaw
from foottrack_service.config import Settings
from foottrack_service.fusion.core import FusionCore
from foottrack_service.fusion.offline import fuse
from foottrack_service.simulation.marching import marching
from foottrack_service.simulation.scenario import simulate

ASIDE = math.radians(60.0)


def walked(turn=0.0, looks=ASIDE, with_head=True):
    """Results of somebody who walks in place, by IMUs alone, and looks aside from second 3 on."""
    scenario = simulate(
        "in place", 31, settings=Settings(), seconds=9.0, imu_hz=100.0, camera=False, motion=marching(1.6, 0.15, turn)
    )

    def seen():
        for at, message in scenario.messages():
            if message.stream.startswith("truth/") or (message.stream == "head/pose" and not with_head):
                continue
            if message.stream == "head/pose" and message.t > 3e9:
                x, y, z, w = rot.multiply(rot.from_yaw(looks), message.data.q).tolist()
                message = message._replace(data=message.data.model_copy(update={"q": (x, y, z, w)}))
            yield at, message

    return scenario, list(fuse(seen(), FusionCore(Settings())))


def yaws(results):
    return [(r.t * 1e-9, math.atan2(-r.data.heading[0], -r.data.heading[2])) for r in results if r.stream == "pose/ik"]


def test_a_look_60_degrees_aside_keeps_the_heading_of_who_walks_in_place():
    _, results = walked()
    found = yaws(results)
    assert any(r.stream == "pose/ik" and r.data.speed > 0.5 for r in results)
    before = [yaw for t, yaw in found if 2.0 < t < 3.0]
    after = [yaw for t, yaw in found if t > 5.0]
    straight = sum(before) / len(before)
    assert abs(straight) < math.radians(5.0)
    assert max(abs(yaw - straight) for yaw in after) < 2.0 * MOST_TURN
    hips = [None if r.data.hips is None else head_yaw(r.data.hips.q) for r in results if r.stream == "pose/body"]
    both = [(yaw, hip) for (_, yaw), hip in zip(found, hips, strict=True) if hip is not None]
    assert len(both) > 500
    assert [yaw for yaw, _ in both] == pytest.approx([hip for _, hip in both], abs=1e-6)


def test_a_turn_of_the_feet_turns_it_whether_or_not_there_is_a_head():
    for with_head in (True, False):
        scenario, results = walked(turn=0.2, looks=0.0, with_head=with_head)
        t, yaw = yaws(results)[-1]
        true = head_yaw(scenario.truth.hips.pose([t])[1][0].tolist())
        assert abs(true) > 0.8
        assert math.remainder(yaw - true, 2.0 * math.pi) == pytest.approx(0.0, abs=math.radians(12.0))
