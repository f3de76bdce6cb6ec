"""The golden files, read as any other client reads them: from disk."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path
from typing import Any

import jsonschema
import msgpack
import pytest

from foottrack_protocol import TOPICS, DecodeError, Reason, decode, encode
from foottrack_protocol.control import CODE_MEANINGS, COMMANDS, Code
from foottrack_protocol.envelope import pack_map
from foottrack_protocol.errors import REASON_MEANINGS
from foottrack_protocol.generate import FOLDER
from foottrack_protocol.golden.valid import message_as_json
from foottrack_protocol.schemas import message_schema
from foottrack_protocol.topics import SYSTEM_TOPICS, split_topic


def vectors(path: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))["vectors"]
    return found


def read_schema(name: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((FOLDER / "schema" / f"{name}.json").read_text(encoding="utf-8"))
    return found


VALID = [
    pytest.param(vector, id=f"{path.stem}: {vector['name']}")
    for path in sorted((FOLDER / "vectors").rglob("*.json"))
    if path.name != "invalid.json"
    for vector in vectors(path)
]
INVALID = [vector for path in (FOLDER / "vectors").rglob("invalid.json") for vector in vectors(path)]
BEYOND_SCHEMA = re.compile(
    "quaternion (that is|of zeros|whose)|covariance (with|that|whose)|heading that is no direction"  # geometry
    "|a float for an integer|a counter that is a float"  # 1.0 is an integer in JSON
    "|jpeg as a string|bytes"  # what JSON has no bytes for
    "|users that are no strings|user with a line feed"  # the latter only for Python, whose $ is lenient
)
"""Faults of bodies, by the vector's name, that JSON Schema cannot express."""


def frames_of(vector: dict[str, Any]) -> tuple[bytes, bytes]:
    payload = bytes.fromhex(vector["payload_hex"]) + bytes(vector.get("payload_zeros", 0))
    return bytes.fromhex(vector["topic_hex"]), payload


@pytest.mark.parametrize("vector", VALID)
def test_a_valid_vector_decodes_and_can_be_sent_again(vector: dict[str, Any]) -> None:
    frames = frames_of(vector)
    message = decode(frames)
    assert message.topic == vector["topic"]
    assert message_as_json(message) == vector["message"]
    again = encode(message)
    assert (again == frames) is vector["canonical"]
    assert decode(again) == message


@pytest.mark.parametrize("vector", VALID)
def test_the_schemas_hold_for_a_valid_vector(vector: dict[str, Any]) -> None:
    _, entry = split_topic(vector["topic"])
    for name, value in ((entry.schema, vector["message"]["data"]), ("envelope", vector["message"])):
        jsonschema.validate(value, read_schema(name), cls=jsonschema.Draft202012Validator)
    jsonschema.validate(vector["message"], message_schema(entry), cls=jsonschema.Draft202012Validator)


@pytest.mark.parametrize("vector", INVALID, ids=[vector["name"] for vector in INVALID])
def test_an_invalid_vector_is_refused_for_its_reason(vector: dict[str, Any]) -> None:
    frames = [bytes.fromhex(frame) for frame in vector["frames_hex"]]
    if frames:
        frames[-1] += bytes(vector.get("last_frame_zeros", 0))
    with pytest.raises(DecodeError) as caught:
        decode(frames)
    assert caught.value.reason == vector["reason"]


def test_the_schemas_refuse_what_the_models_refuse() -> None:
    refused = 0
    for vector in INVALID:
        name = vector["name"]
        if vector["reason"] != Reason.BODY or BEYOND_SCHEMA.search(name) or name == "data is b'acc'":
            continue
        topic, payload = (bytes.fromhex(frame) for frame in vector["frames_hex"])
        _, entry = split_topic(topic.decode())
        validator = jsonschema.Draft202012Validator(read_schema(entry.schema))
        assert not validator.is_valid(_as_json(msgpack.unpackb(payload)["data"])), name
        refused += 1
    assert refused > 200


def test_every_stream_every_body_and_every_reason_has_a_vector() -> None:
    topics = {parameter.values[0]["topic"] for parameter in VALID}  # type: ignore[index]
    assert {f"user/{stream}" for stream in TOPICS} | {f"sys/{stream}" for stream in SYSTEM_TOPICS} <= topics
    assert {vector["reason"] for vector in INVALID} == set(Reason)


def test_every_schema_is_one() -> None:
    for path in (FOLDER / "schema").rglob("*.json"):
        schema = json.loads(path.read_text(encoding="utf-8"))
        jsonschema.Draft202012Validator.check_schema(schema)
    for entry in (*TOPICS.values(), *SYSTEM_TOPICS.values()):
        jsonschema.Draft202012Validator.check_schema(message_schema(entry))


def test_bytes_are_plain_base64_in_json() -> None:
    (vector,) = vectors(FOLDER / "vectors" / "camera_preview.json")
    jpeg = base64.b64decode(vector["message"]["data"]["jpeg"], validate=True)
    assert jpeg in bytes.fromhex(vector["payload_hex"])


def test_the_specifications_request_is_what_a_client_sends() -> None:
    spec = (FOLDER / "SPEC.md").read_text(encoding="utf-8")
    assert pack_map({"cmd": "hello", "args": {}}).hex(" ") in spec


def test_nothing_goes_unexplained() -> None:
    assert set(REASON_MEANINGS) == set(Reason)
    assert set(CODE_MEANINGS) == set(Code)
    assert all(command.does for command in COMMANDS.values())


def _as_json(value: Any) -> Any:
    return json.loads(json.dumps(value, default=lambda raw: base64.b64encode(raw).decode()))
