"""``foottrack run`` and ``foottrack node``."""

from __future__ import annotations

import logging
from typing import Annotated

import typer

from foottrack_service.calibration.store import Store
from foottrack_service.cli.joining import joined
from foottrack_service.cli.running import CommandFailed, ConfigOption, ConnectOption, UserOption, run_loop, settings_for
from foottrack_service.config import Settings


def run(
    config: ConfigOption = None,
    user: UserOption = None,
    listen: Annotated[
        str | None, typer.Option("--listen", metavar="ADDRESS", help="First of three ports to listen on, such as 7701.")
    ] = None,
) -> None:
    """Run the service: bus, fusion, and the devices of the settings. Ctrl-C ends it.

    Example: foottrack run --config foottrack.toml
    """
    settings = settings_for(config, user, listen)
    try:
        run_loop(_serve(settings))
    except KeyboardInterrupt:
        typer.echo("Stopped.", err=True)


def node(
    name: Annotated[str, typer.Argument(help="Which node; an unknown name lists them.")],
    config: ConfigOption = None,
    user: UserOption = None,
    connect: ConnectOption = None,
) -> None:
    """Run one node in this process, on a bus that runs elsewhere. Ctrl-C ends it.

    Example: foottrack node fusion --connect tcp://127.0.0.1:7701
    """
    from foottrack_service.app import NODES

    if name not in NODES:
        raise CommandFailed(f"no node is called {name!r}; there are: {', '.join(NODES)}", 2)
    settings = settings_for(config, user, connect)
    try:
        run_loop(_one_node(name, settings))
    except KeyboardInterrupt:
        typer.echo("Stopped.", err=True)


def compile_kernels() -> None:
    """Compile now what the first start on this machine would wait for, in an image or before tests, for instance.

    Example: foottrack compile
    """
    from foottrack_service.camera import marker_tracker
    from foottrack_service.fusion import foot_filter

    foot_filter.warm_up()
    marker_tracker.say_what_takes_long()
    marker_tracker.warm_up()
    typer.echo("All is compiled.", err=True)


async def _serve(settings: Settings) -> None:
    from foottrack_service.app import NODES, Service

    async with Service(settings, Store.at_home(settings.user, settings.feet.shoes)) as service:
        ends = service.endpoints
        typer.echo(
            f"Listening: publishers {ends.ingress}, subscribers {ends.egress}, control {ends.control}. Ctrl-C ends it.",
            err=True,
        )
        if service.encrypted_endpoints:
            typer.echo(f"Encrypted: {', '.join(service.encrypted_endpoints.values())}.", err=True)
        for each in NODES.values():
            if each.wanted(settings):
                service.start(each)
        await service.failed()


async def _one_node(name: str, settings: Settings) -> None:
    from foottrack_service.app import NODES
    from foottrack_service.bus.log import BusLogHandler
    from foottrack_service.bus.timesync import SyncedClock

    async with joined(settings) as bus:
        own_clock = name == "camera" or (name == "headset" and settings.headset.source == "openxr")
        if own_clock and isinstance(bus.clock, SyncedClock):
            raise CommandFailed(f"the {name}'s stamps are of its own host's clock: run it on the service's host")
        typer.echo(f"{name} runs on {settings.bus.ingress}. Ctrl-C ends it.", err=True)
        # Its counters stay in this process: what it drops is told in sys/log.
        publisher = bus.publisher(name)
        await publisher.ready()
        telling = BusLogHandler(publisher, clock=bus.clock)
        logging.getLogger().addHandler(telling)
        try:
            await NODES[name].run(bus, settings)
        finally:
            logging.getLogger().removeHandler(telling)
