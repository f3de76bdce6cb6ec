"""How often tags are found, and for how much: ``python tests/benchmarks/tag_detection.py [PICTURES]``.

Against blur, distance and tag size, on the same drawn pictures: our window, our whole picture, OpenCV's defaults on the
whole picture, and pupil-apriltags with its defaults, where it is installed. AprilTag's 16h5 has 4x4 cells as
DICT_4X4_50 has, so that all four look for a tag of the same cells. Times are of the thread's CPU, medians.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "unit" / "camera"))

from camera_scenes import RIG, passing

from foottrack_service.camera.detector import TagDetector, Window
from foottrack_service.camera.dictionaries import load_dictionary

DICTIONARY = "DICT_APRILTAG_16h5"
CASES = [(0.06, 1.5), (0.06, 2.0), (0.10, 1.5), (0.10, 2.5)]
BLURS_PX = (0, 2, 4, 8, 12)

Find = Callable[[np.ndarray, Window], np.ndarray | None]


def finders() -> dict[str, Find]:
    """By name: the corners of tag 0 in a picture, or None."""
    dictionary = load_dictionary(DICTIONARY)
    ours = TagDetector(dictionary, [0])
    defaults = cv2.aruco.ArucoDetector(dictionary, cv2.aruco.DetectorParameters())

    def opencv(gray: np.ndarray, _: Window) -> np.ndarray | None:
        corners, ids, _ = defaults.detectMarkers(gray)
        found = [c for i, c in zip([] if ids is None else np.ravel(ids), corners, strict=True) if i == 0]
        return np.reshape(found[0], (4, 2)) if found else None

    made: dict[str, Find] = {
        "our window": lambda gray, window: next((d.corners for d in ours.look(gray, window)), None),
        "our picture": lambda gray, _: next((d.corners for d in ours.search(gray)), None),
        "OpenCV": opencv,
    }
    try:
        from pupil_apriltags import Detector
    except ImportError:
        print("pupil-apriltags is not installed: its columns are left out")
        return made
    peer: Any = Detector(families="tag16h5", nthreads=1)
    made["pupil-apriltags"] = lambda gray, _: next((d.corners for d in peer.detect(gray) if d.tag_id == 0), None)
    return made


def main(pictures: int) -> None:
    """Print the table."""
    cv2.setNumThreads(1)
    found = finders()
    times: dict[str, list[float]] = {name: [] for name in found}
    print("  size distance    px  blur  " + "".join(f"{name:>17}" for name in found))
    for size, distance in CASES:
        px = size * RIG.intrinsics.focal / distance
        for blur in BLURS_PX:
            hits = dict.fromkeys(found, 0)
            for seed in range(pictures):
                made, true = passing(size, distance, blur, DICTIONARY, seed)
                gray, middle = made.frame(0).gray, true.mean(axis=0)
                low, high = (middle - 1.5 * px).astype(int), (middle + 1.5 * px).astype(int)
                for name, find in found.items():
                    began = time.thread_time_ns()
                    corners = find(gray, Window(*low, *high, px))
                    times[name].append((time.thread_time_ns() - began) * 1e-6)
                    # Others number the corners otherwise: the tag's middle is what all agree on.
                    hits[name] += corners is not None and bool(np.abs(corners.mean(axis=0) - middle).max() < 0.3 * px)
            shares = "".join(f"{hits[name] / pictures:17.2f}" for name in found)
            print(f"{size:6.2f} {distance:8.1f} {px:5.0f} {blur:5}  {shares}", flush=True)
    print(f"{'ms of CPU, median':29}" + "".join(f"{np.median(times[name]):17.2f}" for name in found))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 16)
