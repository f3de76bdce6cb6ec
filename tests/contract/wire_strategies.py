"""Hypothesis strategies for bodies, made from the JSON Schemas: what a schema promises, a decoder must take."""

from __future__ import annotations

import math
from typing import Any

from hypothesis import strategies as st

from foottrack_protocol.schemas import body_schema
from foottrack_protocol.topics import SYSTEM_TOPICS, TOPICS, Topic

ENTRIES: list[tuple[str, Topic]] = [
    *((f"user/{stream}", entry) for stream, entry in TOPICS.items()),
    *((f"sys/{stream}", entry) for stream, entry in SYSTEM_TOPICS.items()),
]
Strategy = st.SearchStrategy[Any]

_TEXT = st.text(st.characters(codec="utf-8"), max_size=20)
_SMALL = st.floats(-2.0, 2.0)


def bodies(entry: Topic) -> Strategy:
    """Bodies of a stream as plain maps that its schema allows, cross-key conditions included or not."""
    schema = body_schema(entry.body)
    return _value(schema, schema.get("$defs", {}))


def anything(max_leaves: int = 12) -> Strategy:
    """Any msgpack value of any shape, among them those with NaN, infinities and integers of 64 bits."""
    scalars = st.one_of(
        st.none(),
        st.booleans(),
        st.integers(-(2**63), 2**64 - 1),
        st.floats(),
        _TEXT,
        st.binary(max_size=20),
    )
    return st.recursive(
        scalars,
        lambda inner: st.lists(inner, max_size=5) | st.dictionaries(_TEXT | st.binary(max_size=5), inner, max_size=5),
        max_leaves=max_leaves,
    )


def _value(schema: dict[str, Any], definitions: dict[str, Any]) -> Strategy:
    if "$ref" in schema:
        return _value(definitions[schema["$ref"].rsplit("/", 1)[1]], definitions)
    # An anyOf beside properties is a condition on the whole map, which the caller filters.
    for choice in ("anyOf", "oneOf"):
        if choice in schema and "properties" not in schema:
            return st.one_of([_value(item, definitions) for item in schema[choice]])
    if "const" in schema:
        return st.just(schema["const"])
    if "enum" in schema:
        return st.sampled_from(schema["enum"])
    match schema["type"]:
        case "null":
            return st.none()
        case "boolean":
            return st.booleans()
        case "integer":
            return st.integers(schema.get("minimum"), schema.get("maximum"))
        case "number":
            return _number(schema)
        case "string":
            return _string(schema)
        case "array":
            return _array(schema, definitions)
        case "object":
            return _object(schema, definitions)
    raise AssertionError(f"no strategy for {schema}")


def _number(schema: dict[str, Any]) -> Strategy:
    least, most = schema.get("minimum"), schema.get("maximum")
    return st.floats(least, most, allow_nan=False, allow_infinity=False) | st.integers(
        int(least if least is not None else -(2**63)), int(most if most is not None else 2**64 - 1)
    )


def _string(schema: dict[str, Any]) -> Strategy:
    if "contentEncoding" in schema:
        return st.binary(max_size=100)
    if "pattern" in schema:
        return st.from_regex(schema["pattern"].removesuffix("$") + r"\Z")
    return _TEXT


def _array(schema: dict[str, Any], definitions: dict[str, Any]) -> Strategy:
    if "prefixItems" not in schema:
        return st.lists(_value(schema["items"], definitions), max_size=4)
    size = len(schema["prefixItems"])
    if schema.get("unit") in ("x, y, z, w", "length 1"):
        return st.lists(_SMALL, min_size=size, max_size=size).filter(lambda v: math.hypot(*v) > 0.1).map(_unit)
    if size == 6:
        return st.lists(_SMALL, min_size=9, max_size=9).map(_covariance)
    return st.tuples(*(_value(item, definitions) for item in schema["prefixItems"])).map(list)


def _object(schema: dict[str, Any], definitions: dict[str, Any]) -> Strategy:
    if "additionalProperties" in schema:
        return st.dictionaries(_TEXT, _value(schema["additionalProperties"], definitions), max_size=4)
    required = {key: _value(schema["properties"][key], definitions) for key in schema.get("required", ())}
    optional = {key: _value(v, definitions) for key, v in schema["properties"].items() if key not in required}
    return st.fixed_dictionaries(required, optional=optional)


def _unit(v: list[float]) -> list[float]:
    norm = math.hypot(*v)
    return [x / norm for x in v]


def _covariance(a: list[float]) -> list[float]:
    rows = (a[0:3], a[3:6], a[6:9])
    product = [[sum(x * y for x, y in zip(p, q, strict=True)) for q in rows] for p in rows]
    return [product[0][0], product[0][1], product[0][2], product[1][1], product[1][2], product[2][2]]
