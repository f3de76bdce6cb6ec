"""Topics: ZeroMQ matches subscriptions as byte prefixes, so no topic may begin another."""

from __future__ import annotations

from itertools import pairwise, permutations

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from foottrack_protocol import TOPICS, TopicError, split_topic, topic_name
from foottrack_protocol.topics import SYSTEM, SYSTEM_TOPICS, WELCOME, is_user

USERS = st.from_regex(r"[a-z0-9][a-z0-9-]{0,31}\Z").filter(is_user)


def topics_of(*users: str) -> list[str]:
    """All topics of a bus with these users."""
    system = [topic_name(SYSTEM, stream) for stream in SYSTEM_TOPICS]
    return [*system, WELCOME.decode(), *(topic_name(user, stream) for user in users for stream in TOPICS)]


@given(USERS, USERS, st.text("abc019-", max_size=5))
def test_no_topic_begins_another(user: str, other: str, ending: str) -> None:
    longer = (user + ending)[:32]
    assume(is_user(longer))
    # As bytes, and with users that begin with one another.
    found = sorted({topic.encode() for topic in topics_of(user, other, longer)})
    assert not [(a, b) for a, b in pairwise(found) if b.startswith(a)]


def test_no_topic_begins_another_exhaustively() -> None:
    found = topics_of("user", "user2", "u", "user-", "sys2", "sy", "imu", "0")
    assert not [(a, b) for a, b in permutations(found, 2) if b.startswith(a)]


@given(USERS, st.sampled_from(sorted(TOPICS)))
def test_names_are_split_as_they_were_made(user: str, stream: str) -> None:
    assert split_topic(topic_name(user, stream)) == (user, TOPICS[stream])


@pytest.mark.parametrize("user", ["", "-a", "A", "ü", "a" * 33, "a/b", "a b", "a\n", "sys", "a_b", "²"])
def test_no_user_has_such_a_name(user: str) -> None:
    assert not is_user(user)
    with pytest.raises(TopicError):
        topic_name(user, "imu/left")


@given(st.text(max_size=40))
def test_splitting_is_total(topic: str) -> None:
    try:
        user, entry = split_topic(topic)
    except TopicError:
        return
    assert topic == f"{user}/{entry.stream}"
