"""A picture with what was found in it, for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import numpy as np
import numpy.typing as npt

from foottrack_service import rotations
from foottrack_service.camera.detector import Window
from foottrack_service.camera.fix import Fix
from foottrack_service.camera.frame import Frame
from foottrack_service.camera.rig import Rig

_COLOURS = {"marker": (60, 220, 60), "depth": (0, 160, 255)}
_AXES = ((40, 40, 255), (40, 255, 40), (255, 80, 40))
_WINDOW = (200, 200, 0)
_AXIS_M = 0.05


def draw(frame: Frame, fixes: Sequence[Fix], windows: Mapping[str, Window], rig: Rig) -> npt.NDArray[np.uint8]:
    """BGR picture (h, w, 3): windows that were looked at, outlines, axes of the attitude, range and side."""
    picture = np.asarray(cv2.cvtColor(frame.gray, cv2.COLOR_GRAY2BGR), dtype=np.uint8)
    for window in windows.values():
        cv2.rectangle(picture, (window.left, window.top), (window.right - 1, window.bottom - 1), _WINDOW, 1)
    for fix in fixes:
        colour = _COLOURS[fix.kind]
        for start in range(0, len(fix.outline), 4):
            corners = np.rint(fix.outline[start : start + 4] * 16.0).astype(np.int32)
            cv2.polylines(picture, [corners], True, colour, 1, cv2.LINE_AA, 4)
        if fix.q is not None:
            _draw_axes(picture, fix, rig)
        x, y = fix.outline.min(axis=0)
        cv2.putText(picture, fix.label, (int(x), int(y) - 5), cv2.FONT_HERSHEY_SIMPLEX, 0.42, colour, 1, cv2.LINE_AA)
    text = f"#{frame.number}  found {len(fixes)}"
    cv2.putText(picture, text, (6, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (255, 255, 255), 1, cv2.LINE_AA)
    return picture


def jpeg(picture: npt.NDArray[np.uint8], quality: int = 80) -> bytes:
    """Compressed, as `camera/preview` carries it."""
    _, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return bytes(data)


def _draw_axes(picture: npt.NDArray[np.uint8], fix: Fix, rig: Rig) -> None:
    if fix.q is None:
        return
    ends = fix.p + _AXIS_M * rotations.to_matrix(fix.q).T
    points = rig.from_head(np.vstack([fix.p[None], ends]))
    if points[:, 2].min() < 0.05:
        return
    pixels = np.rint(rig.intrinsics.project(points)).astype(int)
    origin = (int(pixels[0, 0]), int(pixels[0, 1]))
    for end, colour in zip(pixels[1:], _AXES, strict=True):
        cv2.line(picture, origin, (int(end[0]), int(end[1])), colour, 1, cv2.LINE_AA)
