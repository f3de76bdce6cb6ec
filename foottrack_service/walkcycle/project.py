"""A walk as a person poses it: one JSON file, forgiving to read, exact to write.

Units are metres, seconds and radians; quaternions are [x, y, z, w]. A pose lives in the *root* frame: its
origin is on the floor and travels along the path at the walk's mean speed, +Z forward, +Y up, +X to the left.
The spine and the arms are posed by joint rotations, the feet by where they are (inverse kinematics).
"""

from __future__ import annotations

import json
from typing import Annotated, Any, Final, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from foottrack_service.walkcycle.errors import ProjectError
from foottrack_service.walkcycle.skeleton import INDEX, LEG_JOINTS, POSED_JOINTS, REST_HEIGHT_M, mirrored_name

FORMAT: Final = "foottrack-walk"


def _unit(q: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    norm = float(np.linalg.norm(q))
    if norm < 1e-6:
        raise ValueError("a quaternion must not be zero")
    # Left as it is when it is unit already, so that reading what was written changes nothing.
    if abs(norm - 1.0) <= 1e-9:
        return q
    x, y, z, w = (float(value) / norm for value in q)
    return (x, y, z, w)


Finite = Annotated[float, Field(allow_inf_nan=False)]
Vector = tuple[Finite, Finite, Finite]
Quaternion = Annotated[tuple[Finite, Finite, Finite, Finite], AfterValidator(_unit)]
Angle = Annotated[float, Field(ge=-np.pi, le=np.pi, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0.0, le=1.0, allow_inf_nan=False)]


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore")


class FootPose(_Model):
    """Where one foot is: `ankle` m, `pitch` rad (toes up positive), `yaw` rad (to the left positive), `toe` rad
    (the toes against the foot, up positive). Toes are required."""

    ankle: Vector
    pitch: Angle = 0.0
    yaw: Angle = 0.0
    toe: Angle


class Pose(_Model):
    """One pose: the pelvis' place (m), rotations of the posed joints (joint to parent, absent ones at rest),
    and the feet."""

    hips: Vector
    rotations: dict[str, Quaternion] = {}
    left: FootPose
    right: FootPose

    @model_validator(mode="after")
    def _names(self) -> Pose:
        for name in self.rotations:
            if name in LEG_JOINTS:
                raise ValueError(f"rotations: {name} follows from the foot's place and cannot be given")
            if name not in INDEX:
                raise ValueError(f"rotations: {name!r} is no joint; joints are {', '.join(POSED_JOINTS)}")
        return self


class Key(_Model):
    """A pose at a phase of the cycle; 0 is the left foot's contact."""

    name: str
    phase: Annotated[float, Field(ge=0.0, lt=1.0)]
    pose: Pose


class ContactTiming(_Model):
    """When a foot rolls, as shares of the cycle since its own strike: strike to `flat` over the heel (or over
    the ball, when it strikes with the toes down), flat to `heel_off`, then over the ball to `toe_off`."""

    flat: Share = 0.10
    heel_off: Share = 0.35
    toe_off: Share = 0.60

    @model_validator(mode="after")
    def _order(self) -> ContactTiming:
        if not 0.02 <= self.flat < self.heel_off < self.toe_off - 0.02 <= 0.93:
            raise ValueError("contact needs 0.02 <= flat < heel_off < toe_off <= 0.95 (shares of the cycle)")
        return self


class Project(_Model):
    """Everything a walk is made of. With `symmetric` the keys cover the first step, phases in [0, 0.5), and the
    second is their mirror image; `offsets` shift single joints in phase (positive is later)."""

    format: Literal["foottrack-walk"] = FORMAT
    version: Literal[1] = 1
    name: str = "walk"
    height: Annotated[float, Field(ge=0.3, le=3.0)] = REST_HEIGHT_M
    period: Annotated[float, Field(ge=0.2, le=20.0)] = 1.0
    contact: ContactTiming = ContactTiming()
    symmetric: bool = True
    keys: tuple[Key, ...]
    offsets: dict[str, Annotated[float, Field(gt=-1.0, lt=1.0)]] = {}

    @model_validator(mode="after")
    def _cycle(self) -> Project:
        phases = sorted(key.phase for key in self.keys)
        span = 0.5 if self.symmetric else 1.0
        if len(phases) < 3:
            raise ValueError("keys: a cycle needs at least three poses")
        if phases[0] != 0.0:
            raise ValueError("keys: the contact pose at phase 0 is missing")
        if phases[-1] >= span:
            raise ValueError(
                f"keys: phase {phases[-1]} is not below {span} ({'' if self.symmetric else 'not '}symmetric)"
            )
        if any(b - a < 1e-3 for a, b in zip(phases, [*phases[1:], span], strict=True)):
            raise ValueError("keys: two poses are less than 0.001 of a cycle apart")
        for name in self.offsets:
            if name not in INDEX or name in LEG_JOINTS or name == "hips":
                raise ValueError(f"offsets: {name!r} cannot be shifted (feet and hips carry the contacts)")
        return self

    def key(self, name: str) -> Key:
        """The key of that name. Raises ProjectError."""
        for key in self.keys:
            if key.name == name:
                return key
        raise ProjectError(f"no pose is called {name!r}; there are {', '.join(key.name for key in self.keys)}")


def mirrored(pose: Pose) -> Pose:
    """The mirror image: x of places and y, z of rotations negated, sides swapped."""

    def foot(f: FootPose) -> FootPose:
        return FootPose(ankle=(-f.ankle[0], f.ankle[1], f.ankle[2]), pitch=f.pitch, yaw=-f.yaw, toe=f.toe)

    return Pose(
        hips=(-pose.hips[0], pose.hips[1], pose.hips[2]),
        rotations={mirrored_name(n): (q[0], -q[1], -q[2], q[3]) for n, q in pose.rotations.items()},
        left=foot(pose.right),
        right=foot(pose.left),
    )


def full_cycle(project: Project) -> Project:
    """Both steps written out: the second contact and the second step by mirroring."""
    if not project.symmetric:
        return project
    keys = sorted(project.keys, key=lambda key: key.phase)
    second = [Key(name=f"{k.name}-2", phase=k.phase + 0.5, pose=mirrored(k.pose)) for k in keys]
    return project.model_copy(update={"symmetric": False, "keys": (*keys, *second)})


def parse_project(text: str) -> Project:
    """A project from JSON text. Unknown entries are ignored, poses may come in any order, quaternions need not be
    unit. Raises ProjectError, which names the place."""
    try:
        data = json.loads(text.lstrip("\ufeff"), parse_constant=_refuse)
    except ValueError as error:
        raise ProjectError(f"not a JSON file: {error}") from None
    if not isinstance(data, dict) or data.get("format", FORMAT) != FORMAT:
        raise ProjectError(f'not a walk project: "format" must be "{FORMAT}"')
    try:
        return Project.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        raise ProjectError(f"{_place(data, first['loc'])}: {first['msg'].removeprefix('Value error, ')}") from None


def format_project(project: Project) -> str:
    """JSON text that `parse_project` reads back to the same value, to the last bit."""
    return json.dumps(project.model_dump(mode="json"), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _refuse(constant: str) -> Any:
    raise ValueError(f"{constant} is no number")


def _place(data: Any, location: tuple[int | str, ...]) -> str:
    """The location with the poses' own names beside their numbers."""
    parts: list[str] = []
    for step in location:
        try:
            data = data[step]
        except (KeyError, IndexError, TypeError):
            data = None
        named = isinstance(step, int) and isinstance(data, dict) and isinstance(data.get("name"), str)
        parts.append(f"{step} ({data['name']})" if named else str(step))
    return ".".join(parts) or "project"
