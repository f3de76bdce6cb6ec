"""The health board's arithmetic, without a bus."""

from __future__ import annotations

import pytest

from foottrack_protocol import DecodeError, Message, Reason, decode, encode
from foottrack_service.bus.health import HealthBoard
from foottrack_service.bus.sequence import Stats

S = 1_000_000_000


def feed(stats: Stats, seqs: range, arrival: int) -> None:
    for seq in seqs:
        stats.accept(Message("user", "imu/left", "imu-left", "a", seq, 0, 0, True, None), arrival)


def test_rates_are_of_the_last_second_and_counts_of_the_whole_time() -> None:
    board, stats = HealthBoard(), Stats()
    board.tick(0, stats)
    feed(stats, range(400), S)
    board.tick(1 * S, stats)
    feed(stats, range(410, 510), 1 * S + S // 2)
    board.tick(3 * S, stats)
    topic = board.body().topics["user/imu/left"]
    assert (topic.hz, topic.messages, topic.gaps, topic.age) == (50.0, 500, 10, 1.5)


def test_a_topic_of_refusals_alone_has_no_age() -> None:
    board, stats = HealthBoard(), Stats()
    stats.refuse(DecodeError(Reason.NOT_FINITE, "x", "user/imu/left"))
    stats.refuse(DecodeError(Reason.TOPIC, "x"))
    board.tick(0, stats)
    body = board.body()
    assert body.topics["user/imu/left"].age is None
    assert body.topics["user/imu/left"].drops == {"not_finite": 1}
    assert body.drops == {"topic": 1}


def test_latency_percentiles_are_of_the_time_since_the_last_tick() -> None:
    board, stats = HealthBoard(), Stats()
    for value in range(1, 101):
        board.latency(value * 1_000_000)
    board.tick(0, stats)
    latency = board.body().latency_ms
    assert latency is not None
    assert (latency.p50, latency.p99) == (50.0, 99.0)
    board.latency(7_000_000)
    board.tick(S, stats)
    latency = board.body().latency_ms
    assert latency is not None
    assert (latency.p50, latency.p99) == (7.0, 7.0)
    board.tick(2 * S, stats)
    assert board.body().latency_ms is None


def test_nodes_count_their_restarts_and_keep_their_error() -> None:
    board = HealthBoard()
    board.node("imu-left", "starting")
    board.node("imu-left", "running")
    board.node("imu-left", "restarting", "unplugged")
    board.node("imu-left", "running")
    board.node("imu-left", "restarting", "unplugged again")
    node = board.body().nodes["imu-left"]
    assert (node.state, node.restarts, node.error) == ("restarting", 2, "unplugged again")


def test_filters_are_reported_as_they_count() -> None:
    board = HealthBoard()
    counts = {"imu": 3}
    board.filter("user/left", counts, {"gate": 1})
    counts["imu"] = 99
    assert board.body().filters["user/left"].accepted == {"imu": 3}


@pytest.mark.parametrize("seq", [2**63 - 1])
def test_whatever_a_publisher_claims_the_report_can_be_sent(seq: int) -> None:
    board, stats = HealthBoard(), Stats()
    for sid in "abc":
        feed(stats, range(1), 0)
        stats.accept(Message("user", "imu/left", "x", sid, 0, 0, 0, True, None), 0)
        stats.accept(Message("user", "imu/left", "x", sid, seq, 0, 0, True, None), 0)
    board.tick(S, stats)
    sent = Message("sys", "health", "service", "a", 0, 0, 0, True, board.body())
    assert decode(encode(sent)).data == board.body()
