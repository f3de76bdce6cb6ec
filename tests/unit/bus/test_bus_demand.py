"""Who asks for raw streams, from the frames that come up from subscribers."""

from __future__ import annotations

import pytest

from foottrack_protocol.topics import RAW_PREFIX, TOPICS, Role
from foottrack_service.bus.demand import MAX_PREFIXES, Demand

LEFT, CAMERA = "user/raw/imu/left", "user/raw/camera"


def demand(*frames: bytes) -> Demand:
    made = Demand()
    for frame in frames:
        made.notice(frame)
    return made


@pytest.mark.parametrize("prefix", [b"", b"u", b"user", b"user/", b"user/r", b"user/raw", b"user/imu/left", b"sys/"])
def test_a_subscription_that_does_not_name_them_asks_for_nothing(prefix: bytes) -> None:
    assert not demand(b"\x01" + prefix).wants(LEFT)


@pytest.mark.parametrize(("prefix", "left", "camera"), [
    (b"user/raw/", True, True),
    (b"user/raw/i", True, False),
    (b"user/raw/imu/left", True, False),
    (b"user/raw/camera", False, True),
    (b"other/raw/", False, False),
    (b"user/raw/imu/left/", False, False),
])  # fmt: skip
def test_a_prefix_asks_for_what_it_matches(prefix: bytes, left: bool, camera: bool) -> None:
    asked = demand(b"\x01" + prefix)
    assert (asked.wants(LEFT), asked.wants(CAMERA)) == (left, camera)
    asked.notice(b"\x00" + prefix)
    assert not asked.wants(LEFT)
    assert not asked.wants(CAMERA)


def test_one_subscription_does_not_end_another() -> None:
    asked = demand(b"\x01user/raw/", b"\x01user/raw/camera", b"\x00user/raw/")
    assert asked.wants(CAMERA)
    assert not asked.wants(LEFT)


def test_whatever_else_comes_up_changes_nothing_and_takes_no_memory() -> None:
    asked = demand(b"", b"\x00", b"\x02user/raw/", b"user/raw/", b"\x01" + b"u" * 200 + b"/raw/", b"\x01\xff/raw/x")
    assert not asked.wants(LEFT)
    for number in range(MAX_PREFIXES + 10):
        asked.notice(b"\x01%d/raw/" % number)
    assert asked.wants(f"{MAX_PREFIXES - 1}/raw/camera")
    assert not asked.wants(f"{MAX_PREFIXES}/raw/camera")


def test_the_registry_has_all_raw_streams_and_no_others_behind_the_prefix() -> None:
    raw = {name for name, topic in TOPICS.items() if topic.role is Role.RAW}
    assert raw == {name for name in TOPICS if name.startswith(RAW_PREFIX)} == {
        "raw/imu/left", "raw/imu/right", "raw/camera",
    }  # fmt: skip
    assert not any(TOPICS[name].recorded for name in raw)
