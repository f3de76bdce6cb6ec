"""``foottrack camera``: look at what the camera sees and what is found in it; and the camera's calibrations."""

from __future__ import annotations

import time
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from foottrack_service.cli.running import (
    EXIT_USAGE,
    CommandFailed,
    ConfigOption,
    ConnectOption,
    JsonOption,
    UserOption,
    print_json,
    settings_for,
)

if TYPE_CHECKING:
    from foottrack_service.camera.boards import Board, View
    from foottrack_service.camera.frame import Source

_PICTURES = (".png", ".jpg", ".jpeg")


def camera(
    show: Annotated[
        Path, typer.Option("--show", help="FILE.png: the best of the pictures; DIR: all of them, found feet drawn in.")
    ],
    count: Annotated[int, typer.Option("--count", min=1, help="How many pictures to take.")] = 30,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Take pictures from the configured source, and draw what is found into them. Fails when nothing is.

    Example: foottrack camera --show feet.png
    """
    import cv2

    from foottrack_service.camera import overlay
    from foottrack_service.camera.frame import SourceEnded
    from foottrack_service.camera.setup import Trackers

    settings = settings_for(config)
    one = show.suffix.lower() in _PICTURES
    (show.parent if one else show).mkdir(parents=True, exist_ok=True)
    source = _open(settings)
    found: Counter[str] = Counter()
    files: list[str] = []
    best: tuple[int, Any] | None = None
    taken = 0
    try:
        trackers = _usage(lambda: Trackers(settings.camera, source.intrinsics))
        for _ in range(count):
            try:
                frame = _read(source)
            except SourceEnded:
                break
            taken += 1
            fixes = trackers.process(frame)
            found.update(f"{fix.kind}/{fix.side}" for fix in fixes)
            picture = overlay.draw(frame, fixes, trackers.windows, trackers.rig)
            if not one:
                files.append(_save(cv2, show / f"{frame.number:06d}.png", picture))
            elif best is None or len(fixes) > best[0]:
                best = (len(fixes), picture)
    finally:
        source.close()
    if best is not None:
        files.append(_save(cv2, show, best[1]))
    if as_json:
        print_json({"pictures": taken, "found": dict(found), "files": files})
    else:
        typer.echo(f"{taken} pictures, found {dict(found) or 'nothing'}; see {show}")
    if not found:
        raise CommandFailed("no foot was found: is the tag's id in the settings, sharp, and larger than 15 px?")


def calibrate_camera(
    files: Annotated[
        list[Path] | None, typer.Argument(help="Pictures of the board; none: live, from the source.")
    ] = None,
    board: Annotated[str, typer.Option("--board", help="chessboard or charuco.")] = "chessboard",
    columns: Annotated[int, typer.Option("--columns", help="Inner corners; for charuco, squares.")] = 9,
    rows: Annotated[int, typer.Option("--rows", help="Likewise.")] = 6,
    square: Annotated[float, typer.Option("--square", help="Edge of a square, mm.")] = 25.0,
    marker: Annotated[float, typer.Option("--marker", help="charuco: edge of a tag, mm.")] = 18.0,
    dictionary: Annotated[str, typer.Option("--dictionary", help="charuco: its tags.")] = "DICT_4X4_50",
    views: Annotated[int, typer.Option("--views", min=8, help="Live: how many to collect.")] = 20,
    max_rms: Annotated[float, typer.Option("--max-rms", help="Refuse a fit that is worse, px.")] = 0.8,
    refine: Annotated[
        int | None,
        typer.Option(
            "--refine",
            help="chessboard: corner neighbourhood, px; 0.4 of the least spacing if absent, 11 as OpenCV does it.",
        ),
    ] = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Find the lens's intrinsics and print them as settings. Refuses a set of views that does not determine them.

    Example: foottrack calibrate camera board/*.jpg --columns 9 --rows 6 --square 25
    """
    from foottrack_service.camera.boards import CharucoBoard, Chessboard
    from foottrack_service.camera.calibration import CalibrationError, calibrate

    chosen: Board
    if board == "chessboard":
        chosen = Chessboard(columns, rows, square / 1000.0, refine)
    elif board == "charuco":
        chosen = CharucoBoard(columns, rows, square / 1000.0, marker / 1000.0, dictionary)
    else:
        raise CommandFailed("--board is chessboard or charuco", EXIT_USAGE)
    seen, width, height = _usage(lambda: _from_files(chosen, files) if files else _live(chosen, views, config))
    try:
        result = calibrate(seen, width, height, max_rms)
    except CalibrationError as error:
        raise CommandFailed(f"refused: {error}") from None
    lens = result.intrinsics
    values = {
        "width": width,
        "height": height,
        "fx": round(lens.fx, 3),
        "fy": round(lens.fy, 3),
        "cx": round(lens.cx, 3),
        "cy": round(lens.cy, 3),
        "distortion": [round(c, 6) for c in lens.distortion],
    }
    if as_json:
        print_json({"lens": values, "rms_px": result.rms, "focal_sigma_px": result.focal_sigma, "views": len(seen)})
        return
    typer.echo(f"# {len(seen)} views, {result.rms:.3f} px rms, focal length known to {result.focal_sigma:.2f} px")
    typer.echo("[camera.source.lens]")
    for key, value in values.items():
        typer.echo(f"{key} = {value}")


def calibrate_floor(
    pictures: Annotated[int, typer.Option("--pictures", min=10, help="How many to use.")] = 60,
    config: ConfigOption = None,
    user: UserOption = None,
    connect: ConnectOption = None,
    as_json: JsonOption = False,
) -> None:
    """Find the floor's height with the depth camera while the headset's pose is on the bus, and publish it.

    The camera must be free: start the service without its camera node. Example: foottrack calibrate floor-by-depth
    """
    from foottrack_service.camera.floor import FloorError
    from foottrack_service.cli.camera_floor import measure_floor

    settings = settings_for(config, user, connect)
    try:
        found = measure_floor(settings, _open(settings), pictures)
    except FloorError as error:
        raise CommandFailed(f"refused: {error}") from None
    values = {"height": found.height, "tilt": found.tilt, "spread": found.spread, "pictures": found.pictures}
    if as_json:
        print_json(values)
    else:
        typer.echo(f"floor at {1000 * found.height:.1f} mm in the stage, {found.pictures} pictures, published")


def _open(settings: Any) -> Source:
    from foottrack_service.camera.frame import SourceError
    from foottrack_service.camera.setup import open_source

    try:
        return open_source(settings, time.perf_counter_ns)
    except SourceError as error:
        raise CommandFailed(str(error)) from None


def _read(source: Source) -> Any:
    from foottrack_service.camera.frame import SourceError

    try:
        return source.read()
    except SourceError as error:
        raise CommandFailed(str(error)) from None


def _usage(work: Any) -> Any:
    try:
        return work()
    except ValueError as error:
        raise CommandFailed(str(error), EXIT_USAGE) from None


def _save(cv2: Any, path: Path, picture: Any) -> str:
    if not cv2.imwrite(str(path), picture):
        raise CommandFailed(f"{path} cannot be written")
    return str(path)


def _from_files(board: Board, files: list[Path]) -> tuple[list[View], int, int]:
    import cv2

    seen: list[View] = []
    size: tuple[int, ...] | None = None
    for file in files:
        gray: Any = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
        if gray is None:
            raise ValueError(f"{file} is no picture")
        if size is not None and gray.shape != size:
            raise ValueError(f"{file} is {gray.shape[1]}x{gray.shape[0]} px, the others are {size[1]}x{size[0]}")
        size = gray.shape
        view = board.find(gray)
        typer.echo(f"{file.name}: {'board found' if view else 'no board'}", err=True)
        if view is not None:
            seen.append(view)
    assert size is not None
    return seen, size[1], size[0]


def _live(board: Board, wanted: int, config: Path | None) -> tuple[list[View], int, int]:
    from foottrack_service.camera.calibration import coverage_hints, is_new
    from foottrack_service.camera.frame import SourceEnded

    source = _open(settings_for(config))
    seen: list[View] = []
    lens = source.intrinsics
    try:
        hints: list[str] = []
        while len(seen) < wanted or hints:
            view = board.find(_read(source).gray)
            if view is None or not is_new(view, seen, lens.width):
                continue
            seen.append(view)
            hints = coverage_hints(seen, lens.width, lens.height)
            typer.echo(f"{len(seen)} views; {hints[0] if hints else 'covered, tilt it differently'}", err=True)
    except (SourceEnded, KeyboardInterrupt):
        typer.echo("stopped; calibrating with what there is", err=True)
    finally:
        source.close()
    return seen, lens.width, lens.height
