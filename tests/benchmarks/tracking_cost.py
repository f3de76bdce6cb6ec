"""What following tags costs beside searching for them: ``python tests/benchmarks/tracking_cost.py [PICTURES]``.

Drawn pictures of somebody who looks at his feet go in turns through OpenCV's detector with its defaults (the whole
picture) and through our tracker (two windows, with all of a fix's numbers); pictures in which ours had to search are
left out of the costs. Tags of 6 cm are below 30 px at that distance, so their windows are enlarged; those of 8 cm are
looked for at native scale. Costs are of the thread's CPU; hits of both are of all pictures, errors against the truth.
"""

from __future__ import annotations

import sys
import time

import cv2
import numpy as np

from foottrack_protocol.frames import SIDES
from foottrack_service import rotations
from foottrack_service.camera.dictionaries import load_dictionary
from foottrack_service.camera.frame import Frame
from foottrack_service.camera.marker_tracker import MarkerTracker
from foottrack_service.camera.rig import Rig
from foottrack_service.camera.setup import open_source, rig_of, targets_of
from foottrack_service.config import Settings
from foottrack_service.simulation.scenario import simulate

FPS = 60.0
FIRST_S = 2.0
CASES = [("still", 0.06), ("steps", 0.06), ("line", 0.06), ("still", 0.08), ("steps", 0.08)]


def draw(task: str, size: float, pictures: int) -> tuple[Settings, Rig, list[Frame]]:
    """A task's pictures from FIRST_S on."""
    targets = {side: {"tags": [{"id": number, "size": size}]} for number, side in enumerate(SIDES)}
    scene = {"task": task, "seed": 1, "seconds": 20.0, "fps": FPS, "start": 0}
    settings = Settings(camera={"targets": targets, "source": {"kind": "rendered", "rendered": scene}})
    source = open_source(settings, None)
    frames = [source.read() for _ in range(round(FIRST_S * FPS) + pictures)][-pictures:]
    return settings, rig_of(settings.camera, source.intrinsics), frames


def row(task: str, size: float, pictures: int) -> str:
    """One line of the table."""
    settings, rig, frames = draw(task, size, pictures)
    dictionary = load_dictionary(settings.camera.dictionary)
    whole = cv2.aruco.ArucoDetector(dictionary, cv2.aruco.DetectorParameters())
    tracker = MarkerTracker(rig, dictionary, targets_of(settings.camera))
    truth = simulate(task, 1, settings=settings, seconds=20.0, camera=False).truth
    costs: list[tuple[float, float]] = []
    errors: list[float] = []
    by_opencv = 0
    for frame in frames:
        began = time.thread_time_ns()
        _, ids, _ = whole.detectMarkers(frame.gray)
        searched = time.thread_time_ns()
        fixes = tracker.process(frame)
        tracked = time.thread_time_ns()
        by_opencv += 0 if ids is None else len(np.ravel(ids))
        if len(tracker.windows) == len(SIDES):
            costs.append(((searched - began) * 1e-6, (tracked - searched) * 1e-6))
        for fix in fixes:
            t = np.array([fix.t * 1e-9])
            head_p, head_q = truth.head.pose(t)
            side = next(side for side in SIDES if side == fix.side)
            tag = truth.feet[side].point(t, settings.feet.of(side).marker.p)
            errors.append(float(np.linalg.norm(fix.p - rotations.unrotate(head_q, tag - head_p)[0])))
    full, ours = np.array(costs).T
    median, p95 = 1e3 * np.percentile(errors, [50, 95])
    return (
        f"{task:6} {100 * size:3.0f} cm  {len(costs):8}  {np.median(full):10.2f} {np.median(ours):6.3f}  "
        f"1/{1.0 / np.median(ours / full):5.2f} 1/{full.sum() / ours.sum():5.2f}  "
        f"{len(errors):5} {by_opencv:6}  {median:6.2f} {p95:6.2f}"
    )


def main(pictures: int) -> None:
    """Print the table."""
    cv2.setNumThreads(1)
    print("task   tags   pictures  OpenCV, ms   ours  ratio: median, sums   hits OpenCV  error mm: median, p95")
    for task, size in CASES:
        print(row(task, size, pictures), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 180)
