"""JSON Schemas (2020-12) of bodies and whole messages, made from the models: what ``schema/`` holds.

They describe the JSON form of a message, in which bytes are base64. Beyond JSON Schema, ``unit`` names a value's unit.
What they cannot say (unit length, semidefinite covariances) the specification says.
"""

from __future__ import annotations

from typing import Any

from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue

from foottrack_protocol.envelope import PROTOCOL_MAJOR
from foottrack_protocol.topics import Topic
from foottrack_protocol.values import INT64_MAX, INT64_MIN

DIALECT = "https://json-schema.org/draft/2020-12/schema"

_STAMP = {"type": "integer", "minimum": INT64_MIN, "maximum": INT64_MAX, "unit": "ns"}
_ENVELOPE: dict[str, dict[str, Any]] = {
    "v": {"const": PROTOCOL_MAJOR, "description": "protocol major"},
    "src": {"type": "string", "description": "who published, for example `imu-left` or `fusion`"},
    "sid": {
        "type": "string",
        "description": "random id of this run of the publisher: when it changes, `seq` starts again",
    },
    "seq": {
        "type": "integer",
        "minimum": 0,
        "maximum": INT64_MAX,
        "description": "per (`src`, `sid`, topic), from 0, without gaps",
    },
    "t": {**_STAMP, "description": "when what `data` says was true, bus clock; never the arrival"},
    "t_pub": {**_STAMP, "description": "when it was handed to ZeroMQ, bus clock"},
    "valid": {"type": "boolean", "description": "the publisher's own inputs were healthy"},
    "data": {"type": "object", "description": "the body"},
}


def body_schema(body: Any) -> dict[str, Any]:
    """Schema of a body: a model, or the registry's union of some."""
    schema = TypeAdapter(body).json_schema(schema_generator=_Untitled)
    return {"$schema": DIALECT, **schema}


def envelope_schema() -> dict[str, Any]:
    """Schema of the envelope, whatever its body."""
    return {
        "$schema": DIALECT,
        "title": "Envelope",
        "description": "What every message consists of.",
        "type": "object",
        "properties": _ENVELOPE,
        "required": list(_ENVELOPE),
    }


def message_schema(entry: Topic) -> dict[str, Any]:
    """Schema of a stream's whole payload: the envelope round its body, in one piece."""
    body = body_schema(entry.body)
    definitions = body.pop("$defs", {})
    del body["$schema"]
    whole = envelope_schema()
    whole["title"] = f"foottrack.{entry.schema}"
    whole["properties"] = {**whole["properties"], "data": body}
    return {**whole, "$defs": definitions}


class _Untitled(GenerateJsonSchema):
    """Without a title for each key, which only repeats it."""

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False

    def field_is_required(self, field: Any, total: bool) -> bool:
        # A union's tag has a default for whoever makes the body in Python; on the wire it must be there.
        inner = field["schema"]
        tag = inner["type"] == "default" and inner["schema"]["type"] == "literal"
        return tag or super().field_is_required(field, total)

    def bytes_schema(self, schema: Any) -> JsonSchemaValue:
        return {"type": "string"}
