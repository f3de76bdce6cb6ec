"""glTF 2.0 binary out and in: the skeleton, a small skinned body, one animation with key times at the contacts."""

from __future__ import annotations

import struct

import numpy as np
import numpy.typing as npt
import pygltflib as gltf

from foottrack_service import rotations as rot
from foottrack_service.walkcycle.errors import MotionFileError
from foottrack_service.walkcycle.frames import contact_edges
from foottrack_service.walkcycle.mesh import box_body, rest_positions
from foottrack_service.walkcycle.skeleton import JOINTS, PARENTS, Humanoid
from foottrack_service.walkcycle.walk import Motion, Walk

Array = npt.NDArray[np.float64]


def key_times(walk: Walk, fps: float) -> Array:
    """Even times, and every contact's beginnings and ends, (n,) s: what lands between two keys slides."""
    even = np.append(walk.times(fps), walk.duration)
    edges = contact_edges(walk, flat=True)
    edges = edges.astype(np.float32).astype(np.float64)
    merged = np.unique(np.concatenate([even.astype(np.float32).astype(np.float64), edges]))
    # An even key a hair beside an edge would make two keys of one instant.
    near = np.array([np.any((np.abs(edges - t) < 5e-4) & (edges != t)) for t in merged]) if edges.size else False
    return np.asarray(merged[~near] if edges.size else merged)


def format_glb(body: Humanoid, motion: Motion, name: str = "walk") -> bytes:
    """GLB bytes of a motion at increasing times."""
    file = gltf.GLTF2(asset=gltf.Asset(version="2.0", generator="foottrack"))
    blob = bytearray()

    def add(
        values: npt.NDArray[np.generic], kind: str, component: int, target: int | None = None, *, span: bool = False
    ) -> int:
        blob.extend(b"\0" * (-len(blob) % 4))
        data = np.ascontiguousarray(values).tobytes()
        file.bufferViews.append(gltf.BufferView(buffer=0, byteOffset=len(blob), byteLength=len(data), target=target))
        blob.extend(data)
        bounds = np.atleast_2d(values.T).T if span else None
        file.accessors.append(
            gltf.Accessor(
                bufferView=len(file.bufferViews) - 1,
                componentType=component,
                count=len(values),
                type=kind,
                min=None if bounds is None else [float(v) for v in bounds.min(axis=0)],
                max=None if bounds is None else [float(v) for v in bounds.max(axis=0)],
            )
        )
        return len(file.accessors) - 1

    float32 = np.float32
    for joint, bone in enumerate(JOINTS):
        children = [child for child, parent in enumerate(PARENTS) if parent == joint]
        place = [float(v) for v in body.offsets[joint]]
        file.nodes.append(gltf.Node(name=bone, translation=place, children=children))
    mesh = box_body(body)
    bind = np.tile(np.eye(4), (len(JOINTS), 1, 1))
    bind[:, 3, :3] = -rest_positions(body)
    weights = np.zeros((len(mesh.joints), 4), float32)
    weights[:, 0] = 1.0
    bones = np.zeros((len(mesh.joints), 4), np.uint8)
    bones[:, 0] = mesh.joints
    attributes = gltf.Attributes(
        POSITION=add(mesh.vertices.astype(float32), gltf.VEC3, gltf.FLOAT, gltf.ARRAY_BUFFER, span=True),
        NORMAL=add(_unit32(mesh.normals), gltf.VEC3, gltf.FLOAT, gltf.ARRAY_BUFFER),
        JOINTS_0=add(bones, gltf.VEC4, gltf.UNSIGNED_BYTE, gltf.ARRAY_BUFFER),
        WEIGHTS_0=add(weights, gltf.VEC4, gltf.FLOAT, gltf.ARRAY_BUFFER),
    )
    triangles = add(mesh.triangles.reshape(-1), gltf.SCALAR, gltf.UNSIGNED_SHORT, gltf.ELEMENT_ARRAY_BUFFER)
    file.meshes.append(
        gltf.Mesh(name="body", primitives=[gltf.Primitive(attributes=attributes, indices=triangles, material=0)])
    )
    surface = gltf.PbrMetallicRoughness(baseColorFactor=[0.55, 0.62, 0.7, 1.0], metallicFactor=0.0, roughnessFactor=0.8)
    file.materials.append(gltf.Material(name="body", pbrMetallicRoughness=surface))
    inverse = add(bind.astype(float32).reshape(len(JOINTS), 16), gltf.MAT4, gltf.FLOAT)
    file.skins.append(gltf.Skin(joints=list(range(len(JOINTS))), inverseBindMatrices=inverse, skeleton=0))
    file.nodes.append(gltf.Node(name="body", mesh=0, skin=0))
    file.scenes.append(gltf.Scene(nodes=[0, len(JOINTS)]))
    file.scene = 0

    animation = gltf.Animation(name=name)
    clock = add(motion.times.astype(float32), gltf.SCALAR, gltf.FLOAT, span=True)
    tracks = [(0, "translation", add(motion.hips.astype(float32), gltf.VEC3, gltf.FLOAT))]
    for joint in range(len(JOINTS)):
        tracks += [(joint, "rotation", add(_unit32(motion.rotations[:, joint]), gltf.VEC4, gltf.FLOAT))]
    for node, path, output in tracks:
        animation.samplers.append(gltf.AnimationSampler(input=clock, output=output, interpolation="LINEAR"))
        target = gltf.AnimationChannelTarget(node=node, path=path)
        animation.channels.append(gltf.AnimationChannel(sampler=len(animation.samplers) - 1, target=target))
    file.animations.append(animation)
    file.buffers.append(gltf.Buffer(byteLength=len(blob)))
    file.set_binary_blob(bytes(blob))
    return b"".join(file.save_to_bytes())


def parse_glb(data: bytes) -> Motion:
    """The first animation of a GLB whose nodes carry our joints' names. Raises MotionFileError."""
    try:
        return _first_motion(data)
    except MotionFileError:
        raise
    except (ValueError, LookupError, TypeError, AttributeError, OSError, struct.error) as error:
        # Whatever an index or a type in somebody's file leads to.
        raise MotionFileError(f"GLB: not as glTF has it ({type(error).__name__}: {error})") from None


def _first_motion(data: bytes) -> Motion:
    file = gltf.GLTF2.load_from_bytes(data)
    blob = file.binary_blob() if file is not None else None
    if blob is None or not file.animations:
        raise MotionFileError("GLB: no binary chunk with an animation")
    nodes = {node.name: i for i, node in enumerate(file.nodes)}
    missing = [name for name in JOINTS if name not in nodes]
    if missing:
        raise MotionFileError(f"GLB: no node is called {missing[0]}")

    def read(accessor: int) -> Array:
        a = file.accessors[accessor]
        view = file.bufferViews[a.bufferView]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[a.type]
        start = (view.byteOffset or 0) + (a.byteOffset or 0)
        if a.componentType != gltf.FLOAT:
            raise MotionFileError(f"GLB: accessor {accessor}: only floats are read")
        values = np.frombuffer(blob, np.float32, a.count * width, start).astype(np.float64)
        return values.reshape(a.count, width) if width > 1 else values

    animation = file.animations[0]
    times = read(animation.samplers[0].input)
    hips = np.tile(np.array(file.nodes[nodes["hips"]].translation or [0.0, 0.0, 0.0]), (len(times), 1))
    rotations = np.tile(rot.IDENTITY, (len(times), len(JOINTS), 1))
    joint_of = {nodes[name]: i for i, name in enumerate(JOINTS)}
    for channel in animation.channels:
        joint = joint_of.get(channel.target.node)
        values = read(animation.samplers[channel.sampler].output)
        if joint is not None and channel.target.path == "rotation":
            rotations[:, joint] = rot.normalised(values)
        elif joint == 0 and channel.target.path == "translation":
            hips[:] = values
    return Motion(times, hips, rotations)


def _unit32(values: Array) -> npt.NDArray[np.float32]:
    """Single precision, unit again after rounding, as validators check."""
    single = values.astype(np.float32)
    return np.asarray(single / np.linalg.norm(single, axis=-1, keepdims=True).astype(np.float32))
