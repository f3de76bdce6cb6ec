"""Streams that are only made while somebody asks for them, by subscribing to them by name.

The bus passes subscriptions on to its publishers, and takes them back when a subscriber closes or dies, so nobody has
to say that he is done. A subscription to everything, or to all of a user, asks for nothing.
"""

from __future__ import annotations

from foottrack_protocol.envelope import MAX_TOPIC_BYTES
from foottrack_protocol.topics import RAW_PREFIX, TOPICS, Role

SUBSCRIBE, UNSUBSCRIBE = b"\x01", b"\x00"
MAX_PREFIXES = 1_000
"""Anybody on the bus may make up prefixes: memory has an end."""

_STREAMS = tuple(topic.stream.encode() for topic in TOPICS.values() if topic.role is Role.RAW)
_LEAST = RAW_PREFIX.encode()


class Demand:
    """What subscribers ask for now."""

    def __init__(self) -> None:
        self._prefixes: set[bytes] = set()

    def notice(self, frame: bytes) -> None:
        """A frame that came up from the subscribers, whatever it is."""
        kind, prefix = frame[:1], frame[1:]
        if kind == UNSUBSCRIBE:
            self._prefixes.discard(prefix)
        elif kind == SUBSCRIBE and len(prefix) <= MAX_TOPIC_BYTES and len(self._prefixes) < MAX_PREFIXES:
            stream = prefix.partition(b"/")[2]
            if stream.startswith(_LEAST) and any(known.startswith(stream) for known in _STREAMS):
                self._prefixes.add(prefix)

    def wants(self, topic: str) -> bool:
        """Whether somebody asks for this stream of this user."""
        if not self._prefixes:
            return False
        raw = topic.encode()
        return any(raw.startswith(prefix) for prefix in self._prefixes)
