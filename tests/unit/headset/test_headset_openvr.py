"""OpenVR: poses, losses, recentring and truth, against a double; the double against the package where it is there."""

from __future__ import annotations

import math
from itertools import count

import numpy as np
import pytest
from openvr_double import OUT_OF_RANGE, RUNNING_OK, Runtime

from foottrack_service import rotations
from foottrack_service.headset.rigid import Rigid, rigid
from foottrack_service.headset.settings import OpenVrSettings, RigidSettings
from foottrack_service.headset.sources.openvr import OpenVrSource, place_of
from foottrack_service.headset.sources.polled import HeadsetError
from foottrack_service.headset.stream import HeadStream

HEAD = rigid((0.2, 1.6, -0.3), rotations.from_rotation_vector([0.1, 0.8, -0.2]))
FOOT = rigid((-0.1, 0.2, 0.1), rotations.from_yaw(0.4))
STEP_NS = 11_000_000


def opened(runtime: Runtime, settings: OpenVrSettings | None = None) -> OpenVrSource:
    ticks = count(0, STEP_NS)
    return OpenVrSource(settings or OpenVrSettings(), lambda: next(ticks), runtime)


def test_the_head_is_where_the_matrix_says_at_the_middle_of_the_call() -> None:
    source = opened(Runtime(("hmd", HEAD, RUNNING_OK)))
    polled = source.poll()
    assert polled.t == STEP_NS // 2
    assert polled.head is not None and not polled.recentred
    np.testing.assert_allclose(polled.head.p, HEAD.p)
    assert rotations.angle_between(polled.head.q, HEAD.q) < 1e-7


def test_out_of_range_is_not_tracked() -> None:
    assert opened(Runtime(("hmd", HEAD, OUT_OF_RANGE))).poll().head is None
    assert opened(Runtime()).poll().head is None


def test_a_recentred_stage_moves_everything_by_what_is_told() -> None:
    runtime = Runtime(("hmd", HEAD, RUNNING_OK))
    runtime.standing = rigid((0.5, 0.1, 0.0), rotations.from_yaw(1.0))
    source, stream = opened(runtime), HeadStream()
    before = source.poll()
    assert before.head is not None
    stream.pose(before.t, before.head)
    runtime.standing = rigid((-1.0, 0.0, 2.0), rotations.from_yaw(-0.7))
    after = source.poll()
    assert after.head is not None
    (change,) = after.recentred
    assert change.moved is not None
    carried = change.moved.then(before.head)
    np.testing.assert_allclose(carried.p, after.head.p, atol=1e-9)
    assert rotations.angle_between(carried.q, after.head.q) < 1e-6
    stream.recentred(change.moved)
    message = stream.pose(after.t, after.head)
    assert message is not None and message.body.tracked and message.body.origin == 1
    assert not source.poll().recentred


def test_trackers_on_the_feet_are_truth() -> None:
    runtime = Runtime(("hmd", HEAD, RUNNING_OK), ("LHR-A", FOOT, RUNNING_OK), ("LHR-B", FOOT, OUT_OF_RANGE))
    settings = OpenVrSettings(truth_left="LHR-A", truth_right="LHR-B", ankle_left=RigidSettings(p=(0.0, -0.1, 0.02)))
    polled = opened(runtime, settings).poll()
    assert set(polled.truth) == {"left"}
    expected = FOOT.p + rotations.rotate(FOOT.q, [0.0, -0.1, 0.02])
    np.testing.assert_allclose(polled.truth["left"].p, expected)


def test_a_tracker_that_is_switched_on_later_is_found() -> None:
    runtime = Runtime(("hmd", HEAD, RUNNING_OK))
    source = opened(runtime, OpenVrSettings(truth_right="LHR-C"))
    assert not source.poll().truth
    runtime.devices.append(("LHR-C", FOOT, RUNNING_OK))
    assert any(source.poll().truth for _ in range(200))


@pytest.mark.parametrize("broken", [(math.nan, 1.6, 0.0), (0.0, 1.6, math.inf)])
def test_a_driver_that_says_nonsense_is_not_tracked_and_stops_nothing(broken: tuple[float, float, float]) -> None:
    nonsense = Rigid(np.array(broken), HEAD.q)
    runtime = Runtime(("hmd", nonsense, RUNNING_OK), ("LHR-A", Rigid(HEAD.p, np.full(4, math.nan)), RUNNING_OK))
    source = opened(runtime, OpenVrSettings(truth_left="LHR-A"))
    polled = source.poll()
    assert polled.head is None and not polled.truth
    runtime.devices[0] = ("hmd", HEAD, RUNNING_OK)
    assert source.poll().head is not None


def test_a_device_that_goes_while_it_is_asked_for_its_name_stops_nothing() -> None:
    runtime = Runtime(("hmd", HEAD, RUNNING_OK), ("LHR-A", FOOT, RUNNING_OK))
    runtime.nameless = 0
    polled = opened(runtime, OpenVrSettings(truth_left="LHR-A")).poll()
    assert polled.head is not None and set(polled.truth) == {"left"}


def test_a_tracker_that_is_not_there_is_said_once(caplog: pytest.LogCaptureFixture) -> None:
    source = opened(Runtime(), OpenVrSettings(truth_left="LHR-A"))
    for _ in range(400):
        source.poll()
    assert [record.getMessage() for record in caplog.records] == ["no device LHR-A; there are: none"]


def test_without_steamvr_it_says_what_to_do() -> None:
    runtime = Runtime()
    runtime.running = False
    with pytest.raises(HeadsetError, match="is it running"):
        opened(runtime)


def test_it_ends_with_steamvr() -> None:
    runtime = Runtime(("hmd", HEAD, RUNNING_OK))
    source = opened(runtime)
    runtime.events = [100, runtime.VREvent_Quit]
    with pytest.raises(HeadsetError, match="quits"):
        source.poll()
    source.close()
    assert runtime.told == ["exiting", "shutdown"]


def test_the_package_has_what_the_double_pretends() -> None:
    openvr = pytest.importorskip("openvr", reason="the extra 'openvr' is not installed")
    for name in (name for name in vars(Runtime) if not name.startswith("_")):
        assert hasattr(openvr, name) or hasattr(openvr.IVRSystem, name), name
    for name in ("VRApplication_Background", "VREvent_Quit", "TrackingResult_Running_OK", "Prop_SerialNumber_String"):
        assert int(getattr(openvr, name)) == getattr(Runtime, name)
    real = openvr.HmdMatrix34_t()
    for row, values in enumerate(np.column_stack([rotations.to_matrix(HEAD.q), HEAD.p])):
        real.m[row][:] = values.tolist()
    place = place_of(real)
    np.testing.assert_allclose(place.p, HEAD.p, atol=1e-6)
    assert rotations.angle_between(place.q, HEAD.q) < 1e-6
    with pytest.raises(HeadsetError, match="SteamVR does not answer"):
        OpenVrSource(OpenVrSettings(), lambda: 0)
