"""``foottrack log raw``: a raw recording at a desk."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import typer

from foottrack_service.cli.running import EXIT_USAGE, CommandFailed, print_json
from foottrack_service.config import Settings, to_toml
from foottrack_service.recording.raw_files import CAMERA, RawFiles, raw_messages, write_raw
from foottrack_service.recording.recording import Recording

SETTINGS_FILE = "foottrack.toml"
MAX_EXPOSURE_S = 0.1
"""What the settings take."""


def unpack(recording: Recording, out: Path, user: str | None, config: Path | None, as_json: bool) -> None:
    """Write the files, decode the bytes again, and say what came out. Raises RecordingError, OSError."""
    from foottrack_service.cli.offline import settings_of
    from foottrack_service.imu.again import decode_again

    user = user or _only_user(recording)
    settings = settings_of(recording, config)
    files = write_raw(recording, user, out)
    report: dict[str, Any] = {"user": user, "out": str(out), "imu": {}, "camera": None}
    for side, seen in files.imu.items():
        device = settings.imu.left if side == "left" else settings.imu.right
        stream = f"raw/imu/{side}"
        decoded = decode_again((raw for raw in raw_messages(recording, user) if raw.stream == stream), device)
        report["imu"][side] = {**asdict(seen), "samples": len(decoded.samples), "drops": dict(decoded.drops)}
    if files.first is not None:
        report["camera"] = {name: getattr(files, name) for name in ("pictures", "depths", "torn", "other_lens")}
        (out / SETTINGS_FILE).write_text(to_toml(playing(settings, files, out / CAMERA)), encoding="utf-8")
    if as_json:
        print_json(report)
    else:
        _show(report, out)


def playing(settings: Settings, files: RawFiles, folder: Path) -> Settings:
    """Settings whose camera is the folder of pictures, with the lens that took them."""
    picture = files.first
    assert picture is not None
    values = settings.model_dump(mode="json")
    values["camera"]["source"].update(
        kind="folder",
        exposure=min(picture.exposure, MAX_EXPOSURE_S) or settings.camera.source.exposure,
        lens=picture.lens.model_dump(mode="json"),
    )
    values["camera"]["source"]["folder"].update(path=str(folder.resolve()))
    if picture.depth_unit > 0.0:
        values["camera"]["source"]["folder"].update(depth_scale=1.0 / picture.depth_unit)
    return Settings.model_validate(values)


def _only_user(recording: Recording) -> str:
    users = sorted({message.user for message in raw_messages(recording)})
    if not users:
        raise CommandFailed(f"{recording.path} has no raw streams: record with --raw")
    if len(users) > 1:
        raise CommandFailed(
            f"{recording.path} has several users, choose one with --user: {', '.join(users)}", EXIT_USAGE
        )
    return users[0]


def _show(report: dict[str, Any], out: Path) -> None:
    for side, imu in report["imu"].items():
        drops = ", ".join(f"{count} {reason}" for reason, count in sorted(imu["drops"].items())) or "nothing"
        typer.echo(
            f"imu-{side}: {imu['bytes']} bytes of {'/'.join(imu['formats'])} in {imu['reads']} reads, decoded again "
            f"{imu['samples']} samples, dropped {drops}"
        )
    camera = report["camera"]
    if camera is not None:
        typer.echo(
            f"camera: {camera['pictures']} pictures, {camera['depths']} with depth, {camera['torn']} torn, "
            f"{camera['other_lens']} of another lens left out"
        )
        typer.echo(f"Look at them: foottrack camera --config {out / SETTINGS_FILE} --show {out / 'seen'}")
