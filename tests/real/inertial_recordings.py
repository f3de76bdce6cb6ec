"""Real foot IMU recordings in the project's axes (+Y up), and our filter over them: one configuration for all."""

from __future__ import annotations

import csv
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from foottrack_service import rotations as rot
from foottrack_service.config import FootSettings, Placement
from foottrack_service.fusion.foot_filter_events import ZERO_SIGMA
from foottrack_service.fusion.foot_filter_inertial import InertialFilter
from foottrack_service.fusion.interface import ImuSample
from foottrack_service.rotations import Array

DATA = Path(os.environ.get("FOOTTRACK_DATA", Path(__file__).parents[3] / "shared" / "data"))
Z_UP = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])
Z_DOWN = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
"""Their axes (x to the toes) to ours (-Z to the toes), both proper rotations.

The mirror of a z-down map is left to the comparison."""


@dataclass(frozen=True)
class Track:
    """What the filter made of a recording, n samples."""

    p: Array
    """(n, 3) m."""
    standing: Array
    """(n,) whether zero velocity was used."""


def tracked(t: Array, acc: Array, gyro: Array) -> Track:
    """Run the filter over t (s), specific force (m/s^2) and rate (rad/s), both (n, 3) with +Y roughly up.

    The sensor's tilt on the shoe is taken from the first 0.2 s of standing, as its calibration by use does.
    """
    still = acc[t < t[0] + 0.2].mean(axis=0)
    axis = np.cross(still, [0.0, 1.0, 0.0])
    sine = float(np.linalg.norm(axis))
    q = rot.from_rotation_vector(axis / sine * np.arctan2(sine, still[1]))
    x, y, z, w = q.tolist()
    filter_ = InertialFilter(FootSettings(imu=Placement(q=(x, y, z, w))), "left", floor=True)
    p, standing = np.empty((len(t), 3)), np.empty(len(t), dtype=bool)
    for i, stamp in enumerate(np.rint(t * 1e9).astype(int).tolist()):
        filter_.on_imu(ImuSample(stamp, acc[i], gyro[i], None))
        p[i] = filter_.state[0][:3]
        standing[i] = filter_.last_row[ZERO_SIGMA] > 0.0
    return Track(p, standing)


def vicon_rmse(file: Path) -> float:
    """RMSE in the plane, m, after rigid alignment with the motion capture."""
    data = np.load(file)
    track = tracked(data["t"], data["acc"].astype(float) @ Z_DOWN.T, data["gyr"].astype(float) @ Z_DOWN.T)
    truth = data["vicon_xy"].astype(float)
    # Seen from above, their y is to the right of x, as our z is.
    return float(np.sqrt(np.mean(np.sum((aligned(track.p[:, [0, 2]], truth) - truth) ** 2, axis=1))))


def aligned(a: Array, b: Array) -> Array:
    """a (n, 2), turned and moved (not mirrored, not scaled) to fit b best (Kabsch)."""
    centre_a, centre_b = a.mean(axis=0), b.mean(axis=0)
    u, _, vt = np.linalg.svd((a - centre_a).T @ (b - centre_b))
    turn = u @ np.diag([1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return (a - centre_a) @ turn + centre_b


def xio_end_error(name: str) -> tuple[float, float]:
    """End error in the plane and in height, m, of a walk that ends where it began."""
    data = np.genfromtxt(DATA / "xio_gait" / f"{name}.csv", delimiter=",", skip_header=1)
    track = tracked(data[:, 0], 9.80665 * data[:, 4:7] @ Z_UP.T, np.deg2rad(data[:, 1:4]) @ Z_UP.T)
    end = track.p[-1] - track.p[0]
    return float(np.hypot(end[0], end[2])), float(end[1])


def gaitmap_strides(side: str) -> tuple[Array, Array]:
    """Per annotated stride: length error against the mocap heel, m, and whether a stance was found at both its ends."""
    folder = DATA / "gaitmap"
    imu = np.genfromtxt(folder / "imu_sample.csv", delimiter=",", skip_header=3)
    first = 1 if side == "left" else 2
    acc, gyro = imu[:, [first, first + 2, first + 4]], np.deg2rad(imu[:, [first + 6, first + 8, first + 10]])
    track = tracked(np.arange(len(imu)) / 204.8, acc @ Z_UP.T, gyro @ Z_UP.T)
    heel = mocap_heel(folder / "mocap_sample.csv", side)
    errors, found = [], []
    with (folder / "stride_events_sample.csv").open() as file:
        strides = [row for row in csv.DictReader(file) if row["foot"] == side]
    for row in strides:
        ends = [round(float(row[key])) for key in ("start", "end")]
        true = np.diff([[np.interp(i / 2.048, np.arange(len(heel)), heel[:, k]) for k in (0, 1)] for i in ends], axis=0)
        ours = track.p[ends[1]] - track.p[ends[0]]
        errors.append(np.hypot(ours[0], ours[2]) - np.linalg.norm(true))
        found.append(all(track.standing[max(0, i - 20) : i + 20].any() for i in ends))
    return np.array(errors), np.array(found)


def mocap_heel(file: Path, side: str) -> Array:
    """(n, 3) m at 100 Hz, z up."""
    with file.open() as lines:
        names = next(csv.reader(lines))
    columns = [i for i, name in enumerate(names) if name == ("L_FCC" if side == "left" else "R_FCC")]
    data: Array = np.genfromtxt(file, delimiter=",", skip_header=2)[:, columns] / 1000.0
    return data
