"""Every figure that a walk is judged by, measured on what leaves the house: files, re-read."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from foottrack_service.walkcycle.bvh import as_humanoid, format_bvh, parse_bvh
from foottrack_service.walkcycle.cycle import Cycle, build_cycle
from foottrack_service.walkcycle.errors import WalkError
from foottrack_service.walkcycle.frames import even_frames
from foottrack_service.walkcycle.glb import format_glb, key_times, parse_glb
from foottrack_service.walkcycle.inplace import in_place
from foottrack_service.walkcycle.measure import Slip, denser, joint_angles, measure_slip
from foottrack_service.walkcycle.normative import ANGLES, normative_mean
from foottrack_service.walkcycle.path import parse_path
from foottrack_service.walkcycle.project import Project
from foottrack_service.walkcycle.skeleton import Humanoid, forward_kinematics
from foottrack_service.walkcycle.walk import Motion, Walk, walk_along

PATHS: Final = ("line:5", "circle:1", "circle:3", "s:6", "corner:3")
RATES: Final = (24.0, 30.0, 60.0)


def measure_all(projects: list[Project], paths: list[str] | None = None) -> dict[str, Any]:
    """Figures per project and path; a path that cannot be walked has an "error"."""
    figures: dict[str, Any] = {}
    for project in projects:
        cycle = build_cycle(project)
        walks: dict[str, Any] = {}
        for path in paths or PATHS:
            try:
                walks[path] = measure_walk(walk_along(cycle, parse_path(path, rounding=cycle.step)))
            except WalkError as error:
                walks[path] = {"error": str(error)}
        figures[project.name] = {
            "stride_m": cycle.stride,
            "period_s": cycle.period,
            "closure_m": cycle_closure(cycle),
            "angle_rms_deg": angle_rms(cycle) if project.name == "normative" else None,
            "walks": walks,
        }
    return figures


def measure_walk(walk: Walk) -> dict[str, Any]:
    """Slip at the generator (240 instants a second) and re-read from BVH and GLB, at the keys and four times denser;
    and the round trip's greatest error of any joint (mm)."""
    body = walk.body
    figures: dict[str, Any] = {"generator": _slip(measure_slip(body, walk.motion(walk.times(240.0)), walk.contacts))}
    for fps in RATES:
        frames = even_frames(walk, fps)
        written = frames.motion(walk)
        read = as_humanoid(parse_bvh(format_bvh(body, written)))
        figures[f"bvh_{fps:.0f}"] = _file(body, written, read, frames.contacts(walk))
        exact = walk.motion(key_times(walk, fps))
        figures[f"glb_{fps:.0f}"] = _file(body, exact, parse_glb(format_glb(body, exact)), walk.contacts)
    return figures


def cycle_closure(cycle: Cycle) -> float:
    """Greatest distance of any joint between the beginning and the end of a cycle on the spot, m."""
    motion = in_place(cycle, np.array([0.0, np.nextafter(1.0, 0.0)]))
    places, _ = forward_kinematics(cycle.body.offsets, motion.hips, motion.rotations)
    return float(np.max(np.linalg.norm(places[0] - places[1], axis=-1)))


def angle_rms(cycle: Cycle) -> dict[str, float]:
    """Root mean square distance of the left leg's angles from the published mean, degrees."""
    phase = np.arange(100) / 100.0
    angles = joint_angles(in_place(cycle, phase), "left")
    return {name: float(np.sqrt(np.mean((angles[name] - normative_mean(name, phase)) ** 2))) for name in ANGLES}


def table(figures: dict[str, Any]) -> str:
    """The same as lines of text."""
    lines = []
    for name, walk in figures.items():
        lines.append(
            f"{name}: stride {walk['stride_m']:.3f} m, {walk['period_s']:.2f} s, closure {walk['closure_m']:.1e} m"
        )
        if walk["angle_rms_deg"]:
            rms = ", ".join(f"{joint} {value:.1f}" for joint, value in walk["angle_rms_deg"].items())
            lines.append(f"  joint angles against the published mean, RMS degrees: {rms}")
        for path, files in walk["walks"].items():
            if "error" in files:
                lines.append(f"  {path}: {files['error']}")
                continue
            made = files["generator"]
            lines.append(
                f"  {path}: generator slip {made['slip_mm']:.0e} mm, yaw {made['yaw_deg']:.0e} deg,"
                f" penetration {made['penetration_mm']:.3f} mm"
            )
            for kind, file in files.items():
                if kind == "generator":
                    continue
                keys, between = file["keys"], file["between"]
                lines.append(
                    f"    {kind:7} slip at keys {keys['slip_mm']:.5f}, between {between['slip_mm']:.3f} mm, yaw"
                    f" {between['yaw_deg']:.4f} deg, penetration {keys['penetration_mm']:.3f} /"
                    f" {between['penetration_mm']:.3f} mm, round trip {file['round_trip_mm']:.5f} mm"
                )
    return "\n".join([*lines, *_worst(figures)])


def _worst(figures: dict[str, Any]) -> list[str]:
    """The greatest of every figure over all walks, a line for each kind of file."""
    walks = [files for walk in figures.values() for files in walk["walks"].values() if "error" not in files]
    if len(walks) < 2:
        return []
    lines = [f"worst of these {len(walks)} walks:"]
    for kind in walks[0]:
        parts = []
        for place in ("",) if kind == "generator" else ("keys", "between"):
            found = [files[kind] if kind == "generator" else files[kind][place] for files in walks]
            most = {name: max(each[name] for each in found) for name in ("slip_mm", "yaw_deg", "penetration_mm")}
            parts.append(
                f"{place} slip {most['slip_mm']:.3g} mm, yaw {most['yaw_deg']:.2g} deg,"
                f" penetration {most['penetration_mm']:.3f} mm".strip()
            )
        lines.append(f"  {kind:9} " + "; ".join(parts))
    return lines


def _file(body: Humanoid, written: Motion, read: Motion, contacts: list[Any]) -> dict[str, Any]:
    before, _ = forward_kinematics(body.offsets, written.hips, written.rotations)
    after, _ = forward_kinematics(body.offsets, read.hips, read.rotations)
    return {
        "keys": _slip(measure_slip(body, read, contacts)),
        "between": _slip(measure_slip(body, denser(read), contacts)),
        "round_trip_mm": 1e3 * float(np.max(np.linalg.norm(before - after, axis=-1))),
    }


def _slip(slip: Slip) -> dict[str, float]:
    return {
        "slip_mm": slip.point_mm,
        "yaw_deg": slip.yaw_deg,
        "penetration_mm": slip.penetration_mm,
        "contacts": slip.contacts,
    }
