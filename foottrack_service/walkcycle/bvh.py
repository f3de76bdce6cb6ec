"""BVH out and in: ROOT at OFFSET 0 0 0, Z X Y rotations in degrees, metres, the model frame as it is.

Eight decimals: with two, the text alone would move a foot by half a millimetre.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from foottrack_service import rotations as rot
from foottrack_service.walkcycle.errors import MotionFileError
from foottrack_service.walkcycle.skeleton import JOINTS, PARENTS, Humanoid
from foottrack_service.walkcycle.walk import Motion

Array = npt.NDArray[np.float64]


def format_bvh(body: Humanoid, motion: Motion) -> str:
    """BVH text of a motion with evenly spaced times. Raises ValueError when they are not."""
    gaps = np.diff(motion.times)
    if len(gaps) == 0 or np.ptp(gaps) > 1e-6:
        raise ValueError("a BVH file needs two or more evenly spaced frames")
    lines = ["HIERARCHY"]
    order: list[int] = []
    _write_joint(lines, order, body, 0, 0)
    n = len(motion.times)
    euler = Rotation.from_quat(motion.rotations[:, order].reshape(-1, 4)).as_euler("ZXY", degrees=True)
    # Neighbouring frames without a jump of a full turn: viewers interpolate the numbers.
    angles = np.unwrap(euler.reshape(n, len(order), 3), period=360.0, axis=0)
    rows = np.concatenate([motion.hips, angles.reshape(n, -1)], axis=1)
    lines += ["MOTION", f"Frames: {n}", f"Frame Time: {float(np.mean(gaps)):.10f}"]
    lines += [" ".join(f"{value:.8f}" for value in row) for row in rows]
    return "\n".join(lines) + "\n"


@dataclass(frozen=True)
class BvhFile:
    """What a BVH file holds: joint names, parents (-1 for the root), offsets (j, 3) and the motion, whose rotations
    are (n, j, 4) in the file's order."""

    names: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: Array
    motion: Motion


def parse_bvh(text: str) -> BvhFile:
    """Read a BVH with any order of rotation channels. Raises MotionFileError, which names the line."""
    return _Reader(text).read()


def as_humanoid(file: BvhFile) -> Motion:
    """The motion in the order of our 22 joints. Raises MotionFileError when one is missing."""
    missing = [name for name in JOINTS if name not in file.names]
    if missing:
        raise MotionFileError(f"the file has no joint {missing[0]}")
    order = [file.names.index(name) for name in JOINTS]
    return Motion(file.motion.times, file.motion.hips, file.motion.rotations[:, order])


def _write_joint(lines: list[str], order: list[int], body: Humanoid, joint: int, depth: int) -> None:
    tab = "\t" * depth
    order.append(joint)
    root = joint == 0
    lines += [f"{tab}{'ROOT' if root else 'JOINT'} {JOINTS[joint]}", tab + "{"]
    # A root with both an offset and position channels stands a body height too high in three.js.
    lines.append(f"{tab}\tOFFSET {_offset(np.zeros(3) if root else body.offsets[joint])}")
    place = "6 Xposition Yposition Zposition" if root else "3"
    lines.append(f"{tab}\tCHANNELS {place} Zrotation Xrotation Yrotation")
    children = [child for child, parent in enumerate(PARENTS) if parent == joint]
    for child in children:
        _write_joint(lines, order, body, child, depth + 1)
    if not children:
        tip = body.toe_tip if JOINTS[joint].endswith("Toes") else _tip(JOINTS[joint], body)
        lines += [f"{tab}\tEnd Site", tab + "\t{", f"{tab}\t\tOFFSET {_offset(tip)}", tab + "\t}"]
    lines.append(tab + "}")


def _tip(joint: str, body: Humanoid) -> Array:
    if joint == "head":
        return np.array([0.0, 0.22, 0.0]) * body.scale
    return np.array([0.18 if joint.startswith("left") else -0.18, 0.0, 0.0]) * body.scale


def _offset(values: Array) -> str:
    return " ".join(f"{value:.8f}" for value in values)


class _Reader:
    def __init__(self, text: str) -> None:
        self.rows = [(i, row.split()) for i, row in enumerate(text.splitlines(), start=1) if row.strip()]
        self.at = 0
        self.names: list[str] = []
        self.parents: list[int] = []
        self.offsets: list[list[float]] = []
        self.channels: list[tuple[int, str]] = []

    def read(self) -> BvhFile:
        self.expect("HIERARCHY")
        self.joint(-1, self.take("ROOT", 2)[1])
        self.expect("MOTION")
        count = int(self.number(self.take("Frames:", 2)[1]))
        step = self.number(self.take("Frame", 3)[2])
        if count < 1 or not 0.0 < step < 10.0:
            raise self.wrong("frames and frame time must be above 0")
        values = np.array([self.row() for _ in range(count)])
        hips: Array = np.array(self.offsets[0]) + np.zeros((count, 3))
        rotations: Array = np.tile(rot.IDENTITY, (count, len(self.names), 1))
        for column, (joint, channel) in enumerate(self.channels):
            axis = "XYZ".index(channel[0])
            if channel.endswith("position"):
                if joint == 0:
                    hips[:, axis] = values[:, column]
                continue
            turn = rot.from_axis_angle(np.eye(3)[axis], np.radians(values[:, column]))
            rotations[:, joint] = rot.multiply(rotations[:, joint], turn)
        for joint in range(len(self.names)):
            rotations[:, joint] = rot.continuous(rotations[:, joint])
        times: Array = np.arange(count, dtype=np.float64) * step
        motion = Motion(times, hips, rotations)
        return BvhFile(tuple(self.names), tuple(self.parents), np.array(self.offsets), motion)

    def joint(self, parent: int, name: str) -> None:
        index = len(self.names)
        self.names.append(name)
        self.parents.append(parent)
        self.expect("{")
        self.offsets.append([self.number(word) for word in self.take("OFFSET", 4)[1:4]])
        channels = self.take("CHANNELS", 2)[2:]
        if any(c[1:] not in ("position", "rotation") or c[0] not in "XYZ" for c in channels):
            raise self.wrong(f"joint {name}: unknown channel")
        self.channels += [(index, channel) for channel in channels]
        while True:
            words = self.next()
            if words == ["}"]:
                return
            if words[0] == "JOINT" and len(words) == 2:
                self.joint(index, words[1])
            elif words[0] == "End":
                self.expect("{")
                self.take("OFFSET", 4)
                self.expect("}")
            else:
                raise self.wrong(f"joint {name}: expected JOINT, End Site or }}")

    def next(self) -> list[str]:
        if self.at >= len(self.rows):
            raise MotionFileError("BVH: the file ends too early")
        self.at += 1
        return self.rows[self.at - 1][1]

    def take(self, keyword: str, least: int) -> list[str]:
        words = self.next()
        if words[0] != keyword or len(words) < least:
            raise self.wrong(f"expected {keyword}")
        return words

    def expect(self, word: str) -> None:
        self.take(word, 1)

    def row(self) -> list[float]:
        words = self.next()
        if len(words) != len(self.channels):
            raise self.wrong(f"{len(words)} values, and the joints have {len(self.channels)} channels")
        return [self.number(word) for word in words]

    def number(self, word: str) -> float:
        try:
            value = float(word)
        except ValueError:
            raise self.wrong(f"{word!r} is not a number") from None
        if not np.isfinite(value):
            raise self.wrong(f"{word!r} is not a finite number")
        return value

    def wrong(self, message: str) -> MotionFileError:
        return MotionFileError(f"BVH line {self.rows[self.at - 1][0]}: {message}")
