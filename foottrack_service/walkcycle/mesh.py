"""A small body to hang on the skeleton: one box per bone, each bound to its joint. Importers of glTF skip the
animation of a skeleton that carries no skin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from foottrack_service.walkcycle.skeleton import INDEX, JOINTS, PARENTS, Humanoid

Array = npt.NDArray[np.float64]

_THICK_M = {"Leg": 0.06, "Arm": 0.04, "hips": 0.10, "spine": 0.11, "hest": 0.12, "neck": 0.05, "head": 0.08}
_FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


@dataclass(frozen=True)
class Mesh:
    """Vertices (v, 3) m in the model's rest pose, normals (v, 3), triangles (t, 3), and each vertex's joint (v,)."""

    vertices: Array
    normals: Array
    triangles: npt.NDArray[np.uint16]
    joints: npt.NDArray[np.uint8]


def box_body(body: Humanoid) -> Mesh:
    """Boxes from every joint to its child (or tip)."""
    rest = rest_positions(body)
    vertices: list[Array] = []
    normals: list[Array] = []
    triangles: list[list[int]] = []
    joints: list[int] = []
    for name, joint in INDEX.items():
        start, end = rest[joint], rest[joint] + _reach(body, name, joint)
        thick = 0.5 * body.scale * next((v for part, v in _THICK_M.items() if part in name), 0.035)
        if name.endswith(("Foot", "Toes")):
            low = np.minimum(start, end) - [0.04 * body.scale, 0.0, 0.05 * body.scale * name.endswith("Foot")]
            high = np.maximum(start, end) + [0.04 * body.scale, 0.0, 0.0]
            low[1] = 0.0
        else:
            low, high = np.minimum(start, end) - thick, np.maximum(start, end) + thick
        corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * (high - low) + low
        for face in _FACES:
            base = len(vertices)
            quad = corners[list(face)]
            normal = np.cross(quad[1] - quad[0], quad[2] - quad[0])
            vertices += list(quad)
            normals += [normal / np.linalg.norm(normal)] * 4
            joints += [joint] * 4
            triangles += [[base, base + 1, base + 2], [base, base + 2, base + 3]]
    return Mesh(
        np.array(vertices), np.array(normals), np.array(triangles, dtype=np.uint16), np.array(joints, dtype=np.uint8)
    )


def rest_positions(body: Humanoid) -> Array:
    """World positions (22, 3) m at rest."""
    offsets = body.offsets
    places = np.zeros_like(offsets)
    for joint, parent in enumerate(PARENTS):
        places[joint] = offsets[joint] + (places[parent] if parent >= 0 else 0.0)
    return places


def _reach(body: Humanoid, name: str, joint: int) -> Array:
    if name.endswith("Toes"):
        return body.toe_tip
    if name == "head":
        return np.array([0.0, 0.22, 0.0]) * body.scale
    if name.endswith("Hand"):
        return np.array([0.18 if name.startswith("left") else -0.18, 0.0, 0.0]) * body.scale
    if name == "hips":
        return np.array([0.0, 0.1, 0.0]) * body.scale
    child = next(i for i, parent in enumerate(PARENTS) if parent == joint and JOINTS[i] != "leftShoulder")
    return np.asarray(body.offsets[child])
