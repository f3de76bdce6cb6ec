"""What `doctor` says of devices, clocks and stamps."""

from __future__ import annotations

import asyncio
import json
import socket
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_protocol.messages import HeadPose, Imu
from foottrack_service.app import Service
from foottrack_service.bus import Bus
from foottrack_service.cli import doctor_devices
from foottrack_service.cli.doctor import _streams
from foottrack_service.cli.doctor_clocks import clock, judged, stamps
from foottrack_service.cli.main import app
from foottrack_service.config import BusSettings, Settings
from foottrack_service.imu.devices.plugged import PluggedImu

Run = Callable[[Any], Any]
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def test_the_clock_and_the_age_of_stamps(run: Run) -> None:
    async def scenario() -> None:
        settings = Settings(bus=BusSettings.beginning_at("0").model_dump(exclude={"curve"}))
        async with Service(settings) as service, asyncio.TaskGroup() as tasks:
            with Bus.connect(service.endpoints) as bus:
                found = await clock(bus.control())
                assert found.level == "ok" and "the same one" in found.text
                publisher = bus.publisher("test")
                await publisher.ready()

                async def publish() -> None:
                    while True:
                        now = bus.clock()
                        head = HeadPose(p=(0.0, 1.6, 0.0), q=UPRIGHT, tracked=True)
                        publisher.publish("user", "head/pose", now + 5 * 10**9, head)
                        imu = Imu(acc=(0.0, STANDARD_GRAVITY, 0.0), q=UPRIGHT, t_arr=now)
                        publisher.publish("user", "imu/left", now - 3_000_000, imu)
                        await asyncio.sleep(0.01)

                publishing = tasks.create_task(publish())
                head_found, imu_found = await stamps(bus, "user", 0.3)
                publishing.cancel()
        assert head_found.subject == "stamps of user/head/pose"
        assert head_found.level == "warning" and "future" in head_found.advice
        assert imu_found.level == "ok"

    run(scenario())


def test_old_stamps_are_a_warning() -> None:
    assert judged("user/marker/left", [0.030, 0.040, 0.050]).text.startswith("40.0 ms")
    assert judged("user/marker/left", [0.3] * 10).level == "warning"


@pytest.mark.parametrize(
    ("headset", "level", "says"),
    [
        ({"source": "bus"}, "note", "engine"),
        ({"source": "vmc", "vmc": {"port": 0}}, "ok", "VMC on UDP 127.0.0.1"),
        ({"source": "openxr"}, None, "openxr"),
        ({"openvr": {"truth_left": "LHR-A"}}, None, "openvr"),
    ],
)
def test_the_headset_s_source_is_named(headset: dict[str, Any], level: str | None, says: str) -> None:
    findings = doctor_devices.headset(Settings(headset=headset))
    assert any(says in finding.text and level in (None, finding.level) for finding in findings)


def test_a_port_in_use_is_said() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        (finding,) = doctor_devices.headset(
            Settings(headset={"source": "vmc", "vmc": {"port": other.getsockname()[1]}})
        )
    assert "in use" in finding.text and "[headset.vmc]" in finding.advice


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no ptys")
@pytest.mark.parametrize(("configured", "level"), [("rvc", "ok"), ("ascii", "error")])
def test_what_talks_on_a_configured_port_is_heard(configured: str, level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from foottrack_service.imu import ports, probe

    imu = PluggedImu("rvc")
    monkeypatch.setattr(ports, "available", list)
    listen = probe._listen

    async def listen_while_it_sends(port: str, baud: int, listen_s: float) -> bytes:
        async def send() -> None:
            number = 0
            while True:
                number += 1
                imu.send(Imu(acc=(0.0, STANDARD_GRAVITY, 0.0), q=UPRIGHT, t_dev=10_000 * number, t_arr=0))
                await asyncio.sleep(0.01)

        sending = asyncio.ensure_future(send())
        try:
            return await listen(port, baud, listen_s)
        finally:
            sending.cancel()

    monkeypatch.setattr(probe, "_listen", listen_while_it_sends)
    try:
        findings = doctor_devices.imus(Settings(imu={"left": {"format": configured, "port": imu.port}}), listen=True)
    finally:
        imu.close()
    heard = next(finding for finding in findings if finding.subject == imu.port)
    assert heard.level == level
    assert heard.text.startswith("rvc at 115200")


def test_two_outputs_into_one_application_are_warned_of(tmp_path: Path) -> None:
    settings = tmp_path / "foottrack.toml"
    settings.write_text("[bridges.vrchat]\nenabled = true\n[bridges.vmt]\nenabled = true\n", encoding="utf-8")
    done = CliRunner().invoke(app, ["doctor", "--config", str(settings), "--connect", "7991", "--json"])
    found = [each for each in json.loads(done.stdout)["findings"] if each["subject"].startswith("bridge")]
    assert [(each["subject"], each["level"]) for each in found] == [
        ("bridge vrchat", "ok"),
        ("bridge vmt", "ok"),
        ("bridges", "warning"),
    ]
    assert "every foot twice" in found[-1]["text"]


@pytest.mark.parametrize(("reason", "warned"), [("gate", True), ("ahead", False), ("imu_stale", False)])
def test_tags_are_blamed_for_fixes_that_were_refused_and_for_nothing_else(run: Run, reason: str, warned: bool) -> None:
    async def scenario() -> None:
        settings = Settings(bus=BusSettings.beginning_at("0").model_dump(exclude={"curve"}))
        async with Service(settings) as service:
            service.bus.health.filter("anna/left", {"imu": 9000, "marker": 100}, {reason: 500})
            with Bus.connect(service.endpoints) as bus:
                said = [each for each in await _streams(bus.control(), "user") if each.subject == "fixes anna/left"]
        assert [each.text for each in said] == ["500 of 600 refused"] * warned

    run(scenario())


@pytest.mark.parametrize(("found", "level"), [(0, "warning"), (3, "note")])
def test_a_mount_that_slipped_is_said(run: Run, found: int, level: str) -> None:
    async def scenario() -> None:
        settings = Settings(bus=BusSettings.beginning_at("0").model_dump(exclude={"curve"}))
        async with Service(settings) as service:
            service.bus.health.filter("anna/mount", {"found": found}, {"slipped": 1})
            with Bus.connect(service.endpoints) as bus:
                said = [each for each in await _streams(bus.control(), "user") if each.subject == "camera mount"]
        assert [each.level for each in said] == [level]
        assert "moved on the headset" in said[0].text

    run(scenario())
