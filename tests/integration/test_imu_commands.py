"""``foottrack imu``: Allan deviation of a recording, a chip's own calibration, the list of ports."""

from __future__ import annotations

import asyncio
import json
import math
import struct
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from foottrack_protocol.envelope import Message, encode
from foottrack_protocol.messages import Imu
from foottrack_service.cli import imu
from foottrack_service.cli.running import CommandFailed
from foottrack_service.imu.chip import NoAnswer, command_chip
from foottrack_service.imu.devices.bno08x import Bno08xDevice
from foottrack_service.imu.devices.pty_port import PtyPort
from foottrack_service.imu.formats.sh2 import Command
from foottrack_service.imu.sample import DeviceSample
from foottrack_service.recording.file import RecordingFile

PERIOD_S = 0.01
GYRO_WALK, ACC_WALK = 1e-4, 2e-3
START = 10**12


def recorded(path: Path, seconds: float, gyro: bool = True, moved_at: float | None = None, lost: float = 0.0) -> Path:
    rng = np.random.default_rng(8)
    with RecordingFile(path, None) as out:
        for k in range(round(seconds / PERIOD_S)):
            if rng.random() < lost:
                continue
            t = START + k * 10_000_000
            acc = np.array([0.0, 9.8, 0.0]) + rng.normal(scale=ACC_WALK / math.sqrt(PERIOD_S), size=3)
            if moved_at is not None and k * PERIOD_S > moved_at:
                acc[0] += 2.0
            rate = rng.normal(scale=GYRO_WALK / math.sqrt(PERIOD_S), size=3)
            body = Imu(
                acc=tuple(map(float, acc)),  # type: ignore[arg-type]
                gyro=tuple(map(float, rate)) if gyro else None,  # type: ignore[arg-type]
                q=(0.0, 0.0, 0.0, 1.0),
                t_arr=t,
            )
            topic, payload = encode(Message("user", "imu/left", "test", "s", k, t, t, True, body))
            out.add(topic, payload, t, t, k)
    return path


def call(*arguments: str) -> Any:
    return CliRunner().invoke(imu.app, list(arguments))


def test_allan_finds_the_noise_of_a_recording_and_draws_it(tmp_path: Path) -> None:
    file = recorded(tmp_path / "still.mcap", 200.0, lost=0.002)
    result = call("allan", str(file), "--chip", "bmi270", "--json")
    assert result.exit_code == 0, result.output
    values = json.loads(result.stdout)
    left = values["imus"]["user/imu/left"]
    for axis in "xyz":
        assert left["gyro"][axis]["random_walk"] == pytest.approx(GYRO_WALK, rel=0.1)
        assert left["acc"][axis]["random_walk"] == pytest.approx(ACC_WALK, rel=0.1)
    assert values["data_sheet"]["gyro"] == pytest.approx(math.radians(0.008))
    picture = (tmp_path / "still.allan.png").read_bytes()
    assert picture[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = struct.unpack(">II", picture[16:24])
    assert width > 1000
    assert height > 400


def test_allan_as_text_without_a_gyro(tmp_path: Path) -> None:
    file = recorded(tmp_path / "still.mcap", 70.0, gyro=False)
    out = tmp_path / "picture.png"
    result = call("allan", str(file), "--out", str(out), "--gyro-density", "5", "--acc-density", "60")
    assert result.exit_code == 0, result.output
    assert "user/imu/left  acc" in result.output
    assert "gyro" not in result.output
    assert "data sheet 0.000588" in result.output
    assert out.exists()


@pytest.mark.parametrize(
    ("recording", "text"),
    [
        ({"seconds": 30.0}, "at least 60"),
        ({"seconds": 80.0, "moved_at": 60.0}, "it moved 6"),
        ({"seconds": 80.0, "lost": 0.05}, "missing"),
    ],
)
def test_allan_refuses_what_does_not_serve(recording: dict[str, float], text: str, tmp_path: Path) -> None:
    result = call("allan", str(recorded(tmp_path / "r.mcap", **recording)))  # type: ignore[arg-type]
    assert isinstance(result.exception, CommandFailed)
    assert text in result.output
    assert not (tmp_path / "r.allan.png").exists()


@pytest.mark.parametrize("wrong", [["--chip", "abacus"], ["--gyro-density", "5"]])
def test_allan_explains_wrong_options(wrong: list[str]) -> None:
    result = call("allan", "nothing.mcap", *wrong)
    assert isinstance(result.exception, CommandFailed)
    assert result.exception.code == 2


def test_the_ports_are_listed() -> None:
    result = call("ports", "--json")
    assert result.exit_code == 0
    assert isinstance(json.loads(result.stdout)["ports"], list)


async def _play(pty: PtyPort, device: Bno08xDevice) -> None:
    while True:
        pty.write(device.hear(pty.read()))
        pty.write(device.measure(DeviceSample(None, (0.0, 0.0, 9.8), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))))
        await asyncio.sleep(0.005)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no ptys")
@pytest.mark.parametrize("command", [Command.SAVE_CALIBRATION, Command.CLEAR_CALIBRATION_AND_RESET])
def test_the_chip_saves_and_clears(command: Command, run: Any) -> None:
    async def scenario() -> list[int]:
        device = Bno08xDevice()
        with PtyPort() as pty:
            playing = asyncio.create_task(_play(pty, device))
            await command_chip(lambda: pty.port, command, timeout_s=15.0)
            playing.cancel()
            await asyncio.gather(playing, return_exceptions=True)
        return device.commands

    assert run(scenario()) == [command]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no ptys")
def test_a_line_without_a_chip_says_so(run: Any) -> None:
    with PtyPort() as pty, pytest.raises(NoAnswer, match="no BNO08x answers"):
        run(command_chip(lambda: pty.port, Command.SAVE_CALIBRATION, timeout_s=0.5))
    with pytest.raises(NoAnswer, match="nowhere"):
        run(command_chip(lambda: "/dev/nowhere", Command.SAVE_CALIBRATION, timeout_s=0.5))
