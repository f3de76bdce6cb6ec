"""Public recordings of foot-worn IMUs with a reference, read into the wire's frames. Their data is not part of this.

``gaitmap``: both feet, 204.8 Hz, motion capture of heels and toes. ``llio_pyshoe_vicon_dev``: one foot, 200 Hz, Vicon.
``llio_corridor_dev``: one foot, 200 Hz, counted strides. ``xio_gait``: one foot, 400 Hz, ends where it began.
``quest_wip``: a headset's poses, 72 Hz.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from foottrack_protocol import Message
from foottrack_protocol.frames import SIDES
from foottrack_protocol.messages import Imu, Side
from foottrack_service import rotations as rot
from foottrack_service.config import Settings
from foottrack_service.rotations import Array

STANDARD_GRAVITY = 9.80665
GAITMAP_HZ = 204.8
GAITMAP_MOCAP_HZ = 100.0
_FORWARD_LEFT_UP_TO_FOOT = rot.from_matrix(np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]]))
"""gaitmap's sensor axes (x forward, y left, z up) to the foot's (+X right, +Y up, -Z to the toes)."""
_FORWARD_RIGHT_DOWN_TO_FOOT = rot.from_matrix(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]]))
"""z down; x roughly to the toes (the sensor sits tilted on the instep)."""


class DatasetError(Exception):
    """A recording that is not there or not as its description says; the text names the file."""


@dataclass(frozen=True, slots=True)
class FootTrial:
    """One foot's IMU, and where that foot was."""

    name: str
    side: Side
    t: Array
    """s, shape (n,)."""
    acc: Array
    """Specific force, sensor frame, m/s^2, shape (n, 3)."""
    gyro: Array
    """rad/s, shape (n, 3)."""
    sensor_to_foot: Array
    true_t: Array
    """s, shape (m,)."""
    true_xy: Array
    """Reference on the floor, m, shape (m, 2)."""
    marks: dict[str, Array] = field(default_factory=dict)
    """Other reference points, m, shape (m, 3), z up: ``heel``, ``toe``."""


def gaitmap(folder: Path) -> list[FootTrial]:
    """Both feet of the gaitmap example. Raises DatasetError."""
    imu_head, imu = _table(folder / "imu_sample.csv", 2)
    mocap_head, mocap = _table(folder / "mocap_sample.csv", 2)
    trials = []
    sides: tuple[Side, ...] = ("left", "right")
    for side in sides:
        acc = _columns(imu_head, imu, [(f"{side}_sensor", f"acc_{axis}") for axis in "xyz"])
        gyro = np.radians(_columns(imu_head, imu, [(f"{side}_sensor", f"gyr_{axis}") for axis in "xyz"]))
        letter = side[0].upper()
        marks = {
            name: 1e-3 * _columns(mocap_head, mocap, [(f"{letter}_{label}", axis) for axis in "xyz"])
            for name, label in (("heel", "FCC"), ("toe", "TOE"))
        }
        trials.append(
            FootTrial(
                name=f"gaitmap {side}",
                side=side,
                t=np.arange(len(acc)) / GAITMAP_HZ,
                acc=acc,
                gyro=gyro,
                sensor_to_foot=_FORWARD_LEFT_UP_TO_FOOT,
                true_t=np.arange(len(mocap)) / GAITMAP_MOCAP_HZ,
                true_xy=marks["heel"][:, :2],
                marks=marks,
            )
        )
    return trials


def pyshoe(file: Path) -> FootTrial:
    """One Vicon trial of the pyshoe set. Raises DatasetError."""
    try:
        with np.load(file) as data:
            columns = {key: np.asarray(data[key], dtype=np.float64) for key in ("t", "acc", "gyr", "vicon_xy")}
    except (OSError, KeyError, ValueError) as error:
        raise DatasetError(f"{file}: {error}") from None
    # Navigated in z-down axes and looked at from above: the lateral axis is mirrored.
    true_xy = columns["vicon_xy"] * [1.0, -1.0]
    t = columns["t"]
    return FootTrial(
        f"pyshoe {file.stem}", "right", t, columns["acc"], columns["gyr"], _FORWARD_RIGHT_DOWN_TO_FOOT, t, true_xy
    )


def pyshoe_peer(file: Path) -> Array:
    """Where another filter (pyshoe: a learned detector of stances) saw that foot, m, (n, 2). Raises DatasetError."""
    try:
        with np.load(file) as data:
            places: Array = np.asarray(data["pyshoe_xy"], dtype=np.float64) * [1.0, -1.0]
    except (OSError, KeyError, ValueError) as error:
        raise DatasetError(f"{file}: {error}") from None
    return places


def corridor(file: Path) -> tuple[FootTrial, int]:
    """One long walk with an IMU on one foot, and how many strides that foot took. Raises DatasetError."""
    try:
        with np.load(file) as data:
            columns = {key: np.asarray(data[key], dtype=np.float64) for key in ("t", "acc", "gyr", "gcp_xy")}
            marks = np.asarray(data["stride_idx"])
    except (OSError, KeyError, ValueError) as error:
        raise DatasetError(f"{file}: {error}") from None
    t = columns["t"] - columns["t"][0]
    name = f"corridor {file.stem.rpartition('_')[2]}"
    trial = FootTrial(
        name, "right", t, columns["acc"], columns["gyr"], _FORWARD_RIGHT_DOWN_TO_FOOT, t[marks], columns["gcp_xy"]
    )
    return trial, len(marks) - 1


def xio(file: Path) -> FootTrial:
    """One walk that ends where it began; its stamps repeat and leave gaps. Raises DatasetError."""
    try:
        values = np.genfromtxt(file, delimiter=",", skip_header=1, usecols=range(7))
    except (OSError, ValueError) as error:
        raise DatasetError(f"{file}: {error}") from None
    t, acc, gyro = values[:, 0], STANDARD_GRAVITY * values[:, 4:7], np.radians(values[:, 1:4])
    ends = values[[0, -1], 0]
    return FootTrial(f"xio {file.stem}", "right", t, acc, gyro, _FORWARD_LEFT_UP_TO_FOOT, ends, np.zeros((2, 2)))


def gaitmap_strides(folder: Path) -> dict[Side, Array]:
    """From when to when each of the annotated strides goes, s, shape (n, 2). Raises DatasetError."""
    file = folder / "stride_events_sample.csv"
    try:
        with file.open(newline="", encoding="utf-8") as stream:
            rows = [(row["foot"], float(row["start"]), float(row["end"])) for row in csv.DictReader(stream)]
    except (OSError, KeyError, ValueError) as error:
        raise DatasetError(f"{file}: {error}") from None
    return {side: np.array([ends for foot, *ends in rows if foot == side]) / GAITMAP_HZ for side in SIDES}


@dataclass(frozen=True, slots=True)
class HeadTrace:
    """A headset's poses in the stage."""

    name: str
    t: Array
    """s, shape (n,)."""
    p: Array
    """m, shape (n, 3)."""
    q: Array
    """Head to stage, shape (n, 4)."""


def quest(file: Path) -> HeadTrace:
    """A headset that walks in place, 72 Hz. Raises DatasetError."""
    try:
        values = json.loads(file.read_text(encoding="utf-8"))
        p = np.array(values["head_position"], dtype=np.float64).reshape(-1, 3)
        pitch, yaw, roll = np.array(values["head_orientation"], dtype=np.float64).reshape(-1, 3).T
        rate = float(values["target_fps"])
    except (OSError, KeyError, ValueError, TypeError) as error:
        raise DatasetError(f"{file}: {error}") from None
    if rate <= 0.0 or len(p) != len(yaw):
        raise DatasetError(f"{file}: no rate, or positions without orientations")
    tilt = rot.multiply(rot.from_axis_angle([1.0, 0.0, 0.0], pitch), rot.from_axis_angle([0.0, 0.0, 1.0], roll))
    return HeadTrace(f"quest {file.stem}", np.arange(len(p)) / rate, p, rot.multiply(rot.from_yaw(yaw), tilt))


def levelled(trial: FootTrial, rest_s: float = 0.5) -> FootTrial:
    """The same with the sensor's tilt on the shoe known from the stand at the start: a standing foot is level."""
    rest = rot.rotate(trial.sensor_to_foot, trial.acc[trial.t < trial.t[0] + rest_s].mean(axis=0))
    up = rest / np.linalg.norm(rest)
    axis = np.cross(up, [0.0, 1.0, 0.0])
    sine = float(np.linalg.norm(axis))
    if sine < 1e-9:
        return trial
    turn = rot.from_axis_angle(axis / sine, np.arctan2(sine, up[1]))
    return replace(trial, sensor_to_foot=rot.multiply(turn, trial.sensor_to_foot))


def messages(trials: list[FootTrial], settings: Settings, start: int = 0) -> Iterator[tuple[int, Message]]:
    """The trials' samples as an IMU producer publishes them, in order of arrival (ns, with ``start`` as zero)."""
    order = sorted(
        (start + round(float(t) * 1e9), trial.side, index, trial) for trial in trials for index, t in enumerate(trial.t)
    )
    counts = {"left": 0, "right": 0}
    for t, side, index, trial in order:
        acc, gyro = trial.acc[index].tolist(), trial.gyro[index].tolist()
        body = Imu(acc=(acc[0], acc[1], acc[2]), gyro=(gyro[0], gyro[1], gyro[2]), t_arr=t)
        yield t, Message(settings.user, f"imu/{side}", f"imu-{side}", "dataset", counts[side], t, t, True, body)
        counts[side] += 1


def settings_with(trials: list[FootTrial], settings: Settings) -> Settings:
    """Settings that know how the trials' sensors sit on the feet."""
    values = settings.model_dump()
    for trial in trials:
        values["feet"][trial.side]["imu"]["q"] = tuple(trial.sensor_to_foot.tolist())
    return Settings(**values)


def aligned_rmse(estimate: Array, truth: Array) -> float:
    """RMS distance of two tracks on the floor, m, after the rigid 2-D motion (no scale) that brings them closest.

    Shapes (n, 2). Kabsch's method.
    """
    a, b = estimate - estimate.mean(axis=0), truth - truth.mean(axis=0)
    u, _, vt = np.linalg.svd(a.T @ b)
    turn = u @ np.diag([1.0, np.linalg.det(u @ vt)]) @ vt
    return float(np.sqrt(np.mean(np.sum((a @ turn - b) ** 2, axis=1))))


def _table(file: Path, header_rows: int) -> tuple[list[tuple[str, ...]], Array]:
    try:
        with file.open(newline="", encoding="utf-8") as stream:
            rows = list(csv.reader(stream))
        values = np.array([[float(cell) for cell in row[1:]] for row in rows[header_rows:]])
    except (OSError, ValueError) as error:
        raise DatasetError(f"{file}: {error}") from None
    return list(zip(*(row[1:] for row in rows[:header_rows]), strict=True)), values


def _columns(header: list[tuple[str, ...]], values: Array, names: list[tuple[str, str]]) -> Array:
    try:
        return values[:, [header.index(name) for name in names]]
    except ValueError as error:
        raise DatasetError(f"a column is missing: {error}") from None
