"""``foottrack top`` and ``foottrack echo``: what is on the bus."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from typing import Annotated, NamedTuple

import typer
from rich.console import Group
from rich.live import Live
from rich.table import Table

from foottrack_protocol.messages import Health
from foottrack_service.bus.subscriber import Received, Subscriber
from foottrack_service.cli.joining import joined
from foottrack_service.cli.running import (
    CommandFailed,
    ConfigOption,
    ConnectOption,
    JsonOption,
    print_json,
    run_loop,
    settings_for,
)
from foottrack_service.config import Settings

_REDRAW_S = 0.5


class Row(NamedTuple):
    """One stream."""

    hz: float
    messages: int
    gaps: int
    age_s: float
    latency_ms: float
    """From hand-over to arrival, median of the last second."""


class StreamRates:
    """Rates and latencies per topic over a sliding second, from what a subscriber received and counts by topic."""

    def __init__(self, subscriber: Subscriber) -> None:
        self._subscriber = subscriber
        self._recent: dict[str, list[tuple[int, int]]] = {}
        self._seen: dict[str, int] = {}
        self._first: dict[str, int] = {}
        self.health: Health | None = None

    def add(self, batch: list[Received]) -> None:
        """Count a batch, and keep the last of ``sys/health``."""
        for received in batch:
            topic = received.message.topic
            if topic not in self._subscriber.stats.topics:
                # A producer that makes up users: the subscriber has stopped counting topics one by one.
                continue
            if isinstance(received.message.data, Health):
                self.health = received.message.data
            self._recent.setdefault(topic, []).append((received.arrival, received.arrival - received.message.t_pub))
            self._seen[topic] = self._seen.get(topic, 0) + 1
            self._first.setdefault(topic, received.arrival)

    def rows(self, now: int) -> dict[str, Row]:
        """Per topic, sorted by name."""
        rows: dict[str, Row] = {}
        for topic in sorted(self._recent):
            newest = self._recent[topic][-1][0]
            span = min(1_000_000_000, max(1, now - self._first[topic]))
            recent = [entry for entry in self._recent[topic] if now - entry[0] <= span]
            self._recent[topic] = recent or self._recent[topic][-1:]
            delays = sorted(delay for _, delay in self._recent[topic])
            rows[topic] = Row(
                hz=round(len(recent) / (span * 1e-9), 1),
                messages=self._seen[topic],
                gaps=self._subscriber.stats.topics[topic].gaps,
                age_s=round((now - newest) * 1e-9, 3),
                latency_ms=round(delays[len(delays) // 2] * 1e-6, 3),
            )
        return rows


def top(
    config: ConfigOption = None,
    connect: ConnectOption = None,
    seconds: Annotated[float | None, typer.Option("--seconds", min=0.1, help="End after so long.")] = None,
    as_json: JsonOption = False,
) -> None:
    """A live table of all streams: rate, gaps, age, latency; and what was dropped or refused, by whom and why.

    With --json, one snapshot after two seconds (or --seconds). Example: foottrack top
    """
    settings = settings_for(config, None, connect)
    with contextlib.suppress(KeyboardInterrupt):
        run_loop(_top(settings, seconds if seconds is not None or not as_json else 2.0, as_json))


def echo(
    topic: Annotated[str, typer.Argument(help="A topic or the beginning of one: user/pose/body, user/, sys/log.")],
    config: ConfigOption = None,
    connect: ConnectOption = None,
    count: Annotated[int | None, typer.Option("--count", "-n", min=1, help="End after so many messages.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Print one stream's messages as text; with --json, each as one line of JSON.

    Example: foottrack echo user/pose/body -n 1
    """
    settings = settings_for(config, None, connect)
    with contextlib.suppress(KeyboardInterrupt):
        run_loop(_echo(settings, topic, count, as_json))


def drops_of(health: Health | None) -> dict[str, dict[str, int]]:
    """What the service, its nodes and its filters let go, by who did and why; only what there is."""
    if health is None:
        return {}
    counts = {topic: stats.drops for topic, stats in health.topics.items()}
    counts |= {name: stats.rejected for name, stats in health.filters.items()}
    for key, count in health.drops.items():
        who, _, reason = key.rpartition("/")
        counts.setdefault(who or "bus", {})[reason] = count
    found = {who: {reason: count for reason, count in each.items() if count} for who, each in sorted(counts.items())}
    return {who: each for who, each in found.items() if each}


def drops_table(drops: dict[str, dict[str, int]]) -> Table:
    """The table of ``drops_of``."""
    table = Table(title="dropped and refused, since the service's start", title_justify="left")
    table.add_column("who", no_wrap=True)
    table.add_column("what, by reason")
    for who, counts in drops.items():
        table.add_row(who, ", ".join(f"{count} {reason}" for reason, count in sorted(counts.items())))
    return table


def rates_table(rows: dict[str, Row]) -> Table:
    """The table of ``StreamRates.rows``."""
    table = Table(title="foottrack", title_justify="left")
    table.add_column("topic", no_wrap=True)
    for name in ("Hz", "messages", "gaps", "age s", "latency ms"):
        table.add_column(name, justify="right")
    for topic, row in rows.items():
        table.add_row(topic, *map(str, row), style="red" if row.gaps else None)
    if not rows:
        table.add_row("nothing yet", "", "", "", "", "")
    return table


async def _top(settings: Settings, seconds: float | None, as_json: bool) -> None:
    async with joined(settings) as bus:
        subscriber = bus.subscriber()
        await subscriber.ready()
        rates = StreamRates(subscriber)
        end = None if seconds is None else time.monotonic() + seconds
        if as_json:
            await _collect(subscriber, rates, None, end)
            streams = {topic: row._asdict() for topic, row in rates.rows(bus.clock()).items()}
            print_json({"streams": streams, "drops": drops_of(rates.health)})
            return
        with Live(rates_table({}), refresh_per_second=4) as live:
            while end is None or time.monotonic() < end:
                until = time.monotonic() + _REDRAW_S
                await _collect(subscriber, rates, until, end)
                drops = drops_of(rates.health)
                shown = [rates_table(rates.rows(bus.clock()))] + ([drops_table(drops)] if drops else [])
                live.update(Group(*shown))


async def _collect(subscriber: Subscriber, rates: StreamRates, until: float | None, end: float | None) -> None:
    stops = [stop for stop in (until, end) if stop is not None]
    try:
        async with asyncio.timeout(max(0.0, min(stops) - time.monotonic())):
            async for batch in subscriber.batches():
                rates.add(batch)
    except TimeoutError:
        return


async def _echo(settings: Settings, topic: str, count: int | None, as_json: bool) -> None:
    from foottrack_service.bus.connection import Bus

    with Bus.connect(settings.bus) as bus:
        subscriber = bus.subscriber([topic])
        await subscriber.ready()
        left = count
        async for received in subscriber:
            message = received.message
            body = _plain(message.data)
            if as_json:
                fields = {"topic": message.topic, **message._asdict(), "data": body}
                del fields["user"], fields["stream"]
                typer.echo(json.dumps(fields))
            else:
                typer.echo(f"{message.topic} #{message.seq} t={message.t * 1e-9:.6f} {json.dumps(body)}")
            if left is not None:
                left -= 1
                if left == 0:
                    return
    raise CommandFailed("the bus went away")


def _plain(body: object) -> object:
    from foottrack_protocol.messages import Body

    return body.model_dump(mode="json") if isinstance(body, Body) else body
