"""Figures of A. Bayer, *Foot Tracking in Virtual Reality*, TU Wien 2021 [B], and why ours need not agree with them."""

from __future__ import annotations

from typing import Literal

Source = Literal["marker", "depth", "inertial"]

TECHNICAL_MM: dict[str, dict[Source, tuple[float, float]]] = {
    "still": {"marker": (2.96, 6.8), "depth": (2.97, 12.6), "inertial": (0.65, 1.07)},
    "tracker-moving": {"marker": (33.6, 124.0), "depth": (41.0, 103.0), "inertial": (169.0, 481.0)},
    "head-bench": {"marker": (35.4, 130.0), "depth": (12.1, 22.0), "inertial": (0.18, 0.85)},
}
"""Technical tests: mean and mean maximum, by the source that was left on."""

TECHNICAL_LATENCY_S: dict[Source, float] = {"marker": 0.314, "depth": 0.336, "inertial": 0.369}
"""A sudden move: from its onset to the largest error."""

STUDY_MEDIAN_MM: dict[str, tuple[float, float]] = {
    "steps": (34.0, 26.0),
    "side-steps": (44.0, 32.0),
    "line": (25.0, 25.0),
    "circle": (88.0, 80.0),
    "knee-bends": (32.0, 24.0),
    "upper-body": (49.0, 24.0),
}
"""User study, against a lighthouse tracker on the foot: median of the left foot (no IMU) and of the right one (IMU)."""

STUDY_ALL_MM = {"median": (37.0, 27.0), "mean": (135.0, 93.0)}

NOTES: dict[str, str] = {
    "still": "[B] had no truth on its bench: its error is the spread round the mean place. Ours is against the truth, "
    "so a constant offset of camera and tag counts as well.",
    "tracker-moving": "[B]'s moves by hand must have been gentler: with the IMU alone an error of 169 mm needs "
    "accelerations far below those of a foot; depth alone has its bias and no gate.",
    "head-bench": "The marker stage suffers from the newest head pose being used for an older picture; without "
    "pictures the head's motion cannot reach the foot, which then merely drifts.",
    "sudden-move": "[B]'s latency is the time from the onset to the largest error, so mostly the movement's own "
    "duration; the true lag is the shift of the truth that fits best.",
    "circle": "A lighthouse tracker on a body that turns away loses its base station; simulated truth does not.",
}
"""Why a row differs from the published one."""
