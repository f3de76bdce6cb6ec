"""What the gait is tried with: walking in place of all kinds, and what must not be taken for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from foottrack_service.simulation.marching import leaning, marching, turning
from foottrack_service.simulation.tasks import Maker

CADENCES = (0.8, 1.2, 1.6, 2.0, 2.5)
"""steps/s."""
PEAKS = (0.05, 0.1, 0.2, 0.35)
"""m."""
HEIGHTS = (1.55, 1.75, 1.95)
"""m, of the person."""
SENSORS = ((100.0, True), (400.0, False), (400.0, True), (100.0, False))
"""IMU rate in Hz, and whether there is a camera."""
HELD_OUT_SEED = 9000
"""Added to every seed: nothing was tuned on these."""


@dataclass(frozen=True, slots=True)
class GaitCase:
    """One run."""

    name: str
    kind: str
    """"in place", or what else it is."""
    seed: int
    imu_hz: float
    camera: bool
    height: float
    cadence: float = 0.0
    peak: float = 0.0
    turn: float = 0.0

    @property
    def motion(self) -> Maker | None:
        """Its motion; None for a task that the simulation knows by name."""
        if self.kind == "in place":
            return marching(self.cadence, self.peak, self.turn)
        return {"turning": turning, "leaning": leaning}.get(self.kind)


def cases(seeds: Sequence[int]) -> list[GaitCase]:
    """Every cadence with every peak, rates, camera and sizes taking turns; some while turning; and the others."""
    found: list[GaitCase] = []
    for seed in seeds:
        held = HELD_OUT_SEED + seed
        index = seed
        for cadence in CADENCES:
            for peak in PEAKS:
                hz, camera = SENSORS[index % len(SENSORS)]
                height = HEIGHTS[index % len(HEIGHTS)]
                found.append(GaitCase(f"{cadence:g}/s {peak:g} m", "in place", held, hz, camera, height, cadence, peak))
                index += 1
            # Twenty combinations of one seed and four kinds of sensors would meet in the same pairs again.
            index += 1
        found.append(GaitCase("turning while walking", "in place", held, 100.0, True, 1.75, 1.7, 0.15, 0.25))
        for kind in ("knee-bends", "leaning", "turning", "upper-body", "head-moving", "steps", "side-steps", "walk"):
            hz, camera = SENSORS[index % len(SENSORS)]
            found.append(GaitCase(kind, kind, held, hz, camera or kind == "walk", 1.75))
            index += 1
    return found
