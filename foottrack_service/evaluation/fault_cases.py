"""Everything that can go wrong with a person's sensors, as cases that happen again and again in one run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from foottrack_protocol.messages import Side
from foottrack_service.simulation import faults as f
from foottrack_service.simulation.faults import Fault, Source

JUMPS_S = (0.05, 0.25, 1.0, 10.0)
"""By so much a clock jumps, there and back."""
_CLOCKS: dict[str, Source] = {"IMU": "imu-left", "camera": "camera", "headset": "headset"}
_LEFT: tuple[Side, ...] = ("left",)
_BOTH: tuple[Side, ...] = ("left", "right")


@dataclass(frozen=True)
class FaultCase:
    """A fault, how long it holds, s, and whom it hits."""

    make: Callable[[float, float], Fault]
    """(start, end), s."""
    lasts_s: float = 1.0
    sides: tuple[Side, ...] = _LEFT


def _clock_jumps() -> dict[str, FaultCase]:
    return {
        f"{name}'s clock {sign * size:+g} s": FaultCase(
            lambda a, b, source=source, offset=sign * size: f.ClockJump(  # type: ignore[misc]
                start=a, end=b, source=source, offset=offset
            ),
            sides=_LEFT if name == "IMU" else _BOTH,
        )
        for name, source in _CLOCKS.items()
        for size in JUMPS_S
        for sign in (1.0, -1.0)
    }


FAULT_CASES: dict[str, FaultCase] = {
    "dropped packets": FaultCase(lambda a, b: f.PacketLoss(start=a, end=b, side="left")),
    "repeated stamps": FaultCase(lambda a, b: f.RepeatedStamps(start=a, end=b, side="left")),
    "reversed stamps": FaultCase(lambda a, b: f.ReversedStamps(start=a, end=b, side="left")),
    "IMU silent, 0.3 s": FaultCase(lambda a, b: f.ImuDropout(start=a, end=b, side="left"), 0.3),
    "IMU silent, 2 s": FaultCase(lambda a, b: f.ImuDropout(start=a, end=b, side="left"), 2.0),
    "saturated accelerometer": FaultCase(lambda a, b: f.Saturation(start=a, end=b, side="left")),
    "NaN": FaultCase(lambda a, b: f.NotANumber(start=a, end=b, side="left")),
    "false tags, 0.3 s": FaultCase(lambda a, b: f.FalseTags(start=a, end=b, side="left"), 0.3),
    "false tags, 1 s": FaultCase(lambda a, b: f.FalseTags(start=a, end=b, side="left")),
    "a tag on the floor, 0.3 s": FaultCase(lambda a, b: f.FalseTags(start=a, end=b, side="left", lies=True), 0.3),
    "a tag on the floor, 1 s": FaultCase(lambda a, b: f.FalseTags(start=a, end=b, side="left", lies=True)),
    "the other shoe's tag": FaultCase(lambda a, b: f.WrongIdentity(start=a, end=b, side="left")),
    "swapped sides, 1 s": FaultCase(lambda a, b: f.SwappedSides(start=a, end=b), sides=_BOTH),
    "swapped sides, 10 s": FaultCase(lambda a, b: f.SwappedSides(start=a, end=b), 10.0, sides=_BOTH),
    "no pictures, 2 s": FaultCase(lambda a, b: f.CameraBlackout(start=a, end=b), 2.0, sides=_BOTH),
    "no headset": FaultCase(lambda a, b: f.HeadsetLost(start=a, end=b), sides=_BOTH),
    "recentred, known": FaultCase(lambda a, b: f.HeadsetRecentred(start=a), 0.0, sides=_BOTH),
    "recentred, unknown": FaultCase(lambda a, b: f.HeadsetRecentred(start=a, known=False), 0.0, sides=_BOTH),
    **_clock_jumps(),
}
"""By the name that reports use."""
