"""The specification's tables, made from the registry, the models and the control commands."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from foottrack_protocol import control
from foottrack_protocol.envelope import MAX_DEPTH, MAX_PAYLOAD_BYTES, MAX_TOPIC_BYTES
from foottrack_protocol.errors import REASON_MEANINGS
from foottrack_protocol.golden.valid import by_body
from foottrack_protocol.schemas import body_schema, envelope_schema
from foottrack_protocol.topics import SYSTEM, SYSTEM_TOPICS, TOPICS, Topic
from foottrack_protocol.values import MAX_ITEMS, SEMIDEFINITE_TOLERANCE, UNIT_TOLERANCE


def topics() -> str:
    """All streams."""
    rows = [
        (
            f"`{SYSTEM if entry.is_system else '<user>'}/{entry.stream}`",
            f"[{_title(entry)}](#body-{entry.schema.replace('_', '-')})",
            entry.role,
            entry.publisher,
            "on events" if entry.rate_hz is None else f"{entry.rate_hz:g}",
            entry.policy,
            "yes" if entry.recorded else "no",
        )
        for entry in (*TOPICS.values(), *SYSTEM_TOPICS.values())
    ]
    return _table(("topic", "body", "role", "publisher", "rate, Hz", "policy", "recorded"), rows)


def envelope() -> str:
    """The envelope's keys."""
    return _keys(envelope_schema(), {})


def bodies() -> str:
    """Each body with the maps inside it, once."""
    parts: list[str] = []
    shown: set[str] = set()
    entries: dict[str, list[Topic]] = {}
    for entry in (*TOPICS.values(), *SYSTEM_TOPICS.values()):
        entries.setdefault(entry.schema, []).append(entry)
    for name, streams in entries.items():
        schema = body_schema(streams[0].body)
        definitions = schema.get("$defs", {})
        where = ", ".join(f"`{SYSTEM if entry.is_system else '<user>'}/{entry.stream}`" for entry in streams)
        parts.append(f'<a id="body-{name.replace("_", "-")}"></a>\n\n### {_title(streams[0])}\n\nOn {where}.')
        if "oneOf" in schema:
            kinds = ", ".join(f"`{kind}`" for kind in schema["discriminator"]["mapping"])
            parts.append(f"One of these maps; `kind` says which: {kinds}.")
        else:
            parts.append(f"{schema['description']}\n\n{_keys(schema, definitions)}")
        for inner, definition in definitions.items():
            if inner not in shown:
                shown.add(inner)
                parts.append(f"**{inner}.** {definition['description']}\n\n{_keys(definition, definitions)}")
    return "\n\n".join(parts)


def commands() -> str:
    """Requests on the control socket."""
    rows = [
        (
            f"`{name}`",
            _inline(command.args),
            _inline(command.result),
            ", ".join(f"`{code}`" for code in command.codes) or "-",
            command.does,
        )
        for name, command in control.COMMANDS.items()
    ]
    return _table(("command", "`args`", "`result`", "may fail with", "what it does"), rows)


def command_values() -> str:
    """Maps that only requests and answers have."""
    maps: dict[str, dict[str, Any]] = {}
    for command in control.COMMANDS.values():
        for model in (command.args, command.result):
            if model.__module__ == control.__name__ and model.model_fields:
                maps[model.__name__] = body_schema(model)
    return "\n\n".join(f"**{name}.** {schema['description']}\n\n{_keys(schema, {})}" for name, schema in maps.items())


def codes() -> str:
    """Error codes of answers."""
    rows = [
        (f"`{code}`", "yes" if code in control.GENERAL_CODES else "no", meaning)
        for code, meaning in control.CODE_MEANINGS.items()
    ]
    return _table(("code", "from any request", "meaning"), rows)


def reasons() -> str:
    """Why frames are refused."""
    return _table(("reason", "meaning"), [(f"`{reason}`", meaning) for reason, meaning in REASON_MEANINGS.items()])


def limits() -> str:
    """What a receiver refuses beyond."""
    rows = (
        ("frames of a message", "exactly 2"),
        ("topic", f"{MAX_TOPIC_BYTES} bytes"),
        ("payload", f"{MAX_PAYLOAD_BYTES} bytes"),
        ("levels of arrays and maps, the envelope being the first", f"{MAX_DEPTH}"),
        ("elements of one array, pairs of one map", f"{MAX_ITEMS}"),
        ("integers where an integer is due", "-2^63 to 2^63 - 1"),
        ("length of a quaternion or a direction", f"1 within {UNIT_TOLERANCE:g}"),
        (
            "principal minors of a covariance whose largest absolute value is scaled to 1",
            f"at least -{SEMIDEFINITE_TOLERANCE:g}",
        ),
    )
    return _table(("what", "limit"), rows)


def example() -> str:
    """One message as bytes."""
    golden = by_body()["truth"][0]
    topic, payload = (_hex_lines(frame) for frame in golden.frames)
    return f"```text\nframe 1\n{topic}\nframe 2\n{payload}\n```"


TABLES: dict[str, Callable[[], str]] = {
    "topics": topics,
    "envelope": envelope,
    "bodies": bodies,
    "commands": commands,
    "command-values": command_values,
    "codes": codes,
    "reasons": reasons,
    "limits": limits,
    "example": example,
}
"""By the name in the specification's markers."""


def _title(entry: Topic) -> str:
    return "Calibration" if len(entry.models) > 1 else entry.models[0].__name__


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    names = tuple(head)
    lines = [f"| {' | '.join(names)} |", f"|{'---|' * len(names)}"]
    lines += [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join(lines)


def _keys(schema: dict[str, Any], definitions: dict[str, Any]) -> str:
    required = set(schema.get("required", ()))
    rows = []
    for key, value in schema.get("properties", {}).items():
        kind, unit, nil = _type_of(value)
        if key in required:
            missing = "required"
        elif nil:
            missing = "may be nil or absent" + (f": {value['default']}" if value.get("default") is not None else "")
        else:
            missing = f"may be absent: {_default(value['default'])}"
        rows.append((f"`{key}`", kind, unit, missing, value.get("description", "")))
    return _table(("key", "type", "unit", "", "meaning"), rows)


def _default(value: Any) -> str:
    empty = not value or (isinstance(value, dict) and all(item is None for item in value.values()))
    return "empty" if isinstance(value, dict) and empty else f"{value}"


def _type_of(value: dict[str, Any]) -> tuple[str, str, bool]:
    """Type and unit of a key's value, and whether it may be nil."""
    if "anyOf" in value:
        given = [item for item in value["anyOf"] if item.get("type") != "null"]
        kind, unit, _ = _type_of(given[0])
        return kind, unit, True
    unit = value.get("unit", "")
    if "$ref" in value:
        return f"map {value['$ref'].rsplit('/', 1)[1]}", unit, False
    if "const" in value:
        return f"`{_literal(value['const'])}`", unit, False
    if "enum" in value:
        return " or ".join(f"`{_literal(item)}`" for item in value["enum"]), unit, False
    kind = value["type"]
    if kind == "array" and "prefixItems" in value:
        return f"float[{len(value['prefixItems'])}]", unit, False
    if kind == "array":
        return f"array of {_type_of(value['items'])[0]}", unit, False
    if kind == "object" and "additionalProperties" in value:
        return (
            (f"map of {_type_of(value['additionalProperties'])[0]}" if "additionalProperties" in value else "map"),
            unit,
            False,
        )
    if value.get("contentEncoding"):
        return "bin", unit, False
    names = {"number": "float", "integer": "int", "boolean": "bool", "string": "str", "object": "map"}
    return names[kind] + _range(value), unit, False


def _range(value: dict[str, Any]) -> str:
    least = value.get("minimum", value.get("exclusiveMinimum"))
    most = value.get("maximum", value.get("exclusiveMaximum"))
    least, most = (bound if bound is not None and abs(bound) < 2**62 else None for bound in (least, most))
    more, less = (">" if "exclusiveMinimum" in value else ">="), ("<" if "exclusiveMaximum" in value else "<=")
    bounds = [f"{more} {least:g}"] if least is not None else []
    bounds += [f"{less} {most:g}"] if most is not None else []
    return f" {', '.join(bounds)}" if bounds else ""


def _literal(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else f"{value}"


def _inline(model: Any) -> str:
    if not model.model_fields:
        return "-"
    if model.__module__ == control.__name__:
        return model.__name__ if len(model.model_fields) > 1 else f"`{{{next(iter(model.model_fields))}}}`"
    return f"{model.__name__}"


def _hex_lines(raw: bytes) -> str:
    rows = [(at, raw[at : at + 16]) for at in range(0, len(raw), 16)]
    return "\n".join(f"  {at:04x}  {row.hex(' '):<47}  {_printable(row)}" for at, row in rows)


def _printable(raw: bytes) -> str:
    return "".join(chr(byte) if 32 <= byte < 127 else "." for byte in raw)
