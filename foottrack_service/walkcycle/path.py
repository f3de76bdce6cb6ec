"""Paths on the floor, by arc length: a straight line, a circle, a polyline, a spline through points.

Points are (x, z) in the model frame, metres; headings are yaw about +Y, 0 towards +Z, positive to the left (+X).
Every path goes on straight (or round) beyond both ends, so that a footprint or a pelvis a little outside has a
place.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline, PchipInterpolator

from foottrack_service.walkcycle.errors import PathError

Array = npt.NDArray[np.float64]

_DENSE: Final = 4001
FORMS: Final = "line:LENGTH[,DEGREES], circle:RADIUS[,DEGREES], s:LENGTH[,WIDTH], corner:LENGTH[,DEGREES], FILE.json"


@dataclass(frozen=True)
class Path:
    """`place` maps arc lengths (n,) m to points (n, 2) m, `heading` to yaw (n,) rad, both unwrapped and smooth."""

    length: float
    place: Callable[[Array], Array]
    heading: Callable[[Array], Array]

    def offset(self, s: Array, left: float | Array) -> Array:
        """Points (n, 2) to the left (+) of the path at arc lengths s."""
        yaw = self.heading(s)
        side = np.stack([np.cos(yaw), -np.sin(yaw)], axis=-1)
        return np.asarray(self.place(s) + np.asarray(left)[..., None] * side)

    def project(self, point: tuple[float, float], near: float = 0.0) -> tuple[float, float]:
        """Arc length, and distance to the left (+), m, of a point less far from the path than it bends."""
        s = np.array([near])
        for _ in range(60):
            away = np.asarray(point) - self.place(s)[0]
            yaw = float(self.heading(s)[0])
            s = s + away @ [np.sin(yaw), np.cos(yaw)]
        return float(s[0]), float(away @ [np.cos(yaw), -np.sin(yaw)])

    def moved(self, to: tuple[float, float], yaw: float) -> Path:
        """The same path from another start: what began at the origin, towards +Z, begins at `to` with heading
        `yaw` (rad)."""
        turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        return Path(
            self.length,
            lambda s: np.asarray(self.place(s) @ turn + np.asarray(to)),
            lambda s: np.asarray(self.heading(s) + yaw),
        )


def line(length: float, degrees: float = 0.0) -> Path:
    """Straight ahead, or at an angle to the left."""
    _positive(length, "a line's length")
    yaw = np.radians(degrees)
    way = np.array([np.sin(yaw), np.cos(yaw)])
    return Path(length, lambda s: np.asarray(s)[..., None] * way, lambda s: np.full(np.shape(s), yaw))


def circle(radius: float, degrees: float = 360.0) -> Path:
    """Round a circle to the left (negative degrees: to the right), starting towards +Z."""
    _positive(radius, "a circle's radius")
    if not np.isfinite(degrees) or degrees == 0.0:
        raise PathError("a circle's angle must not be 0")
    turn = float(np.sign(degrees)) / radius

    def place(s: Array) -> Array:
        a = np.asarray(s) * turn
        return np.stack([1.0 - np.cos(a), np.sin(a)], axis=-1) / turn

    return Path(radius * abs(np.radians(degrees)), place, lambda s: np.asarray(s) * turn)


def spline(points: npt.ArrayLike) -> Path:
    """The natural cubic spline through points (k, 2), by arc length."""
    knots = _points(points)
    chord = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(knots, axis=0).T))])
    curve = CubicSpline(chord, knots, bc_type="natural")
    u = np.linspace(0.0, chord[-1], _DENSE)
    speed = np.hypot(*curve(u, 1).T)
    if np.min(speed) < 1e-3:
        raise PathError("the path has a cusp: its points turn back on themselves (give a polyline)")
    arc = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(u))])
    way = curve(u, 1)
    return _sampled(arc, curve(u), np.unwrap(np.arctan2(way[:, 0], way[:, 1])))


def polyline(points: npt.ArrayLike, rounding: float) -> Path:
    """Straight segments whose corners are walked in an arc: place and heading are averaged over `rounding` m of
    the way (half a step on either side is how people turn a corner). Turning back on the spot is allowed."""
    knots = _points(points)
    _positive(rounding, "a polyline's rounding")
    edges = np.diff(knots, axis=0)
    lengths = np.hypot(*edges.T)
    arc = np.concatenate([[0.0], np.cumsum(lengths)])
    turns = np.unwrap(np.arctan2(edges[:, 0], edges[:, 1]))
    width = min(rounding, float(arc[-1]))
    # The integral of a piecewise linear curve is exact by its antiderivative, so the mean over a window is too.
    s = np.linspace(0.0, float(arc[-1]), _DENSE)
    ways = np.stack([np.sin(turns), np.cos(turns)], axis=-1)

    def mean(values: Array) -> Array:
        """Mean over the window of what is constant on each segment, its first and last going on beyond the ends."""
        ends = np.concatenate([[arc[0] - width], arc[1:-1], [arc[-1] + width]])
        steps = np.diff(ends)[:, None] * values
        whole = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(steps, axis=0)])
        smooth = [np.interp(s + side, ends, column) for column in whole.T for side in (0.5 * width, -0.5 * width)]
        return np.stack([(smooth[i] - smooth[i + 1]) / width for i in range(0, len(smooth), 2)], axis=-1)

    velocity = mean(ways)
    moved = np.concatenate(
        [[[0.0, 0.0]], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * np.diff(s)[:, None], axis=0)]
    )
    return _sampled(s, knots[0] + moved, mean(turns[:, None])[:, 0])


def s_curve(length: float, width: float = 1.0) -> Path:
    """An S of that length along +Z, swinging `width` m to the left and to the right."""
    _positive(length, "an S-curve's length")
    z = np.linspace(0.0, length, 33)
    return spline(np.stack([0.5 * width * np.sin(2.0 * np.pi * z / length), z], axis=-1))


def parse_path(text: str, rounding: float = 0.7) -> Path:
    """A path from `line:5`, `line:5,30`, `circle:3`, `circle:1,-180`, `s:6,1.5`, `corner:3,90` or a JSON file with
    {"points": [[x, z], ...], "kind": "polyline" | "spline"}. Raises PathError, which names what is wrong."""
    kind, colon, rest = text.partition(":")
    makers: dict[str, tuple[int, Callable[..., Path]]] = {
        "line": (2, line),
        "circle": (2, circle),
        "s": (2, s_curve),
        "corner": (2, lambda leg, degrees=90.0: _corner(leg, degrees, rounding)),
    }
    if colon and kind in makers:
        most, make = makers[kind]
        try:
            values = [float(part) for part in rest.split(",")]
        except ValueError:
            raise PathError(f"path {text!r}: {rest!r} is not a number") from None
        if len(values) > most or not np.all(np.isfinite(values)):
            raise PathError(f"path {text!r}: expected {FORMS}")
        return make(*values)
    if text.lower().endswith(".json"):
        return _from_file(FilePath(text), rounding)
    raise PathError(f"path {text!r}: expected {FORMS}")


def _corner(leg: float, degrees: float, rounding: float) -> Path:
    _positive(leg, "a corner's leg")
    yaw = np.radians(degrees)
    return polyline([(0.0, 0.0), (0.0, leg), (leg * np.sin(yaw), leg + leg * np.cos(yaw))], rounding)


def _from_file(file: FilePath, rounding: float) -> Path:
    try:
        data = json.loads(file.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise PathError(f"path {file}: {error.strerror or error}") from None
    except ValueError as error:
        raise PathError(f"path {file}: not a JSON file: {error}") from None
    points: Any = data.get("points") if isinstance(data, dict) else data
    kind = data.get("kind", "polyline") if isinstance(data, dict) else "polyline"
    try:
        if kind == "spline":
            return spline(points)
        if kind == "polyline":
            return polyline(points, rounding)
    except PathError as error:
        raise PathError(f"path {file}: {error}") from None
    raise PathError(f'path {file}: "kind" must be "polyline" or "spline", not {kind!r}')


def _points(points: npt.ArrayLike) -> Array:
    try:
        knots = np.asarray(points, dtype=np.float64)
    except (TypeError, ValueError):
        raise PathError('"points" must be a list of [x, z] in metres') from None
    if knots.ndim != 2 or knots.shape[1] != 2 or len(knots) < 2 or not np.all(np.isfinite(knots)):
        raise PathError('"points" must be two or more [x, z] in metres')
    gaps = np.hypot(*np.diff(knots, axis=0).T)
    if np.any(gaps < 1e-6):
        raise PathError(f"points {int(np.argmin(gaps))} and {int(np.argmin(gaps)) + 1} are the same place")
    return knots


def _positive(value: float, what: str) -> None:
    if not (np.isfinite(value) and value > 0.0):
        raise PathError(f"{what} must be above 0 m, not {value:g}")


def _sampled(arc: Array, places: Array, headings: Array) -> Path:
    """A path through dense samples, going on straight beyond its ends."""
    length = float(arc[-1])
    curve, turn = CubicSpline(arc, places), PchipInterpolator(arc, headings)
    first, last = curve(0.0, 1), curve(length, 1)

    def place(s: Array) -> Array:
        s = np.asarray(s, dtype=np.float64)
        inside = np.clip(s, 0.0, length)
        before, beyond = np.minimum(s, 0.0)[..., None], np.maximum(s - length, 0.0)[..., None]
        return np.asarray(curve(inside) + before * first + beyond * last)

    return Path(length, place, lambda s: np.asarray(turn(np.clip(s, 0.0, length))))
