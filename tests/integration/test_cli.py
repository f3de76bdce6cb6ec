"""The command line as a person uses it: in processes of its own."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

FOOTTRACK = [sys.executable, "-c", "from foottrack_service.cli.main import main; main()"]


def foottrack(*args: object, cwd: Path, code: int = 0, timeout: float = 60.0) -> subprocess.CompletedProcess[str]:
    """Run a command to its end, and check its exit code."""
    done = subprocess.run(
        [*FOOTTRACK, *map(str, args)], capture_output=True, text=True, timeout=timeout, cwd=cwd, check=False
    )
    assert done.returncode == code, done.stderr + done.stdout
    assert "Traceback" not in done.stderr
    return done


@contextmanager
def running(cwd: Path, *args: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """``foottrack run`` on free ports, and the address to connect to; the ports are in a row only by luck."""
    process = subprocess.Popen([*FOOTTRACK, "run", "--listen", "0", *args], stderr=subprocess.PIPE, text=True, cwd=cwd)
    try:
        assert process.stderr is not None
        said = process.stderr.readline()
        yield process, said
    finally:
        process.kill()
        process.wait()
        process.stderr.close()


@pytest.mark.slow
def test_demo_reports_rates_errors_and_latency(tmp_path: Path) -> None:
    done = foottrack(
        *("demo", "--seconds", 4, "--listen", 0, "--task", "steps", "--record", "demo.mcap", "--json"),
        *("--camera", "simulated"),
        cwd=tmp_path,
    )
    found = json.loads(done.stdout)
    assert set(found) == {"seconds", "streams", "error_mm", "latency_ms"}
    assert found["seconds"] >= 4.0
    assert set(found["error_mm"]["left"]) == {"mean", "median", "p95", "max"}
    assert 0.0 < found["error_mm"]["right"]["median"] < 60.0
    assert found["streams"]["user/pose/body"]["hz"] > 50.0
    assert {"user/imu/left", "user/head/pose", "user/marker/left", "user/truth/right"} <= set(found["streams"])
    assert all(stream["gaps"] == 0 for stream in found["streams"].values())
    assert 0.0 < found["latency_ms"]["p50"] <= found["latency_ms"]["p99"]
    info = json.loads(foottrack("log", "info", "demo.mcap", "--json", cwd=tmp_path).stdout)
    assert "user/pose/body" in str(info["topics"])


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no ptys")
def test_demo_finds_the_feet_in_drawn_pictures(tmp_path: Path) -> None:
    done = foottrack("demo", "--seconds", 5, "--listen", 0, "--json", cwd=tmp_path, timeout=150.0)
    found = json.loads(done.stdout)
    drawn = min(found["streams"].get(f"user/marker/{side}", {"hz": 0.0})["hz"] for side in ("left", "right"))
    if drawn < 9.0:
        pytest.skip(f"this machine draws only {drawn:g} pictures/s beside its other work")
    assert 0.0 < found["error_mm"]["left"]["median"] < 60.0
    assert all(stream["gaps"] == 0 for stream in found["streams"].values())


@pytest.mark.slow
def test_a_simulation_replays_offline_to_the_same_file(tmp_path: Path) -> None:
    foottrack("sim", "--task", "line", "--seconds", 3, "--out", "line.mcap", cwd=tmp_path)
    for out in ("first.mcap", "second.mcap"):
        foottrack("replay", "line.mcap", "--offline", "--out", out, cwd=tmp_path)
    assert (tmp_path / "first.mcap").read_bytes() == (tmp_path / "second.mcap").read_bytes()
    foottrack("log", "diff", "first.mcap", "second.mcap", cwd=tmp_path)
    refused = foottrack("replay", "line.mcap", "--offline", "--out", "first.mcap", cwd=tmp_path, code=1)
    assert "exists already" in refused.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="signals to other processes are POSIX's")
@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM])
def test_the_service_ends_cleanly_when_told(tmp_path: Path, stop: signal.Signals) -> None:
    with running(tmp_path) as (process, said):
        assert re.search(r"publishers tcp://127\.0\.0\.1:\d+", said)
        process.send_signal(stop)
        assert process.wait(10) == 0
        assert process.stderr is not None
        assert process.stderr.read().strip() == "Stopped."


@pytest.mark.skipif(sys.platform == "win32", reason="signals to other processes are POSIX's")
def test_ctrl_c_closes_a_demo_s_recording(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [*FOOTTRACK, "demo", "--seconds", "60", "--listen", "0", "--record", "cut.mcap"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
    )
    assert process.stderr is not None and process.stdout is not None
    assert any("publishers on" in line for line in process.stderr)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=20)
    assert process.returncode == 0, err
    assert "Stopped early" in err
    assert "Recorded to cut.mcap" in out
    assert (tmp_path / "cut.mcap").exists()
    foottrack("log", "info", "cut.mcap", cwd=tmp_path)


@pytest.mark.skipif(sys.platform == "win32", reason="signals to other processes are POSIX's")
def test_ctrl_c_closes_a_recording_and_says_what_is_in_it(tmp_path: Path) -> None:
    with running(tmp_path) as (_, said):
        ports = dict(zip(("INGRESS", "EGRESS", "CONTROL"), re.findall(r"tcp://[\d.:]+", said), strict=True))
        process = subprocess.Popen(
            [*FOOTTRACK, "record", "cut.mcap"],
            stderr=subprocess.PIPE,
            text=True,
            cwd=tmp_path,
            env=os.environ | {f"FOOTTRACK_BUS__{name}": address for name, address in ports.items()},
        )
        while not list(tmp_path.glob("cut.mcap*")):
            assert process.poll() is None
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=20)
    assert process.returncode == 0, err
    assert re.fullmatch(r"Wrote cut\.mcap: \d+ messages, 0 dropped\.\n", err)
    foottrack("log", "info", "cut.mcap", cwd=tmp_path)


@pytest.mark.parametrize(
    ("args", "code", "helps"),
    [
        (["demo", "--task", "flying"], 2, "walk-in-place"),
        (["demo", "--camera", "eyes"], 2, "rendered"),
        (["evaluate", "--camera", "eyes"], 2, "rendered"),
        (["node", "toaster"], 2, "fusion"),
        (["run", "--listen", "tcp://0.0.0.0:7701"], 1, "loopback"),
        (["run", "--listen", "nowhere"], 2, "tcp://127.0.0.1:7701"),
        (["run", "--config", "missing.toml"], 2, "missing.toml"),
        (["top", "--connect", "7991", "--seconds", "1"], 1, "is the service running"),
        (["replay", "broken.mcap", "--offline", "--out", "x.mcap"], 1, "broken.mcap"),
        (["replay", "broken.mcap", "--offline"], 2, "--out"),
        (["evaluate", "--tasks", "dancing"], 2, "knee-bends"),
        (["evaluate", "--seeds", "one"], 2, "whole numbers"),
        (["evaluate", "--real", "nowhere"], 1, "imu_sample.csv"),
        (["config", "check", "--config", "typo.toml"], 2, "heihgt"),
        (["evaluate", "--tasks", "steps", "--html", "nowhere/x.html"], 2, "no folder nowhere"),
        (["config", "init", "nowhere/foottrack.toml"], 1, "nowhere/foottrack.toml: No such file"),
        (["sim", "--seconds", "4000", "--out", "x.mcap"], 2, "1 to 3600 s"),
        (["log", "import", "walk.msgpack", "--out", "x.mcap", "--config", "latin.toml"], 2, "latin.toml"),
    ],
)
def test_what_a_person_can_get_wrong_is_one_helpful_line(
    tmp_path: Path, args: list[str], code: int, helps: str
) -> None:
    (tmp_path / "broken.mcap").write_bytes(b"\x89MCAP0\r\nnonsense")
    (tmp_path / "typo.toml").write_text("[body]\nheihgt = 1.8\n")
    (tmp_path / "latin.toml").write_bytes("# Größe\n".encode("latin-1"))
    done = foottrack(*args, cwd=tmp_path, code=code)
    assert helps in done.stderr
    assert len(done.stderr.strip().splitlines()) == (1 if "flying" not in args else done.stderr.strip().count("\n") + 1)


def test_a_console_that_lacks_a_letter_ends_no_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As Windows has it where the output goes into a file."""
    monkeypatch.setenv("PYTHONIOENCODING", "cp1252")
    foottrack("walk", "new", "sneak", "--out", "mine.json", cwd=tmp_path)
    project = json.loads((tmp_path / "mine.json").read_text(encoding="utf-8"))
    (tmp_path / "mine.json").write_text(json.dumps({**project, "name": "\u221a2"}), encoding="utf-8")
    assert "\\u221a2: stride" in foottrack("walk", "show", "mine.json", cwd=tmp_path).stdout


def test_settings_are_written_commented_and_read_back(tmp_path: Path) -> None:
    foottrack("config", "init", cwd=tmp_path)
    found = json.loads(foottrack("config", "check", "--json", cwd=tmp_path).stdout)
    assert found["settings"] == {}
    (tmp_path / "foottrack.toml").write_text("[body]\nheight = 1.62\n")
    found = json.loads(foottrack("config", "check", "--json", cwd=tmp_path).stdout)
    assert found["settings"] == {"body.height": {"value": 1.62, "from": "foottrack.toml"}}
    foottrack("config", "init", cwd=tmp_path, code=1)


@pytest.mark.skipif(sys.platform == "win32", reason="signals to other processes are POSIX's")
def test_doctor_says_what_is_wrong(tmp_path: Path) -> None:
    done = foottrack("doctor", "--probe", "--connect", "7991", "--json", cwd=tmp_path, code=1)
    assert not json.loads(done.stdout)["healthy"]
    (tmp_path / "foottrack.toml").write_text('[imu.left]\nformat = "rvc"\nport = "1234:abcd"\n')
    done = foottrack("doctor", "--connect", "7991", "--json", cwd=tmp_path, code=1)
    levels = {finding["subject"]: finding["level"] for finding in json.loads(done.stdout)["findings"]}
    assert levels["imu left"] == "error"
    assert levels["service"] == "error"


def test_nothing_heavy_is_loaded_before_a_command_needs_it() -> None:
    code = "import sys, foottrack_service.cli.main; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not {"scipy", "numba", "cv2", "matplotlib", "foottrack_service.app"}.intersection(loaded)


def test_what_the_first_start_would_wait_for_can_be_compiled_before(tmp_path: Path) -> None:
    done = foottrack("compile", cwd=tmp_path)
    assert (done.stdout, done.stderr) == ("", "All is compiled.\n")
    assert "compile" in foottrack("--help", cwd=tmp_path).stdout


def test_libraries_talk_only_to_warn(tmp_path: Path) -> None:
    done = foottrack("markers", cwd=tmp_path)
    assert done.stderr == ""
    assert (tmp_path / "foottrack-markers.pdf").read_bytes().startswith(b"%PDF")
