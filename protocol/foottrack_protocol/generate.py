"""Writes what is derived from the registry and the models: ``schema/``, ``vectors/`` and the tables of ``SPEC.md``.

``python -m foottrack_protocol.generate [--check]``, in a checkout. With ``--check`` it writes nothing and fails when
a file is not what it would write.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from pathlib import Path
from typing import Any

from foottrack_protocol import control
from foottrack_protocol.envelope import PROTOCOL_MAJOR, PROTOCOL_MINOR
from foottrack_protocol.golden import invalid, valid
from foottrack_protocol.schemas import body_schema, envelope_schema
from foottrack_protocol.tables import TABLES
from foottrack_protocol.topics import RAW_PREFIX, SYSTEM_TOPICS, TOPICS

COMMAND = "python -m foottrack_protocol.generate"
FOLDER = Path(__file__).resolve().parents[1]
GENERATED = ("schema", "vectors")
"""Folders that hold nothing else."""

_VERSION = f"{PROTOCOL_MAJOR}.{PROTOCOL_MINOR}"
_MARKED = re.compile(
    r"(?P<begin><!-- generated: (?P<name>[a-z-]+) -->\n).*?(?P<end><!-- end of generated -->)", re.DOTALL
)


class SpecError(Exception):
    """The specification's markers and the tables do not fit."""


def files(spec: str) -> dict[str, str]:
    """Everything that is generated, by path below the protocol's folder; ``spec`` is SPEC.md as it is.

    Raises SpecError.
    """
    found = {"SPEC.md": with_tables(spec), "schema/envelope.json": _json(envelope_schema())}
    for entry in (*TOPICS.values(), *SYSTEM_TOPICS.values()):
        found[f"schema/{entry.schema}.json"] = _json(body_schema(entry.body))
    for command in control.COMMANDS.values():
        for model in (command.args, command.result):
            if model.__module__ == control.__name__:
                found[f"schema/control/{_snake(model.__name__)}.json"] = _json(body_schema(model))
    for name, goldens in valid.by_body().items():
        folder = RAW_PREFIX if _is_raw(goldens[0].topic) else ""
        found[f"vectors/{folder}{name}.json"] = _vectors([valid.as_json(golden) for golden in goldens])
    found["vectors/envelope.json"] = _vectors([valid.as_json(golden) for golden in valid.of_envelope()])
    for folder in ("", RAW_PREFIX):
        found[f"vectors/{folder}invalid.json"] = _vectors(
            [
                invalid.as_json(refused)
                for refused in invalid.refused()
                if _is_raw(refused.frames[0].decode(errors="replace") if refused.frames else "") == bool(folder)
            ]
        )
    return found


def with_tables(spec: str) -> str:
    """The specification with its tables made anew. Raises SpecError."""
    seen: list[str] = []

    def fill(match: re.Match[str]) -> str:
        name = match["name"]
        if name not in TABLES:
            raise SpecError(f"SPEC.md wants a table {name!r}, which nobody makes")
        seen.append(name)
        return f"{match['begin']}\n{TABLES[name]()}\n\n{match['end']}"

    filled = _MARKED.sub(fill, spec)
    if sorted(seen) != sorted(TABLES):
        raise SpecError(f"SPEC.md has the tables {sorted(seen)}, must have each of {sorted(TABLES)} once")
    return filled


def drift(folder: Path = FOLDER) -> list[str]:
    """What is not as it would be generated, one line each. Raises SpecError."""
    wanted = files((folder / "SPEC.md").read_text(encoding="utf-8"))
    lines = []
    for name, text in wanted.items():
        path = folder / name
        if not path.exists():
            lines.append(f"{name} is missing")
        elif path.read_text(encoding="utf-8") != text:
            lines.append(f"{name} is out of date")
    return lines + [f"{name} is not generated any more" for name in _left_over(folder, wanted)]


def write(folder: Path = FOLDER) -> list[str]:
    """Write what differs and remove what is left over; says which. Raises SpecError."""
    changes = drift(folder)
    wanted = files((folder / "SPEC.md").read_text(encoding="utf-8"))
    for name, text in wanted.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8", newline="\n")
    for name in _left_over(folder, wanted):
        (folder / name).unlink()
    return changes


def main() -> int:
    """The command line. 0: as it should be; 1: drift, with ``--check``; 2: SPEC.md cannot be filled."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="Make schemas, vectors and the specification's tables.")
    parser.add_argument("--check", action="store_true", help="write nothing; fail when something is out of date")
    check = parser.parse_args().check
    try:
        changes = drift() if check else write()
    except (SpecError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    for line in changes:
        print(line)
    if check and changes:
        print(f"Run: {COMMAND}", file=sys.stderr)
        return 1
    return 0


def _is_raw(topic: str) -> bool:
    return topic.partition("/")[2].startswith(RAW_PREFIX)


def _left_over(folder: Path, wanted: dict[str, str]) -> list[str]:
    there = (path.relative_to(folder).as_posix() for name in GENERATED for path in (folder / name).rglob("*.json"))
    return sorted(set(there) - set(wanted))


def _json(value: Any) -> str:
    return json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _vectors(items: list[dict[str, Any]]) -> str:
    # One vector a line: a change shows as the vector that changed.
    lines = ",\n".join(json.dumps(item, ensure_ascii=False, allow_nan=False) for item in items)
    return f'{{"protocol": "{_VERSION}", "vectors": [\n{lines}\n]}}\n'


def _snake(name: str) -> str:
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()


if __name__ == "__main__":
    sys.exit(main())
