"""Sends messages to the bus, numbered without gaps."""

from __future__ import annotations

import asyncio
import time
import uuid
from collections import Counter
from collections.abc import Callable
from typing import Any

import zmq

from foottrack_protocol.envelope import Message, encode
from foottrack_service.bus.broker import SUBSCRIBE_ALL, UNSUBSCRIBE_ALL
from foottrack_service.bus.clock import BusClock, now
from foottrack_service.bus.demand import Demand
from foottrack_service.bus.endpoints import HWM, Context, Socket
from foottrack_service.bus.errors import NotReady
from foottrack_service.bus.revival import Revival
from foottrack_service.bus.security import Credentials, connect, why_not
from foottrack_service.bus.watch import SocketWatch

NO_BUS = "no_bus"
FULL = "full"

_NOBLOCK = int(zmq.NOBLOCK)
_NOBLOCK_MORE = int(zmq.NOBLOCK | zmq.SNDMORE)


class Publisher:
    """One source of messages. Belongs to one thread.

    ``sent`` counts messages handed to the bus, ``drops`` those that were not, by reason: "no_bus" (not ready, or the
    broker went away) and "full" (the bus does not keep up). Both leave a gap in ``seq``, so that receivers know.
    ``connections`` counts how often the bus was found: 2 after its first restart.
    """

    def __init__(
        self,
        context: Context,
        endpoint: str,
        src: str,
        clock: BusClock = now,
        healthy: Callable[[], bool] | None = None,
        credentials: Credentials | None = None,
    ) -> None:
        """``healthy`` false marks all messages ``valid: false``: a party on another host without a fresh offset."""
        self.src = src
        self.sid = uuid.uuid4().hex[:12]
        self.sent = 0
        self.drops: Counter[str] = Counter()
        self.connections = 0
        self._context = context
        self._endpoint = endpoint
        self._credentials = credentials
        self._clock = clock
        self._healthy = healthy
        self._seq: dict[tuple[str, str], int] = {}
        self._live = False
        self._demand = Demand()
        self._socket = _socket(context)
        self._revival = Revival(context, self._socket, endpoint)
        connect(self._socket, endpoint, credentials)
        self._watch = SocketWatch(self._socket, self._revival)

    @property
    def live(self) -> bool:
        """Whether the bus takes what is published now."""
        self._notice()
        if not self._live:
            self._revival.check()
        return self._live

    async def ready(self, timeout_s: float = 5.0) -> None:
        """Wait until the bus is there: nothing published after that is lost to a slow start. Raises NotReady."""
        try:
            async with asyncio.timeout(timeout_s):
                while not self.live:
                    await self._watch.readable()
        except TimeoutError:
            raise NotReady(await asyncio.to_thread(self._why_not)) from None

    def wait_ready(self, timeout_s: float = 5.0) -> None:
        """``ready`` without an event loop. Raises NotReady."""
        deadline = time.monotonic() + timeout_s
        while not self.live:
            left_ms = int((deadline - time.monotonic()) * 1000)
            if left_ms <= 0 or not self._revival.poll(left_ms):
                raise NotReady(self._why_not())

    def wanted(self, user: str, stream: str) -> bool:
        """Whether somebody asks for a raw stream: only then it is published."""
        self._notice()
        return self._live and self._demand.wants(f"{user}/{stream}")

    def publish(
        self, user: str, stream: str, t: int, data: Any, valid: bool = True, t_pub: int | None = None
    ) -> Message:
        """Publish a body that was true at ``t`` (bus clock, ns), and say the message as it was sent.

        Never blocks. Raises EncodeError, TopicError: what no receiver would take is neither sent nor numbered.
        """
        key = (user, stream)
        seq = self._seq.get(key, 0)
        if self._healthy is not None:
            valid = valid and self._healthy()
        message = Message(
            user, stream, self.src, self.sid, seq, t, self._clock() if t_pub is None else t_pub, valid, data
        )
        frames = encode(message)
        self._seq[key] = seq + 1
        self.send_frames(frames)
        return message

    def send(self, message: Message) -> bool:
        """Send a message as it is, with its own ``src``, ``sid`` and ``seq`` (replay). Raises as ``publish``.

        Its stamps are of our clock: it is not valid either while that is not healthy.
        """
        if self._healthy is not None and not self._healthy():
            message = message._replace(valid=False)
        return self.send_frames(encode(message))

    def send_frames(self, frames: tuple[bytes, bytes]) -> bool:
        """Send a message's bytes as they are. Says whether the bus took them."""
        if not self.live:
            self.drops[NO_BUS] += 1
            return False
        try:
            # XPUB takes a message's second frame whenever it took the first: its high-water mark counts messages.
            self._socket.send(frames[0], _NOBLOCK_MORE)
            self._socket.send(frames[1], _NOBLOCK)
        except zmq.Again:
            self.drops[FULL] += 1
            return False
        self.sent += 1
        return True

    @property
    def closed(self) -> bool:
        """Whether it was closed."""
        return self._socket.closed

    def close(self, linger_s: float = 1.0) -> None:
        """Close; what was sent may take so long to leave."""
        if not self._socket.closed:
            self._watch.close()
            self._socket.close(int(linger_s * 1000))

    def _why_not(self) -> str:
        return why_not(self._context, self._endpoint, zmq.XPUB, self._credentials)

    def _notice(self) -> None:
        while self._watch.has_input:
            # Frame by frame: what subscribers send comes up too, and a longer message may lack its end.
            frame = self._socket.recv(_NOBLOCK)
            if frame == SUBSCRIBE_ALL:
                self._live = True
                self.connections += 1
            elif frame == UNSUBSCRIBE_ALL:
                self._live = False
            else:
                self._demand.notice(frame)


def _socket(context: Context) -> Socket:
    socket = context.socket(zmq.XPUB)
    socket.set_hwm(HWM)
    # The pipe ends with the connection, which the socket reports as the bus's unsubscription. With the pipe kept,
    # 10,000 old samples would be held back and burst onto a bus that comes back.
    socket.setsockopt(zmq.IMMEDIATE, 1)
    socket.setsockopt(zmq.XPUB_NODROP, 1)
    return socket
