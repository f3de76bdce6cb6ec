"""What ``foottrack top`` counts."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

from foottrack_protocol import Message
from foottrack_protocol.messages import Session
from foottrack_service.bus.sequence import MAX_TOPICS, Stats
from foottrack_service.bus.subscriber import Received, Subscriber
from foottrack_service.cli.watch import StreamRates

MS = 1_000_000


def fed(rates: StreamRates, stats: Stats, user: str, seq: int, arrival: int) -> None:
    """A message as a subscriber hands it on: counted first."""
    body = cast(Any, Session.model_construct())
    message = Message(user, "gait/state", "fusion", "s", seq, arrival - MS, arrival - MS, True, body)
    stats.accept(message, arrival)
    rates.add([Received(message, arrival, (b"", b""))])


def test_rates_gaps_ages_and_latencies() -> None:
    stats = Stats()
    rates = StreamRates(cast(Subscriber, SimpleNamespace(stats=stats)))
    for seq in (*range(50), *range(52, 102)):
        fed(rates, stats, "user", seq, seq * 10 * MS)
    row = rates.rows(1015 * MS)["user/gait/state"]
    assert row.messages == 100
    assert row.gaps == 2
    assert row.hz == 98.0
    assert row.age_s == 0.005
    assert row.latency_ms == 1.0


def test_a_producer_that_makes_up_users_does_not_end_the_table() -> None:
    stats = Stats()
    rates = StreamRates(cast(Subscriber, SimpleNamespace(stats=stats)))
    for number in range(MAX_TOPICS + 50):
        fed(rates, stats, f"u{number}", 0, number * MS)
    assert len(rates.rows(2_000 * MS)) == MAX_TOPICS
