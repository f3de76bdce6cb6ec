"""Receives messages from the bus: drained through the socket's file descriptor, counted, decoded."""

from __future__ import annotations

import asyncio
import logging
import time
import uuid
from collections.abc import AsyncIterator, Callable, Iterable
from typing import NamedTuple

import zmq

from foottrack_protocol.envelope import Message, decode
from foottrack_protocol.errors import DecodeError
from foottrack_protocol.topics import WELCOME, Policy
from foottrack_service.bus.clock import BusClock, now
from foottrack_service.bus.endpoints import HWM, MAX_FRAME_BYTES, Context, Socket
from foottrack_service.bus.errors import NotReady
from foottrack_service.bus.revival import Revival
from foottrack_service.bus.security import Credentials, connect, why_not
from foottrack_service.bus.sequence import Stats
from foottrack_service.bus.watch import SocketWatch

BATCH = 64
"""Messages taken from the socket before the event loop gets its turn: below 1 ms of decoding."""

_NOBLOCK = int(zmq.NOBLOCK)
_LOG_PERIOD_NS = 1_000_000_000
_log = logging.getLogger(__name__)


class Received(NamedTuple):
    """A message, when it arrived (bus clock, ns), and its two frames unchanged."""

    message: Message
    arrival: int
    raw: tuple[bytes, bytes]


class Subscriber:
    """Messages whose topic begins with one of ``topics`` ("" is all). Belongs to one thread and one event loop.

    EVERY gives each message in order; LATEST gives, each time the reader comes back, the newest of each topic.
    What cannot be decoded is counted in ``stats`` and logged at most once a second. ``connections`` counts how often
    the bus was found: 2 after its first restart.
    """

    def __init__(
        self,
        context: Context,
        endpoint: str,
        topics: Iterable[str] = ("",),
        policy: Policy = Policy.EVERY,
        clock: BusClock = now,
        credentials: Credentials | None = None,
    ) -> None:
        self.policy = policy
        self.stats = Stats()
        self.connections = 0
        self._context = context
        self._endpoint = endpoint
        self._credentials = credentials
        self._clock = clock
        self._token = b""
        self._early: list[Received] = []
        self._last_log: int | None = None
        self._socket = _socket(context, topics)
        self._revival = Revival(context, self._socket, endpoint)
        connect(self._socket, endpoint, credentials)
        self._watch = SocketWatch(self._socket, self._revival)

    async def ready(self, timeout_s: float = 5.0) -> None:
        """Wait until the bus knows the subscription: nothing published after that is missed. Raises NotReady."""
        try:
            async with asyncio.timeout(timeout_s):
                while not self._greeted():
                    await self._watch.readable()
        except TimeoutError:
            raise NotReady(await asyncio.to_thread(self._why_not)) from None

    def wait_ready(self, timeout_s: float = 5.0) -> None:
        """``ready`` without an event loop. Raises NotReady."""
        deadline = time.monotonic() + timeout_s
        while not self._greeted():
            left_ms = int((deadline - time.monotonic()) * 1000)
            if left_ms <= 0 or not self._revival.poll(left_ms):
                raise NotReady(self._why_not())

    @property
    def pending(self) -> bool:
        """Whether something waits to be read."""
        return bool(self._early) or self._watch.has_input

    def drain(self, limit: int = BATCH) -> list[Received]:
        """What is there now, without waiting; at most ``limit`` messages leave the socket."""
        received, self._early = self._early, []
        if not self._receive(received, limit):
            self._revival.check()
        return _newest(received) if self.policy is Policy.LATEST else received

    async def batches(self) -> AsyncIterator[list[Received]]:
        """What came since the last batch, never empty; gives the event loop its turn between batches.

        Ends when the subscriber is closed. LATEST reads until nothing is left before it gives the newest, so a
        reader that was held up does not work off a backlog.
        """
        while not self._socket.closed:
            batch, self._early = self._early, []
            taken = self._receive(batch, BATCH)
            if self.policy is Policy.LATEST:
                total = taken
                while taken == BATCH and total < HWM:
                    await asyncio.sleep(0)
                    batch = _newest(batch)
                    taken = self._receive(batch, BATCH)
                    total += taken
                batch = _newest(batch)
            if batch:
                yield batch
            await self._watch.readable()

    async def deliver(self, handle: Callable[[list[Received]], None]) -> None:
        """Hand each batch to ``handle`` as soon as it is there, until the subscriber is closed or ``handle`` raises.

        EVERY only. It spares the turn of the event loop that waking a coroutine takes, for the path from a sensor to
        an engine; other callbacks still get their turn between batches.
        """
        loop = asyncio.get_running_loop()
        ended: asyncio.Future[None] = loop.create_future()

        def read() -> None:
            if ended.done():
                return
            if self._socket.closed:
                ended.set_result(None)
                return
            batch, self._early = self._early, []
            try:
                taken = self._receive(batch, BATCH)
                if batch:
                    handle(batch)
            except Exception as error:
                ended.set_exception(error)
                return
            if taken == BATCH:
                loop.call_soon(read)

        self._watch.call(read)
        try:
            await ended
        finally:
            self._watch.call(None)

    async def __aiter__(self) -> AsyncIterator[Received]:
        async for batch in self.batches():
            for received in batch:
                yield received

    def subscribe(self, topic: str) -> None:
        """Ask for more: messages whose topic begins with this, too. It takes a moment until the bus knows."""
        self._socket.subscribe(topic)

    @property
    def closed(self) -> bool:
        """Whether it was closed."""
        return self._socket.closed

    def close(self) -> None:
        """Close; what was not read is lost. Iterations end."""
        if not self._socket.closed:
            self._watch.close()
            self._socket.close(0)

    def _why_not(self) -> str:
        return why_not(self._context, self._endpoint, zmq.SUB, self._credentials)

    def _greeted(self) -> bool:
        # Messages that come before the greeting are the reader's already.
        while self.connections == 0 and self._receive(self._early, 1):
            pass
        return self.connections > 0

    def _receive(self, into: list[Received], limit: int) -> int:
        """Read up to ``limit`` messages, append what can be decoded, and say how many were read."""
        taken = 0
        while taken < limit:
            try:
                frames = _read(self._socket)
            except zmq.Again:
                break
            taken += 1
            if len(frames) == 1 and frames[0].startswith(WELCOME):
                self._welcomed(frames[0])
                continue
            arrival = self._clock()
            try:
                message = decode(frames)
            except DecodeError as error:
                self._refuse(error, arrival)
                continue
            self.stats.accept(message, arrival)
            into.append(Received(message, arrival, (frames[0], frames[1])))
        return taken

    def _welcomed(self, greeting: bytes) -> None:
        if greeting == WELCOME:
            self._token = WELCOME + b"/" + uuid.uuid4().hex.encode()
            self._socket.subscribe(self._token)
        elif greeting == self._token:
            self._socket.unsubscribe(self._token)
            self.connections += 1

    def _refuse(self, error: DecodeError, arrival: int) -> None:
        self.stats.refuse(error)
        if self._last_log is None or arrival - self._last_log >= _LOG_PERIOD_NS:
            self._last_log = arrival
            _log.warning("refused a message: %s", error)


def _read(socket: Socket) -> list[bytes]:
    """One message, as ``recv_multipart`` at half its cost: a frame knows whether more follow, a socket must be asked.

    Raises zmq.Again when there is none.
    """
    frame = socket.recv(_NOBLOCK, copy=False)
    frames = [frame.bytes]
    while frame.more:
        frame = socket.recv(_NOBLOCK, copy=False)
        frames.append(frame.bytes)
    return frames


def _newest(received: Iterable[Received]) -> list[Received]:
    newest: dict[bytes, Received] = {}
    for item in received:
        topic = item.raw[0]
        newest.pop(topic, None)
        newest[topic] = item
    return list(newest.values())


def _socket(context: Context, topics: Iterable[str]) -> Socket:
    socket = context.socket(zmq.SUB)
    socket.set_hwm(HWM)
    socket.setsockopt(zmq.MAXMSGSIZE, MAX_FRAME_BYTES)
    for topic in (WELCOME.decode(), *topics):
        socket.subscribe(topic)
    return socket
