"""What a receiver does with each message, without its socket: refuse, count, decode, greet."""

from __future__ import annotations

import logging
import uuid
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from foottrack_client.clock import Clock
from foottrack_protocol import DecodeError, Message, Policy, Reason, decode, split_topic
from foottrack_protocol.topics import WELCOME

MAX_TOPICS = 1_000
"""Topics that are counted one by one: a producer that makes up users must not fill the memory."""
MAX_RUNS = 4_096
"""Runs of publishers that are remembered; a forgotten one only misses its next gap."""
_LOG_PERIOD_NS = 1_000_000_000
_log = logging.getLogger(__name__)


@dataclass(slots=True)
class TopicStatistics:
    """Of one topic. ``gaps`` are messages missed, by ``seq``; ``drops`` refused ones by reason."""

    messages: int = 0
    gaps: int = 0
    drops: Counter[Reason] = field(default_factory=Counter)
    last_arrival: int | None = None
    """Bus clock, ns."""


@dataclass(slots=True)
class Statistics:
    """Of a subscription. ``drops`` are refusals that name no topic."""

    topics: dict[str, TopicStatistics] = field(default_factory=dict)
    drops: Counter[Reason] = field(default_factory=Counter)
    connections: int = 0
    """How often the bus was found: 2 after its first restart."""

    def of(self, topic: str) -> TopicStatistics:
        """The counters of one topic; beyond ``MAX_TOPICS`` they are counted and forgotten."""
        found = self.topics.get(topic)
        if found is None:
            found = TopicStatistics()
            if len(self.topics) < MAX_TOPICS:
                self.topics[topic] = found
        return found


class Receiver:
    """Takes the frames of each message in order. ``subscribe`` and ``unsubscribe`` are the socket's."""

    def __init__(self, clock: Clock, subscribe: Callable[[bytes], None], unsubscribe: Callable[[bytes], None]) -> None:
        self.statistics = Statistics()
        self._clock = clock
        self._subscribe = subscribe
        self._unsubscribe = unsubscribe
        self._token = b""
        self._last: dict[tuple[str, str, str], int] = {}
        self._last_log: int | None = None

    def take(self, frames: Sequence[bytes]) -> Message | None:
        """The message, or None for a greeting and for what is none."""
        if len(frames) == 1 and frames[0].startswith(WELCOME):
            self._greeted(frames[0])
            return None
        arrival = self._clock()
        try:
            message = decode(frames)
        except DecodeError as error:
            self._refuse(error, arrival)
            return None
        counted = self.statistics.of(message.topic)
        counted.messages += 1
        counted.last_arrival = arrival
        run = (message.topic, message.src, message.sid)
        last = self._last.get(run)
        if last is None:
            if len(self._last) >= MAX_RUNS:
                del self._last[next(iter(self._last))]
        elif message.seq > last + 1:
            counted.gaps += message.seq - last - 1
        self._last[run] = message.seq
        return message

    def _greeted(self, greeting: bytes) -> None:
        if greeting == WELCOME:
            # Those of one connection are read in order: the answer to the last says that all are in force.
            self._token = WELCOME + b"/" + uuid.uuid4().hex.encode()
            self._subscribe(self._token)
        elif greeting == self._token:
            self._unsubscribe(self._token)
            self.statistics.connections += 1

    def _refuse(self, error: DecodeError, arrival: int) -> None:
        drops = self.statistics.drops if error.topic is None else self.statistics.of(error.topic).drops
        drops[error.reason] += 1
        if self._last_log is None or arrival - self._last_log >= _LOG_PERIOD_NS:
            self._last_log = arrival
            _log.warning("refused a message: %s", error)


def newest(messages: Iterable[Message]) -> list[Message]:
    """Without those of which a newer one of the same topic follows, where the stream's policy says so."""
    kept: dict[tuple[str, int], Message] = {}
    for number, message in enumerate(messages):
        latest = split_topic(message.topic)[1].policy is Policy.LATEST
        key = (message.topic, -1 if latest else number)
        kept.pop(key, None)
        kept[key] = message
    return list(kept.values())
