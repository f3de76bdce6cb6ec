"""``foottrack keys`` and ``foottrack relay``: connections between hosts."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foottrack_service.cli.running import (
    EXIT_USAGE,
    CommandFailed,
    ConfigOption,
    JsonOption,
    print_json,
    run_loop,
    settings_for,
)
from foottrack_service.config import BusSettings

app = typer.Typer(no_args_is_help=True, help="Keys for encrypted connections between hosts (CURVE).")

_SERVICE = "service"


@app.command()
def new(
    names: Annotated[
        list[str] | None, typer.Argument(help="Whose keys: files are called NAME.key and NAME.key_secret.")
    ] = None,
    folder: Annotated[Path, typer.Option("--folder", help="Where they go.")] = Path("keys"),
    as_json: JsonOption = False,
) -> None:
    """Make a pair of keys for the service and one for each client, and say what to write into the settings.

    A secret key never leaves its host, except to the client that it was made for. Examples: foottrack keys new;
    foottrack keys new headset tablet
    """
    from foottrack_service.bus.security import PUBLIC_SUFFIX, SECRET_SUFFIX, new_keys

    chosen = names or [_SERVICE, "client"]
    for name in chosen:
        if not name.replace("-", "").replace("_", "").isalnum():
            raise CommandFailed(f"{name!r} is no name for a file: letters, digits, '-' and '_'", EXIT_USAGE)
    made = {name: new_keys(folder, name) for name in chosen}
    files = {name: (folder / f"{name}{PUBLIC_SUFFIX}", folder / f"{name}{SECRET_SUFFIX}") for name in chosen}
    if as_json:
        print_json(
            {
                name: {"public": keys.public, "public_file": str(files[name][0]), "secret_file": str(files[name][1])}
                for name, keys in made.items()
            }
        )
        return
    for public, secret in files.values():
        typer.echo(f"Wrote {public} and {secret}.", err=True)
    clients = [name for name in chosen if name != _SERVICE]
    typer.echo("# foottrack.toml of the service\n[bus.curve]")
    typer.echo(f'secret = "{files.get(_SERVICE, [folder / f"{_SERVICE}{SECRET_SUFFIX}"])[-1].as_posix()}"')
    typer.echo('listen = "tcp://0.0.0.0:7711"')
    for name in clients:
        typer.echo(
            f'[[bus.curve.clients]]\nname = "{name}"\nkey = "{made[name].public}"\n'
            'roles = ["publish", "subscribe", "control"]'
        )
    for name in clients:
        known = made[_SERVICE].public if _SERVICE in made else "the service's public key"
        typer.echo(
            f"\n# foottrack.toml of {name}, for `foottrack relay HOST:7711`\n[bus.curve]\n"
            f'secret = "{files[name][1].as_posix()}"\nservice = "{known}"'
        )


def relay(
    service: Annotated[str, typer.Argument(help="First encrypted port of the service, as in tcp://192.168.1.20:7711.")],
    config: ConfigOption = None,
    listen: Annotated[
        str | None, typer.Option("--listen", metavar="ADDRESS", help="First of three local ports, such as 7701.")
    ] = None,
) -> None:
    """Stand in for a service on another host: encrypted to there, plain on this host's loopback.

    Keys are in the settings: [bus.curve] secret and service. Example: foottrack relay tcp://192.168.1.20:7711
    """
    settings = settings_for(config, None, listen).bus
    if settings.curve.service is None:
        raise CommandFailed("a relay needs keys: [bus.curve] secret and service. Make them with: foottrack keys new")
    remote = BusSettings.beginning_at(service).model_copy(update={"curve": settings.curve})
    try:
        run_loop(_relay(remote, settings))
    except KeyboardInterrupt:
        typer.echo("Stopped.", err=True)


async def _relay(remote: BusSettings, local: BusSettings) -> None:
    from foottrack_service.relay import Relay

    with Relay(remote, local) as relay:
        ends = relay.endpoints
        typer.echo(
            f"Listening: publishers {ends.ingress}, subscribers {ends.egress}, control {ends.control}, "
            f"for the service at {remote.ingress}. Ctrl-C ends it.",
            err=True,
        )
        await relay.run()
