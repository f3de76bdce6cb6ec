"""Tasks of a person who wears the sensors. Every function: (seconds, settings, feet, random) to Truth.

Who walks somewhere walks as the walk cycle does (`bouts`); single steps, turns on the spot and walking in place are
planned here step by step.
"""

from __future__ import annotations

import math

import numpy as np

from foottrack_protocol.messages import Side
from foottrack_service.config import Settings
from foottrack_service.simulation import footwear
from foottrack_service.simulation.anatomy import person, sole
from foottrack_service.simulation.bouts import FREE, STANCE_WIDTH, Pace
from foottrack_service.simulation.easing import there_and_back
from foottrack_service.simulation.footsteps import Place, stepping
from foottrack_service.simulation.footwear import Feet
from foottrack_service.simulation.posture import Bearing, Extra, carried
from foottrack_service.simulation.stride import CAUTIOUS, IN_PLACE, Planner
from foottrack_service.simulation.truth import FootTrack, Truth, grid
from foottrack_service.walkcycle import path as paths

_LINE_PACE, _CIRCLE_PACE = Pace(0.50, 0.8, STANCE_WIDTH), Pace(0.45, 0.8, STANCE_WIDTH)
"""In a room, with a headset on."""
_S_BEND = 0.25
"""Width of the S over its length: turns of about 40 deg to either side."""


def head_moving(seconds: float, settings: Settings, feet: Feet, random: np.random.Generator) -> Truth:
    """Feet still, the head turns, nods, tilts and shifts."""
    bearing = Bearing(gaze_sd=math.radians(8.0), gaze_band_hz=0.6, sway_sd=0.03, sway_band_hz=0.5)
    return scene(seconds, settings, feet, random, Planner(random), bearing)


def steps(seconds: float, settings: Settings, feet: Feet, random: np.random.Generator) -> Truth:
    """One step forward and back."""
    return _pairs(seconds, settings, feet, random, [(0.5, 0.0), (-0.5, 0.0)])


def side_steps(seconds: float, settings: Settings, feet: Feet, random: np.random.Generator) -> Truth:
    """One step to the right and back, one to the left and back."""
    return _pairs(seconds, settings, feet, random, [(0.0, 0.35), (0.0, -0.35), (0.0, -0.35), (0.0, 0.35)])


def line(seconds: float, settings: Settings, feet: Feet, random: np.random.Generator) -> Truth:
    """2 m ahead, a turn, and back."""
    plan = Planner(random)
    while plan.now < seconds - 6.0:
        plan.walk(paths.line(2.0), _LINE_PACE, settings)
        plan.stand(0.6)
        plan.turn(math.pi, CAUTIOUS, 0.8)
        plan.stand(0.8)
    return scene(seconds, settings, feet, random, plan, Bearing())


def circle(seconds: float, settings: Settings, feet: Feet, random: np.random.Generator) -> Truth:
    """Round a circle of 2 m diameter to the left, then to the right."""
    plan = Planner(random)
    direction = 1.0
    while plan.now < seconds - 3.0:
        angle = min(2.0 * math.pi, 0.45 * (seconds - plan.now - 2.0) / 0.8)
        plan.walk(paths.circle(1.0, direction * math.degrees(angle)), _CIRCLE_PACE, settings)
        plan.stand(1.0)
        direction = -direction
    return scene(seconds, settings, feet, random, plan, Bearing())


def knee_bends(seconds: float, settings: Settings, feet: Feet, random: np.random.Generator) -> Truth:
    """Down by 12 to 28 cm and up again every 3 s."""
    t = grid(seconds)
    crouch = np.zeros_like(t)
    start = 1.5
    while start + 3.0 < seconds:
        crouch += random.uniform(0.12, 0.28) * there_and_back(t, start, start + 3.0)
        start += 3.0 + random.uniform(0.1, 0.6)
    # Feet apart and turned out; hips back and trunk forward in balance, so the knees do not pass the toes.
    out = math.radians(10.0)
    plan = Planner(random, feet={"left": Place(-0.16, 0.0, out), "right": Place(0.16, 0.0, -out)})
    squat = Extra(crouch=crouch, back=0.9 * crouch, lean=1.3 * crouch)
    return scene(seconds, settings, feet, random, plan, Bearing(), squat)


def upper_body(seconds: float, settings: Settings, feet: Feet, random: np.random.Generator) -> Truth:
    """Turns by 35 to 60 deg to either side, bending forward a little."""
    t = grid(seconds)
    yaw, lean = np.zeros_like(t), np.zeros_like(t)
    start, direction = 1.5, 1.0
    while start + 3.0 < seconds:
        bump = there_and_back(t, start, start + 3.0)
        yaw += direction * math.radians(random.uniform(35.0, 60.0)) * bump
        lean += random.uniform(0.03, 0.1) * bump
        start, direction = start + 3.0 + random.uniform(0.1, 0.5), -direction
    return scene(seconds, settings, feet, random, Planner(random), Bearing(), Extra(lean=lean, yaw=yaw))


def walk_in_place(seconds: float, settings: Settings, feet: Feet, random: np.random.Generator) -> Truth:
    """Bouts of 8 to 16 steps at 1.5 to 1.9 steps/s, with pauses of 1.5 to 2.5 s."""
    plan = Planner(random)
    side: Side = "left"
    while plan.now < seconds - 3.0:
        interval = 1.0 / random.uniform(1.5, 1.9)
        for _ in range(int(random.integers(8, 17))):
            if plan.now > seconds - 1.5:
                break
            home = plan.start[side]
            plan.step(side, home, IN_PLACE, interval)
            side = "right" if side == "left" else "left"
        plan.stand(random.uniform(1.5, 2.5))
    return scene(seconds, settings, feet, random, plan, Bearing())


def walk(seconds: float, settings: Settings, feet: Feet, random: np.random.Generator) -> Truth:
    """8 m at a stride of 1.40 m in 1.10 s (means of Schwartz 2008), a stop, a turn, and back."""
    plan = Planner(random)
    while plan.now < seconds - 5.0:
        distance = min(8.0, 0.7 * max(2.0, round((seconds - plan.now - 2.0) / 0.55)))
        plan.walk(paths.line(distance), FREE, settings)
        plan.stand(0.8)
        if plan.now < seconds - 6.0:
            plan.turn(math.pi, CAUTIOUS, 0.8)
            plan.stand(0.8)
    return scene(seconds, settings, feet, random, plan, Bearing())


def s_walk(seconds: float, settings: Settings, feet: Feet, random: np.random.Generator) -> Truth:
    """A normal walk along an S, from standing to standing."""
    plan = Planner(random)
    length = max(4.0, 1.5 * seconds)
    plan.walk(paths.s_curve(length, _S_BEND * length), FREE, settings, max(seconds - 2.0, 3.0))
    return scene(seconds, settings, feet, random, plan, Bearing())


def scene(
    seconds: float,
    settings: Settings,
    feet: Feet,
    random: np.random.Generator,
    plan: Planner,
    bearing: Bearing,
    extra: Extra = Extra(),  # noqa: B008 - frozen
) -> Truth:
    """What comes of a plan of steps: both feet, and the head and hips that they carry."""
    t = grid(seconds)
    samples = {
        side: stepping(t, plan.start[side], plan.steps[side], sole(settings.feet.of(side))) for side in plan.start
    }
    wearer = person(settings.body, settings.feet.left.ankle_height)
    head, hips = carried(samples["left"], samples["right"], wearer, bearing, extra, random, plan.bouts)
    tracks: dict[Side, FootTrack] = {
        side: footwear.track(foot, sole(settings.feet.of(side)), feet, random) for side, foot in samples.items()
    }
    return Truth(seconds, head, tracks, hips)


def _pairs(
    seconds: float, settings: Settings, feet: Feet, random: np.random.Generator, moves: list[tuple[float, float]]
) -> Truth:
    """Steps after which the other foot follows; `moves` are (forward, right) m, over and over."""
    plan = Planner(random)
    index = 0
    while plan.now < seconds - 4.0:
        forward, right = moves[index % len(moves)]
        first: Side = "left" if right < 0.0 or (right == 0.0 and index % 4 < 2) else "right"
        second: Side = "right" if first == "left" else "left"
        target = {side: place.ahead(forward, right) for side, place in plan.feet.items()}
        plan.step(first, target[first], CAUTIOUS, 0.8)
        plan.step(second, target[second], CAUTIOUS, 0.8)
        plan.stand(random.uniform(0.5, 1.0))
        index += 1
    return scene(seconds, settings, feet, random, plan, Bearing())
