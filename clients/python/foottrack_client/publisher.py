"""Publishes one user's streams, numbered without gaps. Never blocks, so it serves blocking and async clients alike."""

from __future__ import annotations

import uuid
from collections import Counter
from types import TracebackType
from typing import Any, Self

import zmq

from foottrack_client.clock import Clock
from foottrack_client.endpoints import set_up
from foottrack_client.errors import NotReady
from foottrack_client.keys import Keys
from foottrack_client.revival import PATIENCE_S, Revival
from foottrack_protocol import Message, encode

_SUBSCRIBE_ALL = b"\x01"
_UNSUBSCRIBE_ALL = b"\x00"


class Publisher:
    """One source of messages. Belongs to one thread.

    ``sent`` counts messages handed to the bus; ``drops`` those that were not, by reason: "no_bus", "full". Those leave
    a gap in ``seq``.
    """

    def __init__(
        self,
        context: zmq.Context[zmq.Socket[bytes]],
        endpoint: str,
        src: str,
        user: str,
        clock: Clock,
        keys: Keys | None = None,
    ) -> None:
        self.sent = 0
        self.drops: Counter[str] = Counter()
        self._src = src
        self._sid = uuid.uuid4().hex[:12]
        self._user = user
        self._clock = clock
        self._seq: Counter[str] = Counter()
        self._live = False
        self._socket = context.socket(zmq.XPUB)
        set_up(self._socket, endpoint, keys)
        # The socket reports a lost bus instead of keeping stale samples for it, and a full queue instead of dropping.
        self._socket.setsockopt(zmq.IMMEDIATE, 1)
        self._socket.setsockopt(zmq.XPUB_NODROP, 1)
        self._revival = Revival(self._socket, endpoint, keys is not None)
        self._socket.connect(endpoint)

    @property
    def live(self) -> bool:
        """Whether the bus takes what is published now."""
        while self._socket.poll(0):
            # Frame by frame: what subscribers send comes up too, and a longer message may lack its end.
            frame = self._socket.recv(zmq.NOBLOCK)
            if frame == _SUBSCRIBE_ALL:
                self._live = True
            elif frame == _UNSUBSCRIBE_ALL:
                self._live = False
        if not self._live:
            self._revival.check()
        return self._live

    @property
    def why_not(self) -> str:
        """Why the bus is not there, for a person."""
        return self._revival.why_not

    def wait_ready(self, timeout_s: float = 5.0) -> None:
        """Wait until the bus is there: nothing published after that is lost to a slow start. Raises NotReady."""
        deadline = self._clock.own() + int(timeout_s * 1e9)
        while not self.live:
            left_ms = (deadline - self._clock.own()) // 1_000_000
            if not self._socket.poll(max(0, min(left_ms, int(PATIENCE_S * 1000)))) and left_ms <= 0:
                raise NotReady(self.why_not)

    def publish(self, stream: str, data: Any, *, t: int | None = None, valid: bool = True) -> bool:
        """Publish a body that was true at ``t`` (bus clock, ns; now if absent). Says whether the bus took it.

        Raises EncodeError, TopicError: what no receiver would take is neither sent nor numbered.
        """
        now = self._clock()
        message = Message(
            self._user,
            stream,
            self._src,
            self._sid,
            self._seq[stream],
            now if t is None else t,
            now,
            valid and self._clock.is_fresh,
            data,
        )
        frames = encode(message)
        self._seq[stream] += 1
        if not self.live:
            self.drops["no_bus"] += 1
            return False
        try:
            self._socket.send_multipart(frames, zmq.NOBLOCK)
        except zmq.Again:
            self.drops["full"] += 1
            return False
        self.sent += 1
        return True

    @property
    def closed(self) -> bool:
        """Whether it was closed."""
        return self._socket.closed

    def close(self, linger_s: float = 1.0) -> None:
        """Close; what was sent may take so long to leave."""
        self._revival.close()
        self._socket.close(int(linger_s * 1000))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
