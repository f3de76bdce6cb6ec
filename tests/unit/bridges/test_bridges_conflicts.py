"""Two outputs for one application are told."""

from __future__ import annotations

from typing import Any

import pytest

from foottrack_service.bridges.conflicts import conflicts
from foottrack_service.cli.doctor import _bridges
from foottrack_service.config import Settings

ON = {"enabled": True}


def test_all_is_off_by_default_and_stays_on_this_host() -> None:
    bridges = Settings().bridges
    assert bridges.idle
    assert {bridges.vmc.host, bridges.vrchat.host, bridges.vmt.host} == {"127.0.0.1"}
    assert [bridges.vmc.port, bridges.vrchat.port, bridges.vmt.port] == [39539, 9000, 39570]


@pytest.mark.parametrize(
    ("bridges", "told"),
    [
        ({"vrchat": ON, "vmt": ON}, "every foot twice"),
        ({"vmc": {**ON, "port": 9000}, "vrchat": ON}, "two streams"),
        ({"vmc": {**ON, "host": "localhost", "port": 9000}, "vrchat": ON}, "two streams"),
    ],
)
def test_what_feeds_one_application_twice_is_told(bridges: dict[str, Any], told: str) -> None:
    settings = Settings(bridges=bridges)
    (text,) = conflicts(settings)
    assert told in text
    assert [finding.text for finding in _bridges(settings) if finding.level == "warning"] == [text]


def test_a_stream_into_ones_own_headset_is_told() -> None:
    settings = Settings(bridges={"vmc": ON}, headset={"source": "vmc"})
    assert "this service itself" in conflicts(settings)[0]
    assert not conflicts(Settings(bridges={"vmc": {**ON, "host": "10.0.0.5"}}, headset={"source": "vmc"}))


def test_different_applications_are_no_conflict() -> None:
    settings = Settings(bridges={"vmc": ON, "vrchat": ON})
    assert conflicts(settings) == []
    assert [finding.level for finding in _bridges(settings)] == ["ok", "ok"]
