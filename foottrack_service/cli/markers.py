"""``foottrack markers``: a printable sheet with the tags that the settings name."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foottrack_service.cli.running import EXIT_USAGE, CommandFailed, ConfigOption, JsonOption, print_json, settings_for


def markers(
    out: Annotated[Path, typer.Option("--out", "-o", help="The PDF.")] = Path("foottrack-markers.pdf"),
    ids: Annotated[
        list[int] | None, typer.Option("--id", help="These tags instead of the settings'; needs --size. Repeatable.")
    ] = None,
    size: Annotated[float | None, typer.Option("--size", min=1.0, help="Black edge to black edge, mm.")] = None,
    dictionary: Annotated[
        str | None,
        typer.Option("--dictionary", help="Such as DICT_4X4_50 or GENERATED_3X3_4; the settings' if absent."),
    ] = None,
    paper: Annotated[str, typer.Option("--paper", help="a4 or letter.")] = "a4",
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Write the sheet. Print it at 100 %, and check the ruler on it.

    Example: foottrack markers --dictionary GENERATED_3X3_4 --id 0 --id 1 --size 80
    """
    from foottrack_service.camera.dictionaries import load_dictionary
    from foottrack_service.camera.sheet import Printed, write_sheet

    camera = settings_for(config).camera
    spec = camera.dictionary if dictionary is None else dictionary
    if ids and size is None:
        raise CommandFailed("--id needs --size in mm", EXIT_USAGE)
    configured = [*camera.targets.left.tags, *camera.targets.right.tags]
    tags = [Printed(tag.id, 1000.0 * tag.size if size is None else size) for tag in configured]
    if ids and size is not None:
        tags = [Printed(tag, size) for tag in ids]
    name = spec if isinstance(spec, str) else "custom"
    try:
        pages = write_sheet(out, load_dictionary(spec), name, tags, paper)
    except ValueError as error:
        raise CommandFailed(str(error), EXIT_USAGE) from None
    except OSError as error:
        raise CommandFailed(f"{out}: {error.strerror or error}") from None
    if as_json:
        print_json({"file": str(out), "pages": pages, "dictionary": name, "tags": [[tag.id, tag.size] for tag in tags]})
    else:
        typer.echo(f"{out}: {len(tags)} tags on {pages} page(s). Print at 100 %; the ruler must measure 100 mm.")
