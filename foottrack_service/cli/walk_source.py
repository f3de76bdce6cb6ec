"""What ``foottrack walk`` works on: from a command's words to projects, cycles and walks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from foottrack_service.cli.running import EXIT_USAGE, CommandFailed

if TYPE_CHECKING:
    from foottrack_service.walkcycle.cycle import Cycle
    from foottrack_service.walkcycle.parameters import Parameters
    from foottrack_service.walkcycle.project import Project
    from foottrack_service.walkcycle.walk import Walk


def project_of(source: str, parameters: Parameters | None = None) -> Project:
    """A preset, or a project file, with the knobs turned. Raises CommandFailed, WalkError."""
    from foottrack_service.walkcycle.errors import ProjectError
    from foottrack_service.walkcycle.parameters import with_parameters
    from foottrack_service.walkcycle.presets import preset
    from foottrack_service.walkcycle.project import parse_project

    if source.lower().endswith(".json"):
        try:
            project = parse_project(Path(source).read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError) as error:
            raise CommandFailed(f"{source}: {getattr(error, 'strerror', None) or error}", EXIT_USAGE) from None
        except ProjectError as error:
            raise ProjectError(f"{source}: {error}") from None
    elif source.lower().endswith((".bvh", ".glb")):
        raise CommandFailed(f"{source} holds a motion; key poses are in a project, FILE.json", EXIT_USAGE)
    else:
        project = preset(source)
    return with_parameters(project, parameters) if parameters is not None else project


def motion_facts(file: Path) -> dict[str, object] | None:
    """What a BVH or GLB holds; None for a file of another kind. Raises CommandFailed, MotionFileError."""
    from foottrack_service.walkcycle.bvh import parse_bvh
    from foottrack_service.walkcycle.errors import MotionFileError
    from foottrack_service.walkcycle.glb import parse_glb
    from foottrack_service.walkcycle.skeleton import JOINTS

    ending = file.suffix.lower()
    if ending not in (".bvh", ".glb"):
        return None
    try:
        data = file.read_bytes()
        if ending == ".bvh":
            found = parse_bvh(data.decode("utf-8"))
            joints, motion = len(found.names), found.motion
        else:
            joints, motion = len(JOINTS), parse_glb(data)
    except (OSError, UnicodeDecodeError) as error:
        raise CommandFailed(f"{file}: {getattr(error, 'strerror', None) or error}", EXIT_USAGE) from None
    except MotionFileError as error:
        raise MotionFileError(f"{file}: {error}") from None
    seconds = float(motion.times[-1] - motion.times[0])
    return {"file": str(file), "joints": joints, "frames": len(motion.times), "seconds": seconds}


def knobs(*values: float | None) -> Parameters | None:
    """The knobs in the order of `Parameters`, None when none is turned."""
    from foottrack_service.walkcycle.parameters import Parameters

    return Parameters(*values) if any(value is not None for value in values) else None


def cycle_of(project: Project, height: float | None) -> Cycle:
    """The cycle on the project's body or on one of that height (m). Raises CommandFailed, WalkError."""
    from foottrack_service.walkcycle.cycle import build_cycle
    from foottrack_service.walkcycle.skeleton import Humanoid

    try:
        return build_cycle(project, Humanoid(height) if height is not None else None)
    except ValueError as error:
        raise CommandFailed(str(error), EXIT_USAGE) from None


def walk_of(
    project: Project, path: str, steps: int | None, seconds: float | None, speeds: str | None, height: float | None
) -> Walk:
    """The walk that a command's options say. Raises CommandFailed, WalkError."""
    from foottrack_service.walkcycle.path import parse_path
    from foottrack_service.walkcycle.walk import walk_along, walk_for

    made = cycle_of(project, height)
    way = parse_path(path, rounding=made.step)
    if steps is not None and seconds is not None:
        raise CommandFailed("give --steps or --seconds, not both", EXIT_USAGE)
    pairs = None
    if speeds is not None:
        try:
            pairs = [(float(share), float(factor)) for share, factor in (part.split(":") for part in speeds.split(","))]
        except ValueError:
            raise CommandFailed(f"--speeds {speeds!r}: expected SHARE:FACTOR,...", EXIT_USAGE) from None
    try:
        if seconds is not None:
            return walk_for(made, way, seconds, speeds=pairs)
        return walk_along(made, way, steps, speeds=pairs)
    except ValueError as error:
        raise CommandFailed(str(error), EXIT_USAGE) from None
