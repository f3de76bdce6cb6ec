"""An IMU on a shoe: what it feels, what it says, when that arrives."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_service import rotations
from foottrack_service.config import Placement
from foottrack_service.rotations import Array
from foottrack_service.simulation import noise
from foottrack_service.simulation.truth import Track

ImuKind = Literal["fused", "raw", "bno08x"]
"""What a simulated device sends beside the specific force: its own attitude, a gyro's rate, or both."""

_INNER_HZ = 1600.0  # BMI270 data sheet: highest rate of the accelerometer; lower rates are averages of it


@dataclass(frozen=True)
class ImuModel:
    """One make of IMU. Angles in rad; `sd` of what is drawn once a run is per axis."""

    acc_range: float
    """m/s^2, clips."""
    acc_density: float
    """White noise, m/s^2/sqrt(Hz), one-sided."""
    acc_bias_sd: float
    """m/s^2."""
    acc_instability: float
    """m/s^2, wandering of the bias over minutes."""
    acc_step: float
    """Quantisation, m/s^2."""
    gyro_range: float
    gyro_density: float
    """rad/s/sqrt(Hz), one-sided."""
    gyro_bias_sd: float
    gyro_instability: float
    gyro_step: float
    gyro_scale_sd: float = 0.0
    q_step: float = 0.0
    tilt_still_sd: float = 0.0
    """Slow error of the device's own attitude beside what the accelerometer's bias does to it."""
    tilt_moving_sd: float = 0.0
    """What motion adds to it."""
    yaw_drift: float = 0.0
    """rad/s, SD over devices."""


FUSED = ImuModel(
    # BNO080/085 data sheet (1000-3927), 6.6 and figure 6-12: +-8 g, +-2000 deg/s; accelerometer 0.3 m/s^2 in all
    # (three axes: 0.17 each); game rotation vector: tilt 1.5 deg at rest, 2.5 deg moving, heading 0.5 deg/min.
    # At rest the device puts its own accelerometer upright, so 0.15 m/s^2 of bias are 0.9 deg per axis of the tilt and
    # the rest of 1.5 deg (both axes) is 0.6 per axis; 2.5 deg in motion leave 1.4 per axis.
    acc_range=8.0 * STANDARD_GRAVITY,
    # BMI055 data sheet (the sensors inside): 150 ug/sqrt(Hz), 0.014 deg/s/sqrt(Hz).
    acc_density=150e-6 * STANDARD_GRAVITY,
    acc_bias_sd=0.15,
    acc_instability=0.01,  # assumed: 1 mg over minutes, temperature included
    acc_step=2.0**-8,  # SH-2 reference manual: Q point 8
    gyro_range=math.radians(2000.0),
    gyro_density=math.radians(0.014),
    gyro_bias_sd=0.0,  # taken off on board, and not sent
    gyro_instability=0.0,
    gyro_step=2.0**-9,  # Q point 9
    q_step=2.0**-14,  # Q point 14
    tilt_still_sd=math.radians(0.6),
    tilt_moving_sd=math.radians(1.4),
    yaw_drift=math.radians(0.5) / 60.0,
)
"""Fuses on board: sends specific force and its own quaternion, no gyro (ASCII, UART-RVC)."""

BNO08X = replace(
    FUSED,
    gyro_bias_sd=math.radians(0.05),  # assumed: what its own zero-rate calibration leaves
    gyro_scale_sd=0.005,  # two recordings of real walks close with scales that are off by +0.45 and -0.2 %
)
"""The same chip over SHTP, which has its calibrated gyro too (data sheet, 2.1.2)."""

RAW = ImuModel(
    # BMI270 data sheet: 160 ug/sqrt(Hz), 0.007 deg/s/sqrt(Hz), zero-g +-20 mg, zero-rate +-0.5 deg/s.
    acc_range=8.0 * STANDARD_GRAVITY,  # of its +-16 g: the setting that most firmwares take
    acc_density=160e-6 * STANDARD_GRAVITY,
    acc_bias_sd=20e-3 * STANDARD_GRAVITY,
    acc_instability=0.002,  # assumed: 0.2 mg; the data sheet is silent, Allan plots of the class show 0.02 to 0.1 mg
    acc_step=8.0 * STANDARD_GRAVITY / 2**15,
    gyro_range=math.radians(2000.0),
    gyro_density=math.radians(0.007),
    gyro_bias_sd=math.radians(0.5),
    gyro_instability=math.radians(10.0) / 3600.0 * 3.0,  # assumed: 10 deg/h, thrice for temperature
    gyro_step=math.radians(2000.0) / 2**15,
)
"""Accelerometer and gyro as they are, 16 bits each."""

_MODELS: dict[ImuKind, ImuModel] = {"fused": FUSED, "raw": RAW, "bno08x": BNO08X}
_INSTABILITY_TAU_S = 100.0
_STILL_TAU_S = 60.0
_MOVING_TAU_S, _SMOOTH_TAU_S = 2.0, 0.1
"""How the tilt's error moves is in no data sheet. VQF (Laidig and Seel 2023) over raw samples of this simulation's walk
errs by 2.4 deg in all, as BNO's do, with a time constant of 2 s; its error changes by 0.03, 0.3, 0.7, 1.0 and 1.4 deg
per axis (rms) within 0.01, 0.1, 0.3, 0.8 and 2 s, this one by 0.03, 0.3, 0.6, 1.0 and 1.4. In slow steps VQF's is half
of this."""
_FULL_MOTION = 3.0  # m/s^2 of acceleration, smoothed, at which all of the moving error is there
_EFFORT_TAU_S = 0.5
_LEVELLING_TAU_S = 3.0  # how slowly a device trusts its accelerometer about what is upright
_DROP_SHARE = 0.002  # a healthy radio or serial link; bursts are faults
_SKEW_SD = 30e-6  # a crystal's tolerance
_STAMP_JITTER_SD = 0.15e-3  # s, left over after dejittering
LATENCY_S, _LATENCY_JITTER_S = 2.5e-3, 0.6e-3  # s to the host, and the exponential tail on top


@dataclass
class ImuSamples:
    """A run of one IMU, n samples in order of arrival. Times in s."""

    t: Array
    """Stamps: when it was, as the producer believes."""
    t_dev: npt.NDArray[np.int64]
    """The device's own counter, us."""
    t_arr: Array
    acc: Array
    """(n, 3) m/s^2, sensor frame."""
    gyro: Array | None
    q: Array | None
    """(n, 4) sensor to the device's frame."""

    def kept(self, keep: npt.NDArray[np.bool_]) -> ImuSamples:
        """Only these."""
        return ImuSamples(
            self.t[keep],
            self.t_dev[keep],
            self.t_arr[keep],
            self.acc[keep],
            None if self.gyro is None else self.gyro[keep],
            None if self.q is None else self.q[keep],
        )


def felt(track: Track, place: Placement, t: Array) -> tuple[Array, Array, Array]:
    """Perfect specific force (n, 3) m/s^2 and rate (n, 3) rad/s, sensor frame, and its attitude (n, 4), at `t` (n,)."""
    body = track.kinematics(t)
    r = np.asarray(place.p)
    up = np.array([0.0, STANDARD_GRAVITY, 0.0])
    force = rotations.unrotate(body.q, body.a + up) + np.cross(body.dw, r) + np.cross(body.w, np.cross(body.w, r))
    mounting = rotations.normalised(place.q)
    return (
        rotations.unrotate(mounting, force),
        rotations.unrotate(mounting, body.w),
        rotations.multiply(body.q, mounting),
    )


def measured(
    track: Track,
    place: Placement,
    seconds: float,
    hz: float,
    kind: ImuKind,
    delay: float,
    random: np.random.Generator,
) -> ImuSamples:
    """A run of `seconds`. Stamps are late by `delay` s, as settings have it (`timing.imu_delay`)."""
    model = _MODELS[kind]
    skew = _SKEW_SD * float(random.standard_normal())
    period = (1.0 + skew) / hz
    t = np.asarray(period * (float(random.random()) + np.arange(math.ceil(seconds / period))), dtype=np.float64)
    t = t[t < seconds]
    n = len(t)

    inner = max(1, round(_INNER_HZ / hz))
    offsets = ((np.arange(inner) + 0.5) / inner - 0.5) * period
    force, rate, _ = felt(track, place, (t[:, None] + offsets).ravel())
    instability = noise.gauss_markov(random, n, 1.0 / hz, _INSTABILITY_TAU_S, model.acc_instability)
    acc_bias = model.acc_bias_sd * random.standard_normal(3) + instability
    force += np.repeat(acc_bias, inner, axis=0)
    acc = np.clip(force, -model.acc_range, model.acc_range).reshape(n, inner, 3).mean(axis=1)
    bandwidth = math.sqrt(hz / 2.0)
    acc += model.acc_density * bandwidth * random.standard_normal((n, 3))

    gyro_bias = model.gyro_bias_sd * random.standard_normal(3) + noise.gauss_markov(
        random, n, 1.0 / hz, _INSTABILITY_TAU_S, model.gyro_instability
    )
    if model.gyro_scale_sd > 0.0:
        rate *= 1.0 + model.gyro_scale_sd * random.standard_normal(3)
    rate = np.clip(rate, -model.gyro_range, model.gyro_range).reshape(n, inner, 3).mean(axis=1) + gyro_bias
    rate += model.gyro_density * bandwidth * random.standard_normal((n, 3))

    q = None if kind == "raw" else _own_attitude(track, place, t, hz, acc_bias, model, random)
    begun = int(random.integers(10**6, 10**9))
    t_dev = np.rint(begun + 1e6 * (t - t[:1]) / (1.0 + skew)).astype(np.int64)
    stamps = t + delay + _STAMP_JITTER_SD * random.standard_normal(n)
    t_arr = np.maximum.accumulate(t + LATENCY_S + random.exponential(_LATENCY_JITTER_S, n))
    samples = ImuSamples(
        np.maximum.accumulate(stamps),
        t_dev,
        t_arr,
        _quantised(np.clip(acc, -model.acc_range, model.acc_range), model.acc_step),
        _quantised(rate, model.gyro_step) if kind != "fused" else None,
        q,
    )
    return samples.kept(random.random(n) >= _DROP_SHARE)


def _own_attitude(
    track: Track,
    place: Placement,
    t: Array,
    hz: float,
    acc_bias: Array,
    model: ImuModel,
    random: np.random.Generator,
) -> Array:
    """The device's quaternion: its tilt errs, its yaw is arbitrary and drifts."""
    body = track.kinematics(t)
    q = rotations.multiply(body.q, rotations.normalised(place.q))
    # Upright is where the biased accelerometer points at rest: R (g + b) is turned onto up.
    leaning = np.cross(rotations.rotate(q, acc_bias), [0.0, 1.0, 0.0]) / STANDARD_GRAVITY
    leaning = _low_passed(leaning, hz, _LEVELLING_TAU_S)
    effort = np.linalg.norm(body.a, axis=-1, keepdims=True)
    effort = np.minimum(_low_passed(effort, hz, _EFFORT_TAU_S) / _FULL_MOTION, 1.0)
    still = noise.gauss_markov(random, len(t), 1.0 / hz, _STILL_TAU_S, model.tilt_still_sd)
    moving = noise.smooth_gauss_markov(random, len(t), 1.0 / hz, _MOVING_TAU_S, _SMOOTH_TAU_S, model.tilt_moving_sd)
    tilt = leaning + still + effort * moving
    tilt[:, 1] = 0.0
    drift = model.yaw_drift * float(random.standard_normal())
    yaw = float(random.uniform(-math.pi, math.pi)) + drift * t
    q = rotations.multiply(rotations.from_yaw(yaw), rotations.multiply(rotations.from_rotation_vector(tilt), q))
    return rotations.normalised(_quantised(q, model.q_step))


def _low_passed(x: Array, hz: float, tau: float) -> Array:
    """First-order, settled at the start; (n, k)."""
    keep = math.exp(-1.0 / (tau * hz))
    smooth, _ = lfilter([1.0 - keep], [1.0, -keep], x, axis=0, zi=keep * x[:1])
    return np.asarray(smooth)


def _quantised(x: Array, step: float) -> Array:
    rounded: Array = np.rint(x / step) * step
    return rounded
