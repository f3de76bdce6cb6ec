"""A walk on the wire: the one place that turns the model frame (+Z ahead) into the stage's (-Z ahead).

`body_track` gives ground truth at any instants, which a simulation can take its walker from; `wire_instants` and
`wire_events` give the bodies of the streams that a tracked person would cause.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from foottrack_protocol.messages import (
    BodyPose,
    FootGait,
    FootPose,
    GaitEvent,
    GaitState,
    IkFoot,
    IkTargets,
    Phase,
    Pose,
)
from foottrack_service import rotations as rot
from foottrack_service.walkcycle.events import swings, walk_events
from foottrack_service.walkcycle.skeleton import INDEX, SIDES, forward_kinematics
from foottrack_service.walkcycle.standing import standing_pose
from foottrack_service.walkcycle.walk import Walk

Array = npt.NDArray[np.float64]

HINT_AHEAD_M = 0.29
"""How far the avatar's knee hints lie before the knees."""
_MOMENT_S = 5e-4


@dataclass(frozen=True)
class FootTrack:
    """One leg over time, stage frame: `hip`, `knee`, `ankle`, `heel`, `ball`, `toe` (n, 3) m, `rotation` (n, 4) foot
    to stage, `contact` (n,)."""

    hip: Array
    knee: Array
    ankle: Array
    rotation: Array
    heel: Array
    ball: Array
    toe: Array
    contact: npt.NDArray[np.bool_]


@dataclass(frozen=True)
class BodyTrack:
    """A walking body over time, stage frame: `head` is the eyes' middle, as a headset's view frame is; `hips` the
    pelvis. Places (n, 3) m, rotations (n, 4)."""

    times: Array
    head: Array
    head_rotation: Array
    hips: Array
    hips_rotation: Array
    feet: dict[str, FootTrack]


def stage_place(places: npt.ArrayLike) -> Array:
    """Model to stage: half a turn about +Y, (..., 3). Its own inverse."""
    return np.asarray(np.multiply(places, [-1.0, 1.0, -1.0]))


def stage_rotation(q: npt.ArrayLike) -> Array:
    """The same for rotations (..., 4) of bodies whose own axes turn with it: ahead is -Z afterwards."""
    return np.asarray(np.multiply(q, [-1.0, 1.0, -1.0, 1.0]))


def body_track(walk: Walk, times: npt.ArrayLike) -> BodyTrack:
    """Head, pelvis and feet at instants (n,) s of the walk (before 0 and after its end: standing)."""
    times = np.atleast_1d(np.asarray(times, dtype=np.float64))
    body, motion = walk.body, walk.motion(times)
    places, world = forward_kinematics(body.offsets, motion.hips, motion.rotations)
    eyes = places[:, INDEX["head"]] + rot.rotate(world[:, INDEX["head"]], body.eyes)
    feet = {}
    phase = walk.clock.phase(times)
    for side in SIDES:
        foot, toes = INDEX[f"{side}Foot"], INDEX[f"{side}Toes"]
        standing = np.zeros(len(times), dtype=bool)
        for p in walk.plan.footprints[side]:
            standing |= (phase >= p.strike) & (phase <= p.toe_off)
        feet[side] = FootTrack(
            hip=stage_place(places[:, INDEX[f"{side}UpperLeg"]]),
            knee=stage_place(places[:, INDEX[f"{side}LowerLeg"]]),
            ankle=stage_place(places[:, foot]),
            rotation=stage_rotation(world[:, foot]),
            heel=stage_place(places[:, foot] + rot.rotate(world[:, foot], body.heel)),
            ball=stage_place(places[:, toes]),
            toe=stage_place(places[:, toes] + rot.rotate(world[:, toes], body.toe_tip)),
            contact=standing,
        )
    return BodyTrack(
        times,
        stage_place(eyes),
        stage_rotation(world[:, INDEX["head"]]),
        stage_place(places[:, 0]),
        stage_rotation(world[:, 0]),
        feet,
    )


@dataclass(frozen=True)
class Instant:
    """One instant, `time` s, as the wire's bodies."""

    time: float
    pose: BodyPose
    ik: IkTargets
    gait: GaitState


def wire_instants(walk: Walk, times: npt.ArrayLike) -> Iterator[Instant]:
    """Bodies of `pose/body`, `pose/ik` and `gait/state` at instants (n,) s of the walk."""
    times = np.atleast_1d(np.asarray(times, dtype=np.float64))
    track = body_track(walk, times)
    velocity = _ankle_velocity(walk, times)
    heading, speed = walk.ground(times)
    rate = 2.0 * walk.clock.rate(times)
    strikes = np.array([e.time for e in walk_events(walk) if e.kind == "foot_strike"])
    stand = float(standing_pose(walk.body)[0][1])
    turn = rot.from_yaw(heading)
    found = swings(walk)
    for i, time in enumerate(times):
        feet, targets, gaits = {}, {}, {}
        for side in SIDES:
            foot, v = track.feet[side], velocity[side][i]
            feet[side] = FootPose(
                hip=_tuple3(foot.hip[i]),
                knee=_tuple3(foot.knee[i]),
                ankle=_pose(foot.ankle[i], foot.rotation[i]),
                toe=_tuple3(foot.toe[i]),
                v=_tuple3(v),
                contact=bool(foot.contact[i]),
                stage="marker",
                sigma=0.0,
                age=0.0,
            )
            under = track.hips[i] * np.array([1.0, 0.0, 1.0])
            ankle, knee = rot.unrotate(turn[i], foot.ankle[i] - under), rot.unrotate(turn[i], foot.knee[i] - under)
            q = rot.multiply(rot.conjugate(turn[i]), foot.rotation[i])
            hint = knee + np.array([0.0, 0.0, -HINT_AHEAD_M])
            targets[side] = IkFoot(p=_tuple3(ankle), q=_tuple4(q), hint=_tuple3(hint))
            phase: Phase = "stance"
            for swing in found:
                if swing.side == side and swing.toe_off < time < swing.strike:
                    phase = swing.phase(float(time))
            height = float(foot.ankle[i, 1]) - walk.body.ankle_height
            gaits[side] = FootGait(phase=phase, height=height, vy=float(v[1]))
        walking = bool(rate[i] > 1e-6)
        ahead = rot.rotate(turn[i], [0.0, 0.0, -1.0])
        yield Instant(
            time=float(time),
            pose=BodyPose(
                head=_pose(track.head[i], track.head_rotation[i]),
                hips=_pose(track.hips[i], track.hips_rotation[i]),
                left=feet["left"],
                right=feet["right"],
            ),
            ik=IkTargets(
                mode="walk" if walking else "stand",
                left=targets["left"],
                right=targets["right"],
                pelvis_dy=min(0.0, float(track.hips[i, 1]) - stand),
                speed=float(speed[i]),
                heading=_tuple3(ahead),
            ),
            gait=GaitState(
                left=gaits["left"],
                right=gaits["right"],
                cadence=float(rate[i]),
                speed=float(speed[i]),
                steps=int(np.searchsorted(strikes, time, side="right")),
            ),
        )


def wire_events(walk: Walk) -> list[tuple[float, GaitEvent]]:
    """Bodies of `gait/event` with their instants, s."""
    return [
        (event.time, GaitEvent.model_validate({"side": event.side, "event": event.kind, "step": event.step}))
        for event in walk_events(walk)
    ]


def _ankle_velocity(walk: Walk, times: Array) -> dict[str, Array]:
    ahead, behind = np.minimum(times + _MOMENT_S, walk.duration), np.maximum(times - _MOMENT_S, 0.0)
    later, sooner = walk.targets(ahead).feet, walk.targets(behind).feet
    apart = np.maximum(ahead - behind, _MOMENT_S)[:, None]
    return {side: stage_place((later[side].ankle - sooner[side].ankle) / apart) for side in SIDES}


def _tuple3(values: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return (x, y, z)


def _tuple4(values: Array) -> tuple[float, float, float, float]:
    x, y, z, w = (float(value) for value in values)
    return (x, y, z, w)


def _pose(p: Array, q: Array) -> Pose:
    return Pose(p=_tuple3(p), q=_tuple4(q))
