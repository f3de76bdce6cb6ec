"""Pictures as the tracker got them, in pieces that the wire takes: lossless, so that a desk finds what was found."""

from __future__ import annotations

import cv2

from foottrack_protocol.messages import Lens, RawPicture
from foottrack_service.camera.frame import DepthMap, Frame, Gray
from foottrack_service.camera.rig import Intrinsics

PERIOD_S = 0.2
"""Between raw pictures. With depth one of 848x480 px is about 0.5 MB and 10 ms of compressing."""
PIECE_BYTES = 192 * 1024


def pieces(frame: Frame, intrinsics: Intrinsics) -> tuple[RawPicture, ...]:
    """A picture, and its depth if it has any."""
    lens = Lens(
        width=intrinsics.width,
        height=intrinsics.height,
        fx=intrinsics.fx,
        fy=intrinsics.fy,
        cx=intrinsics.cx,
        cy=intrinsics.cy,
        distortion=tuple(intrinsics.distortion),
    )
    found: list[RawPicture] = []
    for layer, pixels in (("gray", frame.gray), ("depth", frame.depth)):
        if pixels is None:
            continue
        png = _png(pixels)
        parts = [png[at : at + PIECE_BYTES] for at in range(0, len(png), PIECE_BYTES)]
        found += [
            RawPicture(
                frame=frame.number,
                layer=layer,
                part=number,
                parts=len(parts),
                png=part,
                depth_unit=frame.depth_unit,
                exposure=frame.exposure,
                readout=frame.readout,
                lens=lens,
            )
            for number, part in enumerate(parts)
        ]
    return tuple(found)


def _png(pixels: Gray | DepthMap) -> bytes:
    _, data = cv2.imencode(".png", pixels)
    return bytes(data)
