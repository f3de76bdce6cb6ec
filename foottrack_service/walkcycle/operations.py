"""What a person does to a project. Every operation takes a value and gives a new one, and so is its undo."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from foottrack_service.walkcycle.cycle import Cycle, build_cycle
from foottrack_service.walkcycle.errors import ProjectError
from foottrack_service.walkcycle.inplace import in_place_targets
from foottrack_service.walkcycle.posing import quaternion
from foottrack_service.walkcycle.project import FootPose, Key, Pose, Project
from foottrack_service.walkcycle.skeleton import INDEX, LEG_JOINTS, POSED_JOINTS, SIDES, mirrored_name


@dataclass(frozen=True)
class History:
    """A project and the ones before and after it."""

    present: Project
    past: tuple[Project, ...] = ()
    future: tuple[Project, ...] = ()

    def done(self, project: Project) -> History:
        """With `project` as the present; what was undone before is forgotten."""
        return History(project, (*self.past, self.present))

    def undone(self) -> History:
        """One step back, or itself at the beginning."""
        return History(self.past[-1], self.past[:-1], (self.present, *self.future)) if self.past else self

    def redone(self) -> History:
        """One step forward again, or itself at the end."""
        return History(self.future[0], (*self.past, self.present), self.future[1:]) if self.future else self


def copy_pose(project: Project, source: str, target: str) -> Project:
    """The pose called `source` also at the key called `target`. Raises ProjectError for unknown names."""
    pose = project.key(source).pose
    project.key(target)
    return project.model_copy(
        update={"keys": tuple(k if k.name != target else k.model_copy(update={"pose": pose}) for k in project.keys)}
    )


def insert_pose(project: Project, name: str, phase: float, pose: Pose | None = None) -> Project:
    """An in-between at a phase: `pose`, or what the cycle shows there. Raises ProjectError."""
    if any(key.name == name for key in project.keys):
        raise ProjectError(f"a pose is called {name!r} already")
    pose = pose or sampled_poses(build_cycle(project), [phase])[0]
    keys = sorted((*project.keys, Key(name=name, phase=phase, pose=pose)), key=lambda key: key.phase)
    return Project.model_validate({**project.model_dump(), "keys": [key.model_dump() for key in keys]})


def shift(project: Project, joints: Iterable[str], phase: float) -> Project:
    """The keys of these joints (and, in a symmetric walk, of their mirror images) later by `phase` cycles, on top of
    earlier shifts. Raises ProjectError for joints that carry the contacts."""
    offsets = dict(project.offsets)
    for joint in joints:
        if joint not in INDEX or joint in LEG_JOINTS or joint == "hips":
            raise ProjectError(f"{joint!r} cannot be shifted; {', '.join(n for n in POSED_JOINTS if n != 'hips')} can")
        for name in {joint, mirrored_name(joint)} if project.symmetric else {joint}:
            value = offsets.get(name, 0.0) + phase
            offsets[name] = float(np.fmod(value, 1.0))
    return project.model_copy(update={"offsets": {n: v for n, v in sorted(offsets.items()) if v != 0.0}})


def shift_chain(project: Project, joints: Iterable[str], phase: float) -> Project:
    """Each joint of an ordered chain (clavicle, shoulder, elbow) later than the one before it by `phase` cycles: the
    drag that makes an arm a whip."""
    for links, joint in enumerate(joints):
        project = shift(project, [joint], links * phase)
    return project


def bake(project: Project, frames: int) -> Project:
    """The cycle written out as one key per frame, with shifts and the closing of the legs in the poses.

    Raises ProjectError for fewer than four frames.
    """
    if not 4 <= frames <= 500:
        raise ProjectError(f"a cycle can be baked to 4 to 500 frames, not {frames}")
    phases = [frame / frames for frame in range(frames)]
    poses = sampled_poses(build_cycle(project), phases)
    keys = tuple(
        Key(name=f"frame-{i}", phase=p, pose=pose) for i, (p, pose) in enumerate(zip(phases, poses, strict=True))
    )
    return project.model_copy(update={"keys": keys, "symmetric": False, "offsets": {}})


def sampled_poses(cycle: Cycle, phases: list[float]) -> list[Pose]:
    """What the cycle shows at phases, as poses in the root frame."""
    targets = in_place_targets(cycle, np.array(phases))
    poses = []
    for i in range(len(phases)):
        feet = {}
        for side in SIDES:
            foot = targets.feet[side]
            x, y, z = (float(v) for v in foot.ankle[i])
            pitch, toe = float(foot.pitch[i]), float(foot.toes_pitch[i] - foot.pitch[i])
            feet[side] = FootPose(ankle=(x, y, z), pitch=pitch, yaw=float(foot.yaw[i]), toe=toe)
        hx, hy, hz = (float(v) for v in targets.hips[i])
        rotations = {name: quaternion(targets.joints[name][i]) for name in POSED_JOINTS}
        poses.append(Pose(hips=(hx, hy, hz), rotations=rotations, left=feet["left"], right=feet["right"]))
    return poses
