"""What a receiver counts."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from foottrack_protocol import DecodeError, Message, Reason
from foottrack_service.bus.sequence import MAX_RUNS, MAX_TOPICS, Stats


def message(seq: int, src: str = "imu-left", sid: str = "a", user: str = "user") -> Message:
    return Message(user, "imu/left", src, sid, seq, 0, 0, True, None)


def counted(*messages: Message) -> tuple[int, int]:
    stats = Stats()
    for arrival, item in enumerate(messages):
        stats.accept(item, arrival)
    topic = stats.topics["user/imu/left"]
    assert topic.last_arrival == len(messages) - 1
    return topic.messages, topic.gaps


@pytest.mark.parametrize(
    ("seqs", "gaps"),
    [([0, 1, 2], 0), ([0, 2], 1), ([5, 6, 7], 0), ([0, 10, 11, 20], 9 + 8), ([3, 4, 0, 1], 0), ([1, 1], 0)],
)
def test_gaps_are_what_is_missing_between_neighbours(seqs: list[int], gaps: int) -> None:
    assert counted(*(message(seq) for seq in seqs)) == (len(seqs), gaps)


def test_a_new_run_of_the_publisher_is_no_gap() -> None:
    assert counted(message(0), message(1), message(0, sid="b"), message(1, sid="b"), message(3, sid="b")) == (5, 1)


def test_two_runs_at_once_do_not_disturb_each_other() -> None:
    both = [item for seq in range(5) for item in (message(seq), message(seq + 100, sid="b"))]
    assert counted(*both) == (10, 0)


@given(st.sets(st.integers(0, 500), min_size=2))
def test_messages_and_gaps_make_up_the_range(seqs: set[int]) -> None:
    ordered = sorted(seqs)
    messages, gaps = counted(*(message(seq) for seq in ordered))
    assert messages + gaps == ordered[-1] - ordered[0] + 1


def test_refusals_are_counted_where_they_belong() -> None:
    stats = Stats()
    stats.refuse(DecodeError(Reason.BODY, "x", "user/imu/left"))
    stats.refuse(DecodeError(Reason.BODY, "x", "user/imu/left"))
    stats.refuse(DecodeError(Reason.FRAMES, "x"))
    assert stats.topics["user/imu/left"].drops == {"body": 2}
    assert stats.topics["user/imu/left"].last_arrival is None
    assert stats.drops == {"frames": 1}


def test_made_up_names_do_not_fill_the_memory() -> None:
    stats = Stats()
    for number in range(max(MAX_TOPICS, MAX_RUNS) + 100):
        stats.accept(message(0, sid=str(number), user=f"u{number}"), 0)
    assert len(stats.topics) == MAX_TOPICS
    assert len(stats._last) == MAX_RUNS
