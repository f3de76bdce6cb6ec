"""What a filter made of each optical fix: false ones rejected, good ones lost, and where in the picture they were."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from foottrack_protocol.messages import Side
from foottrack_service import rotations as rot
from foottrack_service.config import Settings
from foottrack_service.fusion.filters import make_filter
from foottrack_service.fusion.interface import FootFilter, OpticalFix, Verdict
from foottrack_service.rotations import Array
from foottrack_service.simulation.camera import FOCAL
from foottrack_service.simulation.scenario import Scenario

CENTRE_BINS_PX = (0, 100, 200, 300, 500)
"""Edges of the distances from the picture's centre."""


class Judged(NamedTuple):
    """One fix and what became of it."""

    fix: OpticalFix
    verdict: Verdict


@dataclass
class FixNotes:
    """Makes filters as the settings choose them that note their fixes, for ``FusionCore``."""

    by_side: dict[Side, list[Judged]] = field(default_factory=lambda: {"left": [], "right": []})

    def make(self, settings: Settings, side: Side) -> FootFilter:
        """One foot's filter."""
        filter_ = make_filter(settings, side)
        on_fix, notes = filter_.on_fix, self.by_side[side]

        def noting(fix: OpticalFix, now: int) -> Verdict:
            verdict = on_fix(fix, now)
            notes.append(Judged(fix, verdict))
            return verdict

        filter_.on_fix = noting  # type: ignore[method-assign]
        return filter_

    def counts(self, scenario: Scenario, first_s: float) -> dict[str, int]:
        """Of fixes from ``first_s`` on: "false", "false_rejected", "good", "good_lost".

        A blob that is not needed, since the tag is seen, is neither.
        """
        false = false_stamps(scenario)
        counts = {"false": 0, "false_rejected": 0, "good": 0, "good_lost": 0}
        for side, notes in self.by_side.items():
            for fix, verdict in notes:
                if verdict is Verdict.UNUSED or (fix.t - scenario.start) * 1e-9 < first_s:
                    continue
                bad = (f"{fix.kind}/{side}", fix.t) in false
                missed = verdict is not Verdict.ACCEPTED
                counts["false" if bad else "good"] += 1
                counts["false_rejected" if bad else "good_lost"] += missed
        return counts

    def good_tags(self, scenario: Scenario, side: Side) -> list[OpticalFix]:
        """Accepted tags that are none of the false ones, in order of their stamps."""
        false = false_stamps(scenario)
        good = [
            fix
            for fix, verdict in self.by_side[side]
            if fix.kind == "marker" and verdict is Verdict.ACCEPTED and (f"marker/{side}", fix.t) not in false
        ]
        return sorted(good, key=lambda fix: fix.t)


def false_stamps(scenario: Scenario) -> frozenset[tuple[str, int]]:
    """(stream, stamp in ns) of the scenario's false fixes."""
    stamps = {emission.stream: emission.t for emission in scenario.emissions}
    return frozenset((stream, scenario.start + int(stamps[stream][seq])) for stream, seq in scenario.false_fixes())


def centre_px(fixes: list[OpticalFix], settings: Settings) -> Array:
    """Distance from the picture's centre, px, shape (n,), of fixes in the head frame."""
    mount = settings.camera.mount
    local = rot.unrotate(np.array(mount.q), np.array([fix.p for fix in fixes]).reshape(-1, 3) - np.array(mount.p))
    return np.asarray(FOCAL * np.linalg.norm(local[:, :2], axis=1) / np.maximum(-local[:, 2], 0.05))
