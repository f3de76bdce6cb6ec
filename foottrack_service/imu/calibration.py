"""``calibrate imu``: what each sensor reads at rest, then which of them is tapped. No bus and no clock."""

from __future__ import annotations

from collections import deque

import numpy as np

from foottrack_protocol.messages import ImuValues, Side
from foottrack_service.config import FootSettings
from foottrack_service.imu.identify import TapIdentifier
from foottrack_service.imu.rest import NotAtRest, Rest, rest
from foottrack_service.imu.sample import Vec3

REST_S = 3.0
RETRY_S = 0.25


class RestWatch:
    """Waits until one sensor has been at rest for ``REST_S``. ``problem`` says why it is not."""

    def __init__(self) -> None:
        self.found: Rest | None = None
        self.problem = "nothing was received"
        self._window: deque[tuple[float, Vec3, Vec3 | None]] = deque()
        self._tried = 0.0

    def add(self, t: float, acc: Vec3, gyro: Vec3 | None) -> None:
        """One sample: stamp in s, m/s^2, rad/s. A stamp that goes back begins anew."""
        if self.found is not None:
            return
        if self._window and t < self._window[-1][0]:
            self._window.clear()
        self._window.append((t, acc, gyro))
        if t - self._window[0][0] < REST_S:
            self.problem = "it has to be watched a little longer"
            return
        while t - self._window[1][0] >= REST_S:
            self._window.popleft()
        if abs(t - self._tried) >= RETRY_S:
            self._tried = t
            self._try()

    def _try(self) -> None:
        times, accs, gyros = zip(*self._window, strict=True)
        known = None if any(gyro is None for gyro in gyros) else np.asarray(gyros)
        try:
            self.found = rest(times, np.asarray(accs), known)
        except NotAtRest as error:
            self.problem = str(error)


class ImuCalibrator:
    """Both steps for the given sides. After ``all_rested``, tap the left foot twice: ``swapped`` is then known."""

    def __init__(self, sides: tuple[Side, ...]) -> None:
        self.rests: dict[Side, RestWatch] = {side: RestWatch() for side in sides}
        self.swapped: bool | None = None
        self._taps = TapIdentifier()

    @property
    def all_rested(self) -> bool:
        """Whether the first step is done."""
        return all(watch.found is not None for watch in self.rests.values())

    @property
    def problems(self) -> dict[Side, str]:
        """Of the sensors that have not rested yet."""
        return {side: watch.problem for side, watch in self.rests.items() if watch.found is None}

    def add(self, side: Side, t: float, acc: Vec3, gyro: Vec3 | None) -> None:
        """One sample of a side: stamp in s, m/s^2, rad/s."""
        if side not in self.rests:
            return
        if not self.all_rested:
            self.rests[side].add(t, acc, gyro)
        elif self.swapped is None:
            tapped = self._taps.add(side, t, acc)
            if tapped is not None:
                self.swapped = tapped == "right"

    def values(self, side: Side, foot: FootSettings) -> ImuValues:
        """The result for the wire; the place on the foot is the configured one. Raises KeyError before the rest.

        A sensor without a gyro has no gyro bias; of the accelerometer's, one position shows the part along gravity.
        """
        found = self.rests[side].found
        if found is None:
            raise KeyError(side)
        acc_bias = found.acc_bias_along_gravity
        gyro_bias = np.zeros(3) if found.gyro is None else found.gyro
        return ImuValues(
            side=side,
            acc_bias=(float(acc_bias[0]), float(acc_bias[1]), float(acc_bias[2])),
            gyro_bias=(float(gyro_bias[0]), float(gyro_bias[1]), float(gyro_bias[2])),
            p=foot.imu.p,
            q=foot.imu.q,
        )
