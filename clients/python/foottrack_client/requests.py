"""Requests to the service and their answers, without a socket (SPEC, section 7)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import TypeAdapter, ValidationError

from foottrack_client.errors import RequestFailed
from foottrack_protocol import DecodeError
from foottrack_protocol.control import COMMANDS
from foottrack_protocol.envelope import pack_map, unpack_map

_BAD_ANSWER = "bad_answer"


def request_of(cmd: str, args: Mapping[str, Any]) -> bytes:
    """The bytes of a request. Raises EncodeError."""
    return pack_map({"cmd": cmd, "args": dict(args)})


def result_of(cmd: str, payload: bytes) -> Any:
    """The result in an answer, as the model that the command has for it. Raises RequestFailed."""
    try:
        answer = unpack_map(payload)
        if answer.get("ok") is True:
            result = answer.get("result")
            command = COMMANDS.get(cmd)
            return result if command is None else TypeAdapter[Any](command.result).validate_python(result)
    except (DecodeError, ValidationError) as error:
        raise RequestFailed(_BAD_ANSWER, f"the answer to {cmd!r} is none: {error}") from None
    failure = answer.get("error")
    if not isinstance(failure, dict):
        raise RequestFailed(_BAD_ANSWER, f"the answer to {cmd!r} is neither a result nor an error")
    raise RequestFailed(str(failure.get("code")), str(failure.get("message")))
