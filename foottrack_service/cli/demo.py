"""``foottrack demo``: the whole pipeline on simulated hardware, with the errors against the simulation's truth."""

from __future__ import annotations

import asyncio
import sys
from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.console import Console, Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table

from foottrack_protocol import Message
from foottrack_protocol.frames import SIDES
from foottrack_service.bus.clock import now
from foottrack_service.bus.subscriber import Received
from foottrack_service.cli.running import (
    EXIT_USAGE,
    CommandFailed,
    ConfigOption,
    JsonOption,
    print_json,
    run_loop,
    settings_for,
)
from foottrack_service.cli.watch import StreamRates, rates_table
from foottrack_service.config import Settings
from foottrack_service.evaluation.statistics import summary_mm

if TYPE_CHECKING:
    from foottrack_service.app import Service
    from foottrack_service.demo.hardware import Hardware
    from foottrack_service.simulation.scenario import Scenario

_REDRAW_S = 0.25
_LEADS_S = (3.0, 8.0, 20.0)
"""From the service's start to the scenario's: the camera's process needs it to get going. Tried until all runs."""


def demo(
    seconds: Annotated[float, typer.Option("--seconds", min=2.0, help="How long.")] = 20.0,
    task: Annotated[str, typer.Option("--task", help="What the simulated person does; an unknown one lists them.")] = (
        "walk-in-place"
    ),
    seed: Annotated[int, typer.Option("--seed", min=0, help="Another seed is another person with other noise.")] = 1,
    imu_hz: Annotated[
        float, typer.Option("--imu-hz", min=20.0, max=1000.0, help="Rate of the simulated IMUs.")
    ] = 100.0,
    camera: Annotated[
        str,
        typer.Option(
            "--camera", help="rendered (drawn pictures, really searched), simulated (finds made up), or none."
        ),
    ] = "rendered",
    record: Annotated[Path | None, typer.Option("--record", help="Write a recording (MCAP) as well.")] = None,
    listen: Annotated[
        str | None,
        typer.Option("--listen", metavar="ADDRESS", help="First of three ports, such as 7701; 0 is free ones."),
    ] = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Track two simulated feet, live, and say how far off they were. Engines can connect meanwhile.

    The hardware is simulated, all behind it is real: IMU bytes come from serial ports, the headset sends datagrams,
    pictures are searched. Example: foottrack demo --seconds 30 --task walk --record walk.mcap
    """
    settings = settings_for(config, None, listen)
    watched = Watched()
    try:
        scenario, hardware = _plugged_in(settings, task, seed, seconds, imu_hz, camera)
        with hardware:
            run_loop(_demo(scenario, hardware, record, watched, quiet=as_json))
    except KeyboardInterrupt:
        typer.echo("Stopped early.", err=True)
    results = watched.results()
    if as_json:
        print_json(results)
    else:
        _show(results, settings.user, record)


class Watched:
    """What a subscriber of the demo saw."""

    def __init__(self) -> None:
        self.streams: dict[str, dict[str, float]] = {}
        self.seconds = 0.0
        self._truth: dict[str, list[Message]] = defaultdict(list)
        self._poses: list[Message] = []
        self._latencies: list[int] = []
        self._imu_published: int | None = None

    def add(self, batch: list[Received]) -> None:
        """Keep what the errors and latencies are computed from."""
        for received in batch:
            message = received.message
            if message.stream.startswith("imu/"):
                self._imu_published = message.t_pub
            elif message.stream.startswith("truth/"):
                self._truth[message.stream].append(message)
            elif message.stream == "pose/body":
                self._poses.append(message)
                if self._imu_published is not None:
                    self._latencies.append(received.arrival - self._imu_published)
                    self._imu_published = None

    def results(self) -> dict[str, Any]:
        """The object that ``--json`` prints."""
        latency = np.percentile(np.array(self._latencies) * 1e-6, [50, 99]) if self._latencies else (None, None)
        return {
            "seconds": round(self.seconds, 3),
            "streams": self.streams,
            "error_mm": {side: self._errors(side) for side in SIDES},
            "latency_ms": {
                name: None if value is None else round(float(value), 3)
                for name, value in zip(("p50", "p99"), latency, strict=True)
            },
        }

    def _errors(self, side: str) -> dict[str, float | None]:
        from foottrack_service.evaluation.truth import TruthTrack

        truth = self._truth[f"truth/{side}"]
        feet = [(pose.t, getattr(pose.data, side)) for pose in self._poses]
        # A foot that no camera has seen yet stands where it was put: there is nothing to compare.
        seen = [(t, foot.ankle.p) for t, foot in feet if foot is not None and foot.age is not None]
        if len(truth) < 4 or not seen:
            return summary_mm(np.array([]))
        track = TruthTrack([m.t for m in truth], [m.data.p for m in truth], [m.data.q for m in truth])
        t = np.array([stamp for stamp, _ in seen])
        covered = track.covers(t)
        p = np.array([place for _, place in seen])[covered]
        return summary_mm(np.linalg.norm(p - track.position(t[covered]), axis=1))


def _plugged_in(
    settings: Settings, task: str, seed: int, seconds: float, imu_hz: float, camera: str
) -> tuple[Scenario, Hardware]:
    from foottrack_service.camera.frame import SourceError
    from foottrack_service.cli.sim import scenario_for
    from foottrack_service.demo.hardware import PICTURES, Hardware
    from foottrack_service.fusion import foot_filter

    if camera not in PICTURES:
        raise CommandFailed(f"--camera is {', '.join(PICTURES)}, not {camera!r}", EXIT_USAGE)
    # Now, since the scenario's time runs once the service starts.
    with Console(stderr=True).status("getting the filter and the tracker ready ..."):
        foot_filter.warm_up()
        if camera == "rendered":
            from foottrack_service.camera import marker_tracker

            marker_tracker.say_what_takes_long()
            marker_tracker.warm_up()
    finds = {"camera": camera == "simulated"}
    scenario = scenario_for(task, seed, settings, seconds=seconds, imu_hz=imu_hz, **finds)
    try:
        return scenario, Hardware(scenario, settings, imu_hz, camera)
    except (SourceError, OSError) as error:
        raise CommandFailed(str(error)) from None


async def _demo(scenario: Scenario, hardware: Hardware, record: Path | None, watched: Watched, quiet: bool) -> None:
    from foottrack_service.app import Service, recorder_node

    for lead_s in _LEADS_S:
        start = now() + round(lead_s * 1e9)
        async with Service(hardware.found_by(start)) as service:
            if not await _all_running(service, hardware, start) and lead_s != _LEADS_S[-1]:
                continue
            if record is not None:
                service.start(recorder_node(record))
                await service.running("recorder")
            await _play(service, scenario, hardware, start, watched, quiet)
            return


async def _all_running(service: Service, hardware: Hardware, start: int) -> bool:
    """Start what the settings name, and say whether all of it ran in time: devices that send too early go unheard."""
    from foottrack_service.app import NODES

    for node in NODES.values():
        if node.wanted(service.settings):
            service.start(node)
    await service.running("fusion")
    try:
        async with asyncio.timeout((start - now()) * 1e-9):
            for name in hardware.nodes:
                await service.running(name)
    except TimeoutError:
        return False
    return True


async def _play(
    service: Service, scenario: Scenario, hardware: Hardware, start: int, watched: Watched, quiet: bool
) -> None:
    subscriber = service.bus.subscriber()
    await subscriber.ready()
    rates = StreamRates(subscriber)
    play = asyncio.ensure_future(hardware.play(service.bus, start))
    console = Console(stderr=True)
    shown = Live(console=console, auto_refresh=False, transient=True) if not quiet and sys.stderr.isatty() else None
    if not quiet:
        console.print(f"{scenario.task}, {scenario.seconds:g} s, publishers on {service.endpoints.ingress} ...")
        for note in hardware.notes:
            console.print(note)
    try:
        if shown is not None:
            shown.start()
        await _watch(subscriber, play, rates, watched, shown, start, scenario.seconds)
    finally:
        if shown is not None:
            shown.stop()
        ended = now()
        watched.seconds = max(0.001, (ended - start) * 1e-9)
        watched.streams = {
            topic: {"hz": round(row.messages / watched.seconds, 1), "gaps": row.gaps}
            for topic, row in rates.rows(ended).items()
        }
        play.cancel()
        await asyncio.gather(play, return_exceptions=True)


async def _watch(
    subscriber: Any,
    play: asyncio.Future[Any],
    rates: StreamRates,
    watched: Watched,
    shown: Live | None,
    start: int,
    seconds: float,
) -> None:

    loop = asyncio.get_running_loop()
    redraw = loop.time()
    batches = aiter(subscriber.batches())
    pending = asyncio.ensure_future(anext(batches))
    try:
        while not play.done():
            await asyncio.wait({play, pending}, return_when=asyncio.FIRST_COMPLETED)
            if pending.done():
                batch = pending.result()
                rates.add(batch)
                watched.add(batch)
                pending = asyncio.ensure_future(anext(batches))
            if shown is not None and loop.time() >= redraw:
                redraw = loop.time() + _REDRAW_S
                t = now()
                done = min(1.0, max(0.0, (t - start) * 1e-9 / seconds))
                bar = ProgressBar(total=1.0, completed=done, width=60)
                shown.update(Group(rates_table(rates.rows(t)), bar), refresh=True)
    finally:
        pending.cancel()
        await asyncio.gather(pending, return_exceptions=True)
    play.result()


def _show(results: dict[str, Any], user: str, record: Path | None) -> None:
    console = Console()
    table = Table(title=f"Error of the ankle against the truth, mm ({results['seconds']:.0f} s)", title_justify="left")
    table.add_column("foot")
    for name in ("mean", "median", "p95", "max"):
        table.add_column(name, justify="right")
    for side, errors in results["error_mm"].items():
        table.add_row(side, *("-" if value is None else f"{value:.1f}" for value in errors.values()))
    console.print(table)
    for side, errors in results["error_mm"].items():
        if errors["mean"] is None:
            seen = results["streams"].get(f"{user}/marker/{side}", {"hz": 0.0})["hz"]
            console.print(
                f"The {side} foot was seen {seen:g} times a second, which is not enough to know where it is. On a busy "
                "machine: --camera simulated."
            )
    latency = results["latency_ms"]
    if latency["p50"] is not None:
        console.print(f"IMU sample published -> pose at a subscriber: {latency['p50']} ms p50, {latency['p99']} ms p99")
    gaps = sum(stream["gaps"] for stream in results["streams"].values())
    console.print(f"{len(results['streams'])} streams, {gaps} messages lost.")
    if record is not None:
        console.print(f"Recorded to {record}. Look at it with: foottrack log info {record}")
