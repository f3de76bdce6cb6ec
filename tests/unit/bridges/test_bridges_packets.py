"""What each application is told, read by a third-party parser."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bridge_poses import IDENTITY, Told, foot, read, standing, turned
from hypothesis import given, settings
from hypothesis import strategies as st

from foottrack_protocol.messages import Pose
from foottrack_service import unity_axes
from foottrack_service.bridges.settings import VmcSettings, VmtSettings, VrchatSettings
from foottrack_service.bridges.vmc import Vmc
from foottrack_service.bridges.vmt import Vmt
from foottrack_service.bridges.vrchat import Vrchat
from foottrack_service.rotations import angle_between, multiply, rotate

HALF = math.sqrt(0.5)
CHAIN = ("UpperLeg", "LowerLeg", "Foot", "Toes")


def bones(vmc: list[bytes]) -> dict[str, tuple[list[float], list[float]]]:
    """Local position and rotation of each bone and of the root."""
    (datagram,) = vmc
    return {
        told.values[0]: (told.values[1:4], told.values[4:8]) for told in read(datagram) if told.address.endswith("/Pos")
    }


def test_vmc_of_a_person_at_ease_is_the_rest_pose() -> None:
    (datagram,) = Vmc(VmcSettings()).datagrams(standing(), 7)
    told = read(datagram)
    assert told[:2] == [Told("/VMC/Ext/OK", "i", [1]), Told("/VMC/Ext/T", "f", [0.0])]
    assert told[2].address == "/VMC/Ext/Root/Pos"
    assert [one.values[0] for one in told[2:]] == [
        "root",
        "Hips",
        *[f"{side}{bone}" for side in ("Left", "Right") for bone in CHAIN],
    ]
    assert {one.tags for one in told[2:]} == {"sfffffff"}
    assert {one.address for one in told[3:]} == {"/VMC/Ext/Bone/Pos"}
    assert len(datagram) < 1472, "one datagram that no router takes apart"
    found = bones([datagram])
    for name, (p, q) in found.items():
        assert q == pytest.approx(IDENTITY, abs=1e-6), name
        expected = {
            "root": (0, 0, 0),
            "Hips": (0, 0.95, 0),
            "LeftUpperLeg": (-0.1, -0.05, 0),
            "RightUpperLeg": (0.1, -0.05, 0),
            "LeftLowerLeg": (0, -0.4, 0),
            "LeftFoot": (0, -0.4, 0),
            "LeftToes": (0, -0.052, 0.13),
        }.get(name, p)
        assert p == pytest.approx(expected, abs=1e-6), name


def test_vmc_of_a_person_who_sits() -> None:
    leg = {"knee": (-0.1, 0.9, -0.4), "ankle": Pose(p=(-0.1, 0.5, -0.4), q=IDENTITY), "toe": (-0.1, 0.42, -0.6)}
    found = bones(Vmc(VmcSettings()).datagrams(standing(left=foot(-1.0, **leg)), 0))
    assert found["LeftUpperLeg"][1] == pytest.approx((-HALF, 0.0, 0.0, HALF), abs=1e-6)
    assert found["LeftLowerLeg"][1] == pytest.approx((HALF, 0.0, 0.0, HALF), abs=1e-6)
    assert found["LeftFoot"][1] == pytest.approx(IDENTITY, abs=1e-6)


@settings(max_examples=50)
@given(
    st.floats(-3.1, 3.1),
    st.tuples(st.floats(-0.2, 0.2), st.floats(0.3, 0.6), st.floats(-0.3, 0.0)),
    st.tuples(st.floats(-0.2, 0.2), st.floats(0.05, 0.25), st.floats(-0.2, 0.3)),
)
def test_vmc_bones_put_together_are_the_body(
    yaw: float, knee: tuple[float, float, float], ankle: tuple[float, float, float]
) -> None:
    limb = {"knee": knee, "ankle": Pose(p=ankle, q=IDENTITY), "toe": (ankle[0], ankle[1] - 0.08, ankle[2] - 0.2)}
    pose = turned(standing(right=foot(1.0, **limb)), [0.0, 1.0, 0.0], yaw)
    found = bones(Vmc(VmcSettings()).datagrams(pose, 0))
    assert pose.right is not None
    p, q = np.zeros(3), np.array(IDENTITY)
    joints = {}
    for name in ("root", "Hips", *(f"Right{bone}" for bone in CHAIN)):
        p, q = p + rotate(q, found[name][0]), multiply(q, found[name][1])
        joints[name] = (p, q)
    for name, point in (
        ("RightUpperLeg", pose.right.hip),
        ("RightLowerLeg", pose.right.knee),
        ("RightFoot", pose.right.ankle.p),
    ):
        assert point is not None
        assert np.allclose(joints[name][0], unity_axes.position(point), atol=1e-5), name
    assert angle_between(joints["RightFoot"][1], unity_axes.rotation(pose.right.ankle.q)) < 1e-3


def test_vmc_without_headset_says_that_nothing_comes() -> None:
    (datagram,) = Vmc(VmcSettings()).datagrams(standing(head=None, hips=None), 0)
    assert [(told.address, told.values) for told in read(datagram)] == [("/VMC/Ext/OK", [0]), ("/VMC/Ext/T", [0.0])]


def test_vmc_leaves_a_lost_leg_out() -> None:
    found = bones(Vmc(VmcSettings()).datagrams(standing(left=foot(-1.0, stage="lost")), 0))
    assert set(found) == {"root", "Hips", *(f"Right{bone}" for bone in CHAIN)}


def test_vmc_can_leave_the_body_to_another_performer() -> None:
    vmc = Vmc(VmcSettings(legs_only=True))
    (datagram,) = vmc.datagrams(standing(), 0)
    assert {told.address for told in read(datagram)} == {"/VMC/Ext/T", "/VMC/Ext/Bone/Pos"}
    assert set(bones([datagram])) == {f"{side}{bone}" for side in ("Left", "Right") for bone in CHAIN}
    assert vmc.farewell() == []


def test_vmc_says_how_long_it_runs_and_farewell() -> None:
    vmc = Vmc(VmcSettings())
    vmc.datagrams(standing(), 10**15)
    (datagram,) = vmc.datagrams(standing(), 10**15 + 2_500_000_000)
    assert read(datagram)[1].values == [2.5]
    assert read(vmc.farewell()[0]) == [Told("/VMC/Ext/OK", "i", [0])]


def test_a_vrchat_packet_byte_by_byte() -> None:
    settings_ = VrchatSettings(head=False)
    packets = Vrchat(settings_).datagrams(standing(hips=None, left=None), 0)
    assert packets[0] == (
        b"/tracking/trackers/3/position\x00\x00\x00,fff\x00\x00\x00\x00\x3d\xcc\xcc\xcd\x3d\xcc\xcc\xcd\x80\x00\x00\x00"
    )
    assert len(packets) == 2


@pytest.mark.parametrize(("knees", "places"), [(False, "123"), (True, "12345")])
def test_vrchat_gets_trackers_and_the_head(knees: bool, places: str) -> None:
    pose = turned(standing(), [0.0, 1.0, 0.0], math.radians(30.0))
    told = {
        one.address: one
        for datagram in Vrchat(VrchatSettings(knees=knees)).datagrams(pose, 0)
        for one in read(datagram)
    }
    assert {one.tags for one in told.values()} == {"fff"}
    assert set(told) == {
        f"/tracking/trackers/{place}/{what}" for place in [*places, "head"] for what in ("position", "rotation")
    }
    assert told["/tracking/trackers/1/position"].values == pytest.approx([0.0, 0.95, 0.0], abs=1e-6)
    for place in [*places, "head"]:
        assert told[f"/tracking/trackers/{place}/rotation"].values == pytest.approx([0.0, -30.0, 0.0], abs=1e-4)
    assert pose.left is not None
    assert told["/tracking/trackers/2/position"].values == pytest.approx(
        unity_axes.position(pose.left.ankle.p), abs=1e-6
    )


def test_vrchats_head_is_where_the_head_bone_begins() -> None:
    told = [
        one
        for datagram in Vrchat(VrchatSettings(head_joint=(0.0, -0.1, 0.085))).datagrams(standing(), 0)
        for one in read(datagram)
    ]
    head = next(one for one in told if one.address == "/tracking/trackers/head/position")
    assert head.values == pytest.approx([0.0, 1.6, 0.1 - 0.085], abs=1e-6)


def test_vmt_gets_trackers_of_its_room() -> None:
    (datagram,) = Vmt(VmtSettings(first_index=10)).datagrams(standing(), 0)
    told = read(datagram)
    assert {(one.address, one.tags) for one in told} == {("/VMT/Room/Unity", "iiffffffff")}
    assert [one.values[:3] for one in told] == [[10 + n, 1, 0.0] for n in range(5)]
    assert told[1].values[3:] == pytest.approx([-0.1, 0.1, 0.0, *IDENTITY], abs=1e-6)
    assert told[4].values[3:6] == pytest.approx([0.1, 0.5, 0.0], abs=1e-6)


def test_vmt_switches_a_lost_tracker_off_and_on_again() -> None:
    vmt = Vmt(VmtSettings(knees=False))

    def enabled(left: str) -> list[int]:
        (datagram,) = vmt.datagrams(standing(left=foot(-1.0, stage=left)), 0)
        return [one.values[1] for one in read(datagram)]

    assert enabled("lost") == [1, 1], "a tracker that never was is not mentioned"
    assert enabled("marker") == [1, 1, 1]
    assert enabled("lost") == [1, 0, 1]
    assert enabled("lost") == [1, 0, 1]
    assert enabled("depth") == [1, 1, 1]
    assert [one.values[1] for one in read(vmt.farewell()[0])] == [0, 0, 0]


def test_vmt_that_showed_nothing_says_nothing() -> None:
    vmt = Vmt(VmtSettings())
    assert vmt.datagrams(standing(head=None, hips=None, left=None, right=None), 0) == []
    assert vmt.farewell() == []
