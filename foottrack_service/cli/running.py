"""How a command runs: its settings, its event loop, Ctrl-C, and errors in one helpful line."""

from __future__ import annotations

import asyncio
import gc
import json
import logging
import signal
import sys
from collections.abc import Coroutine, Mapping
from pathlib import Path
from typing import Annotated, Any, NoReturn, TypeVar

import typer

from foottrack_service.calibration.store import Store
from foottrack_service.config import BusSettings, Loaded, Settings, load

T = TypeVar("T")

EXIT_FAILED = 1
EXIT_USAGE = 2

ConfigOption = Annotated[
    Path | None,
    typer.Option("--config", "-c", help="Settings file; foottrack.toml of this folder is taken when it is there."),
]
UserOption = Annotated[
    str | None, typer.Option("--user", help="Whose topics: <user>/...; the settings' user if absent.")
]
ConnectOption = Annotated[
    str | None,
    typer.Option(
        "--connect",
        metavar="ADDRESS",
        help="The bus: its first port, such as 7701 or tcp://127.0.0.1:7701; the two after it are used as well.",
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")]


class CommandFailed(Exception):
    """What a person should read, and the exit code."""

    def __init__(self, text: str, code: int = EXIT_FAILED) -> None:
        super().__init__(text)
        self.code = code


def settings_for(config: Path | None, user: str | None = None, bus: str | None = None, **sections: Any) -> Settings:
    """Settings with a command's flags on top. Raises ConfigError."""
    flags: dict[str, Any] = {name: values for name, values in sections.items() if values}
    if user is not None:
        flags["user"] = user
    if bus is not None:
        flags["bus"] = BusSettings.beginning_at(bus).model_dump(exclude={"curve"})
    return load_calibrated(config, flags).settings


def load_calibrated(config: Path | None, flags: Mapping[str, Any] | None = None) -> Loaded:
    """Settings with what calibration kept for their user and shoes. Raises ConfigError."""
    plain = load(config, flags).settings
    return load(config, flags, Store.at_home(plain.user, plain.feet.shoes).layer())


def run_loop(work: Coroutine[Any, Any, T]) -> T:
    """Run to the end on a loop that can watch descriptors. Ctrl-C and SIGTERM cancel the work, which cleans up.

    Raises KeyboardInterrupt after that, so that a command can end as one that was told to.
    """
    with asyncio.Runner(loop_factory=asyncio.SelectorEventLoop) as runner:
        return runner.run(_until_told(work))


def collect_seldom() -> None:
    """For this process, from its beginning: cycles among objects are looked for seldom.

    Messages are many small objects without cycles: looking for some after every 700 of them costs a replay 7 % and a
    live pose its p99.
    """
    gc.freeze()
    gc.set_threshold(50_000, 20, 50)


def print_json(values: Any) -> None:
    """One JSON object on standard output; what is not finite is null."""
    typer.echo(json.dumps(_finite(values), indent=2 if sys.stdout.isatty() else None))


def set_up_logging(verbose: bool) -> None:
    """Log to standard error, through rich where a person reads it: ours, and the libraries' warnings."""
    from rich.console import Console
    from rich.logging import RichHandler

    handler: logging.Handler
    if sys.stderr.isatty():
        handler = RichHandler(console=Console(stderr=True), show_path=False)
        handler.setFormatter(logging.Formatter("%(message)s"))
    else:
        handler = logging.StreamHandler()
        handler.setFormatter(logging.Formatter("%(levelname)s %(name)s: %(message)s"))
    logging.basicConfig(level=logging.WARNING, handlers=[handler], force=True)
    for ours in ("foottrack_service", "foottrack_protocol", "foottrack_client"):
        logging.getLogger(ours).setLevel(logging.DEBUG if verbose else logging.INFO)


def fail(text: str, code: int = EXIT_FAILED) -> NoReturn:
    """End the command with a line on standard error."""
    typer.secho(f"foottrack: {text}", fg=typer.colors.RED, err=True)
    raise SystemExit(code)


async def _until_told(work: Coroutine[Any, Any, T]) -> T:
    """SIGTERM is taken like Ctrl-C, also where a shell started us in the background with SIGINT ignored."""
    loop = asyncio.get_running_loop()
    task = asyncio.ensure_future(work)
    terminated = False

    def terminate() -> None:
        nonlocal terminated
        terminated = True
        task.cancel()

    before = signal.signal(signal.SIGTERM, lambda *_: loop.call_soon_threadsafe(terminate))
    try:
        return await task
    except asyncio.CancelledError:
        if terminated:
            raise KeyboardInterrupt from None
        raise
    finally:
        signal.signal(signal.SIGTERM, before)


def _finite(values: Any) -> Any:
    if isinstance(values, dict):
        return {key: _finite(value) for key, value in values.items()}
    if isinstance(values, list | tuple):
        return [_finite(value) for value in values]
    if isinstance(values, float) and not (abs(values) < float("inf")):
        return None
    return values
