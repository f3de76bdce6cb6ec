"""How fast somebody goes who walks in place: three models, one interface."""

from __future__ import annotations

import math
from typing import Protocol

GUD_WIP_CADENCE = 1.57
"""steps/s at which GUD-WIP gives 1 m/s to ..."""
GUD_WIP_HEIGHT = 1.72
"""... somebody of this height, m."""
LLCM_GAIN = 2.2
"""LLCM's factor, which its authors choose by the user. This one equals GUD-WIP for peaks of 0.15 m at 1.6 steps/s."""
LLCM_CUTOFF_S = 0.25
AMPLITUDE = (-0.35, 1.6, 2.4)
"""c0 m/s, c1, c2 1/s of the model by speed and amplitude. Ours: fitted to GUD-WIP at peaks of 0.15 m."""


class SpeedModel(Protocol):
    """Steps to metres per second."""

    def update(self, dt: float, feet_vy: float) -> None:
        """Time passes by ``dt`` s; ``feet_vy`` is the sum of both ankles' vertical speeds, m/s, without sign."""

    def event(self, name: str, cadence: float, peak: float, mean_vy: float) -> None:
        """A foot's event at this cadence, steps/s; the swing's peak, m, and its mean vertical speed, m/s."""

    def speed(self, cadence: float) -> float:
        """m/s, at the cadence that is known now (it falls when the next event is overdue)."""

    def stop(self) -> None:
        """The person stands."""


class GudWip:
    """Gait-understanding-driven walking in place (Wendt, Whitton and Brooks, IEEE VR 2010).

    V = ((f / 1.57) (height / 1.72))^2 m/s with f in steps/s, renewed at every event of the gait.
    """

    def __init__(self, height: float) -> None:
        self._stature = height / GUD_WIP_HEIGHT

    def update(self, dt: float, feet_vy: float) -> None:
        """Nothing between events."""

    def event(self, name: str, cadence: float, peak: float, mean_vy: float) -> None:
        """The cadence says it all."""

    def speed(self, cadence: float) -> float:
        """m/s."""
        return (cadence / GUD_WIP_CADENCE * self._stature) ** 2

    def stop(self) -> None:
        """Nothing is remembered."""


class Llcm:
    """Low-latency, continuous-motion walking in place (Feasel, Whitton and Wendt, 3DUI 2008).

    V = k (LPF |z'_L| + LPF |z'_R|): the feet's vertical speeds, smoothed.
    """

    def __init__(self) -> None:
        self._smooth = 0.0

    def update(self, dt: float, feet_vy: float) -> None:
        """Smooth the feet's speeds; first order."""
        self._smooth += (feet_vy - self._smooth) * (1.0 - math.exp(-dt / LLCM_CUTOFF_S))

    def event(self, name: str, cadence: float, peak: float, mean_vy: float) -> None:
        """Events do not count."""

    def speed(self, cadence: float) -> float:
        """m/s."""
        return LLCM_GAIN * self._smooth

    def stop(self) -> None:
        """Decays by itself."""


class Amplitude:
    """By the speed and the amplitude of each footstep, renewed at mid and terminal swing only.

    V = c0 + c1 mean|v_y| + c2 peak. In the spirit of Bruno et al. (2013, 2017), whose formula it is not.
    """

    def __init__(self) -> None:
        self._speed = 0.0

    def update(self, dt: float, feet_vy: float) -> None:
        """Nothing between events."""

    def event(self, name: str, cadence: float, peak: float, mean_vy: float) -> None:
        """Mid and terminal swing set the speed."""
        if name in ("mid_swing", "terminal_swing"):
            c0, c1, c2 = AMPLITUDE
            self._speed = max(0.0, c0 + c1 * mean_vy + c2 * peak)

    def speed(self, cadence: float) -> float:
        """m/s."""
        return self._speed

    def stop(self) -> None:
        """Forget the last step."""
        self._speed = 0.0


def make_model(name: str, height: float) -> SpeedModel:
    """The model that the settings name; ``height`` of the person, m."""
    if name == "gud-wip":
        return GudWip(height)
    return Llcm() if name == "llcm" else Amplitude()
