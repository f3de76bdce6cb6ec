"""Bodies of the raw streams: what sensors gave, before anything was made of it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field
from pydantic.types import Strict

from foottrack_protocol.values import MAX_ITEMS, Bin, Body, Count, Float, Int, Length, NotNegative, Seconds, Str

Pixels = Annotated[NotNegative, Field(json_schema_extra={"unit": "px"})]


class RawImu(Body):
    """Bytes as one read of an IMU's line gave them, or one datagram. `t` is when they arrived."""

    bytes: Bin
    format: Str = Field(description="what they are, by the name that the service's settings have for it")
    source: Str = Field(description="the serial port, or `host:port` of the datagram's sender")
    connection: Count = Field(
        description="how often the service has opened the port: another number begins a new stream of bytes"
    )
    tracker: Str | None = Field(
        default=None, description="which sensor is on this foot, `MAC/number`; nil where a line has but one"
    )


class Lens(Body):
    """OpenCV's camera model of a picture as it is."""

    width: Count
    height: Count
    fx: Pixels
    fy: Pixels
    cx: Annotated[Float, Field(json_schema_extra={"unit": "px"})]
    cy: Annotated[Float, Field(json_schema_extra={"unit": "px"})]
    distortion: Annotated[tuple[Float, ...], Field(max_length=MAX_ITEMS)] = Field(
        default=(), description="0, 4, 5, 8, 12 or 14 coefficients, in OpenCV's order"
    )


class RawPicture(Body):
    """A piece of a picture, or of its depth, as the tracker got it. `t` is the mid-exposure of the middle row.

    The PNG of a layer is the `png` of its pieces in order; all pieces of a picture have the same `frame` and `t`.
    """

    frame: Int = Field(description="number of the picture, as in `marker/*`")
    layer: Literal["gray", "depth"] = Field(description="8 bit of brightness; 16 bit of depth along the optical axis")
    part: Count = Field(description="which piece, from 0")
    parts: Annotated[int, Strict(), Field(ge=1, le=MAX_ITEMS)] = Field(description="how many there are")
    png: Bin
    depth_unit: Length = Field(description="what 1 in the depth picture is; 0 there is unknown depth")
    exposure: Seconds
    readout: Seconds = Field(description="from the exposure of the first row to that of the last")
    lens: Lens
