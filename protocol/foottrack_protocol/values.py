"""The values that bodies are made of: numbers with their units, quaternions, covariances.

Validation is the gate that no bad number passes: floats are finite, an integer where a float is due is a float,
nothing else is coerced; integers fit into 64 signed bits; quaternions are unit within 1e-3 and normalised on receipt.
Units are part of the types and go from there into the schemas and the specification's tables.
"""

from __future__ import annotations

import math
from base64 import b64encode
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, PlainSerializer
from pydantic.types import Strict

INT64_MIN, INT64_MAX = -(2**63), 2**63 - 1
"""Range of every integer on the wire: no runtime that we meet has wider ones."""
MAX_ITEMS = 1024
"""Elements of one array or one map. It bounds what a receiver allocates for a header that lies."""
UNIT_TOLERANCE = 1e-3
"""How far the length of a quaternion or a direction may be off 1."""
SEMIDEFINITE_TOLERANCE = 1e-9
"""By how much a principal minor of a covariance scaled to a largest element of 1 may be negative."""

_T = TypeVar("_T", bound=tuple[float, ...])


def _unit_length(v: _T) -> _T:
    norm = math.hypot(*v)
    # Normalising what is already normal would change last bits and make re-encoding differ.
    if abs(norm - 1.0) <= 1e-15:
        return v
    if not abs(norm - 1.0) <= UNIT_TOLERANCE:
        raise ValueError(f"length {norm:.6g}, must be 1 within {UNIT_TOLERANCE}")
    return tuple([x / norm for x in v])  # type: ignore[return-value]


def _semidefinite(cov: tuple[float, ...]) -> tuple[float, ...]:
    scale = max(abs(c) for c in cov)
    if scale == 0.0:
        return cov
    # Scaled first: products of huge or tiny elements would overflow or vanish.
    xx, xy, xz, yy, yz, zz = (c / scale for c in cov)
    minors = (
        xx * yy - xy * xy,
        xx * zz - xz * xz,
        yy * zz - yz * yz,
        xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz),
    )
    if min(xx, yy, zz) < 0.0 or min(minors) < -SEMIDEFINITE_TOLERANCE:
        raise ValueError("covariance is not positive semidefinite")
    return cov


def _base64(value: bytes) -> str:
    return b64encode(value).decode()


def _in(unit: str) -> Any:
    return Field(json_schema_extra={"unit": unit})


Float = Annotated[float, Strict(), Field(allow_inf_nan=False)]
NotNegative = Annotated[float, Strict(), Field(allow_inf_nan=False, ge=0.0)]
NotPositive = Annotated[float, Strict(), Field(allow_inf_nan=False, le=0.0)]
Int = Annotated[int, Strict(), Field(ge=INT64_MIN, le=INT64_MAX)]
Count = Annotated[int, Strict(), Field(ge=0, le=INT64_MAX)]
Bool = Annotated[bool, Strict()]
Str = Annotated[str, Strict()]
Bin = Annotated[
    bytes,
    Strict(),
    # pydantic's own base64 is the one for URLs, which JSON Schema does not mean.
    PlainSerializer(_base64, when_used="json"),
    Field(json_schema_extra={"contentEncoding": "base64"}),
]
Counts = Annotated[dict[Str, Count], Field(max_length=MAX_ITEMS)]
Vec3 = tuple[Float, Float, Float]

Nanoseconds = Annotated[Int, _in("ns")]
Seconds = Annotated[NotNegative, _in("s")]
Length = Annotated[NotNegative, _in("m")]
Coordinate = Annotated[Float, _in("m")]
Speed = Annotated[Float, _in("m/s")]
Angle = Annotated[Float, _in("rad")]
Hertz = Annotated[NotNegative, _in("1/s")]
Position = Annotated[Vec3, _in("m")]
Velocity = Annotated[Vec3, _in("m/s")]
Acceleration = Annotated[Vec3, _in("m/s^2")]
AngularRate = Annotated[Vec3, _in("rad/s")]
Quat = Annotated[tuple[Float, Float, Float, Float], AfterValidator(_unit_length), _in("x, y, z, w")]
Direction = Annotated[Vec3, AfterValidator(_unit_length), _in("length 1")]
Cov3 = Annotated[tuple[Float, Float, Float, Float, Float, Float], AfterValidator(_semidefinite), _in("m^2")]

Side = Literal["left", "right"]
Stage = Literal["marker", "depth", "inertial", "coasting", "lost"]
Phase = Literal["stance", "ascending", "mid_swing", "descending", "terminal_swing"]


class Body(BaseModel):
    """Base of all bodies: unknown keys are ignored, so that minor versions may add some. Immutable."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy with some keys changed, validated like any other (pydantic's own is not). Raises ValidationError."""
        return type(self).model_validate({**self.__dict__, **(update or {})})


class Pose(Body):
    """Position and rotation, body to parent."""

    p: Position
    q: Quat
