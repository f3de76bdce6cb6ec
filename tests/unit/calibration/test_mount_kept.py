"""Of what the background finds of the mount, the newest is kept once a minute."""

from __future__ import annotations

from foottrack_protocol import Message
from foottrack_protocol.messages import FloorCalibration, FloorValues, MountCalibration, MountValues
from foottrack_service.calibration.mount_kept import KeptMount

S = 10**9


def found(x: float, src: str = "fusion", base: str = "ours") -> Message:
    values = MountValues(p=(x, 0.0, 0.0), q=(0.0, 0.0, 0.0, 1.0), sigma_p=0.001, sigma_q=0.001, base=base)
    return Message("user", "calibration", src, "s", 0, 0, 0, True, MountCalibration(values=values))


def test_the_first_is_kept_at_once_and_then_the_newest_of_each_minute() -> None:
    kept = KeptMount("ours")
    assert kept.due(0) is None
    kept.take(found(0.01))
    assert kept.due(0) == found(0.01).data
    assert kept.due(70 * S) is None
    for x in (0.02, 0.03):
        kept.take(found(x))
    assert kept.due(59 * S) is None
    assert kept.newest == found(0.03).data
    assert kept.due(60 * S) == found(0.03).data


def test_what_is_not_fusion_s_or_of_another_mount_is_left_out() -> None:
    kept = KeptMount("ours")
    floor = FloorCalibration(values=FloorValues(height=0.1))
    for message in (found(0.01, src="calibration"), found(0.01, base="another"), found(0.01)._replace(data=floor)):
        kept.take(message)
    assert kept.newest is None
