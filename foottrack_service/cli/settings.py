"""``foottrack config``: a commented settings file, and which setting came from where."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer
from pydantic import BaseModel
from rich.console import Console
from rich.table import Table

from foottrack_service.cli.running import CommandFailed, ConfigOption, JsonOption, load_calibrated, print_json
from foottrack_service.config import DEFAULT_FILE, Settings, toml_value

app = typer.Typer(no_args_is_help=True, help="Settings: write a commented file, or see what is in force.")

_HEAD = """\
# Settings of foottrack. What is commented out is at its default.
# Flags and the environment (FOOTTRACK_BODY__HEIGHT=1.82) go before what stands here.
"""


@app.command("init")
def init(
    file: Annotated[Path, typer.Argument(help="Where to write it.")] = DEFAULT_FILE,
    force: Annotated[bool, typer.Option("--force", help="Overwrite a file that is there.")] = False,
) -> None:
    """Write a settings file with every setting, its default and what it means, commented out.

    Example: foottrack config init
    """
    if file.exists() and not force:
        raise CommandFailed(f"{file} exists already; --force overwrites it")
    file.write_text(commented(Settings()), encoding="utf-8")
    typer.echo(f"Wrote {file}. Uncomment what you change; see it with: foottrack config check")


@app.command("check")
def check(
    config: ConfigOption = None,
    everything: Annotated[bool, typer.Option("--all", help="Defaults as well.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Check the settings and show where each comes from: a flag, the environment, calibration, a file, or the default.

    Example: foottrack config check --all
    """
    loaded = load_calibrated(config)
    values = _flat(loaded.settings.model_dump(mode="json"))
    rows = {
        key: {"value": value, "from": _origin(key, loaded.origins)}
        for key, value in values.items()
        if everything or _origin(key, loaded.origins) != "default"
    }
    if as_json:
        print_json({"settings": rows, "hash": loaded.settings.digest})
        return
    table = Table(title=f"Settings in force (hash {loaded.settings.digest})", title_justify="left")
    for name in ("setting", "value", "from"):
        table.add_column(name)
    for key, row in rows.items():
        table.add_row(key, json.dumps(row["value"]), str(row["from"]))
    Console().print(table)
    if not rows:
        typer.echo("Everything is at its default; --all shows it.")


def commented(settings: Settings) -> str:
    """All settings as TOML in which every value is commented out, with its description."""
    return _HEAD + "\n".join(_section(settings, ())) + "\n"


def _section(section: BaseModel, path: tuple[str, ...]) -> list[str]:
    lines: list[str] = []
    below: list[str] = []
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if isinstance(value, BaseModel):
            below += _section(value, (*path, name))
            continue
        if field.description:
            lines.append(f"# {field.description}")
        plain = section.model_dump(mode="json", include={name})[name]
        lines.append(f"# {name} = " + ("..." if plain is None else toml_value(plain)))
    # A table whose keys are required may not stand there empty.
    optional = not any(field.is_required() for field in type(section).model_fields.values())
    head = ["", f"{'' if optional else '# '}[{'.'.join(path)}]"] if path and lines else []
    return [*head, *lines, *below]


def _flat(values: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, dict):
            flat.update(_flat(value, f"{prefix}{key}."))
        else:
            flat[prefix + key] = value
    return flat


def _origin(key: str, origins: dict[str, str]) -> str:
    return next((layer for place, layer in origins.items() if key == place or key.startswith(place + ".")), "default")
