"""The async client: as the blocking one, with ``async for`` and ``await``. On Windows it needs the selector loop."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncIterator, Iterable, Mapping
from contextlib import suppress
from types import TracebackType
from typing import Any, Self

import zmq
import zmq.asyncio

from foottrack_client.blocking import prefixes
from foottrack_client.clock import ANSWER_TIMEOUT_S, BURST, PERIOD_S, Clock, Exchange
from foottrack_client.endpoints import HWM, Endpoints, set_up
from foottrack_client.errors import NoAnswer, NotReady, RequestFailed
from foottrack_client.keys import Keys
from foottrack_client.publisher import Publisher
from foottrack_client.receiver import Receiver, Statistics, newest
from foottrack_client.requests import request_of, result_of
from foottrack_client.revival import PATIENCE_S, Revival
from foottrack_protocol import Message
from foottrack_protocol.messages import Session
from foottrack_protocol.topics import DEFAULT_USER, WELCOME

BATCH = 64
"""Messages taken before the event loop gets its turn: about 2 ms."""
_LOOK_S = 0.01
"""How often a publisher that waits for the bus looks whether it is there."""


class AsyncSubscription:
    """Messages of the topics asked for, in order. Belongs to one event loop."""

    def __init__(
        self,
        context: zmq.asyncio.Context,
        endpoint: str,
        prefixes: Iterable[str],
        clock: Clock,
        keys: Keys | None = None,
    ) -> None:
        self._waiting: deque[Message] = deque()
        self._socket = context.socket(zmq.SUB)
        # Awaiting each message on its own costs seven times what taking all that are there does.
        self._plain: zmq.Socket[bytes] = zmq.Socket.shadow(self._socket.underlying)
        self._receiver = Receiver(clock, self._socket.subscribe, self._socket.unsubscribe)
        set_up(self._socket, endpoint, keys)
        for prefix in (WELCOME.decode(), *prefixes):
            self._socket.subscribe(prefix)
        self._revival = Revival(self._socket, endpoint, keys is not None)
        self._socket.connect(endpoint)

    @property
    def statistics(self) -> Statistics:
        """Messages, gaps and refusals so far."""
        return self._receiver.statistics

    async def ready(self, timeout_s: float = 5.0) -> None:
        """Wait until the bus knows the subscription: nothing published after that is missed. Raises NotReady."""
        try:
            async with asyncio.timeout(timeout_s):
                while self.statistics.connections == 0:
                    await self._receive()
        except TimeoutError:
            raise NotReady(self._revival.why_not) from None

    async def receive(self) -> Message:
        """The next message."""
        while not self._waiting:
            await self._receive()
        return self._waiting.popleft()

    async def drain(self) -> list[Message]:
        """What is there now, without waiting: the newest of streams where only that counts, all of the others."""
        self._take(HWM)
        await asyncio.sleep(0)
        messages = newest(self._waiting)
        self._waiting.clear()
        return messages

    @property
    def closed(self) -> bool:
        """Whether it was closed."""
        return self._socket.closed

    def close(self) -> None:
        """Close; what was not read is lost."""
        self._revival.close()
        self._socket.close(0)

    async def __aiter__(self) -> AsyncIterator[Message]:
        while True:
            yield await self.receive()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    async def _receive(self) -> None:
        """Wait for messages and take those that are there; gives the event loop its turn."""
        while not await self._socket.poll(int(PATIENCE_S * 1000)):
            self._revival.check()
        self._take(BATCH)
        await asyncio.sleep(0)

    def _take(self, limit: int) -> None:
        for _ in range(limit):
            try:
                frames = self._plain.recv_multipart(zmq.NOBLOCK)
            except zmq.Again:
                return
            message = self._receiver.take(frames)
            if message is not None:
                self._waiting.append(message)


class AsyncClient:
    """A service's client for one event loop. Closes what it made."""

    def __init__(
        self,
        endpoints: Endpoints = Endpoints(),  # noqa: B008 - immutable
        *,
        user: str = DEFAULT_USER,
        same_host: bool = True,
        keys: Keys | None = None,
        context: zmq.Context[zmq.Socket[bytes]] | None = None,
    ) -> None:
        self.endpoints = endpoints
        self.user = user
        self.clock = Clock(same_host)
        self._keys = keys
        self._plain: zmq.Context[zmq.Socket[bytes]] = context or zmq.Context()
        self._context = zmq.asyncio.Context.shadow(self._plain)
        self._own_context = context is None
        self._made: list[AsyncSubscription | Publisher] = []

    def subscribe(self, *streams: str) -> AsyncSubscription:
        """As ``Client.subscribe``."""
        wanted = prefixes(self.user, streams)
        subscription = AsyncSubscription(self._context, self.endpoints.egress, wanted, self.clock, self._keys)
        self._made = [each for each in self._made if not each.closed]
        self._made.append(subscription)
        return subscription

    async def publisher(self, src: str, timeout_s: float = 5.0) -> Publisher:
        """A source of messages called ``src``, ready. It never blocks. Raises NotReady."""
        publisher = Publisher(self._plain, self.endpoints.ingress, src, self.user, self.clock, self._keys)
        self._made = [each for each in self._made if not each.closed]
        self._made.append(publisher)
        try:
            async with asyncio.timeout(timeout_s):
                while not publisher.live:  # noqa: ASYNC110 - only the socket itself can tell
                    await asyncio.sleep(_LOOK_S)
        except TimeoutError:
            why_not = publisher.why_not
            publisher.close(0.0)
            raise NotReady(why_not) from None
        return publisher

    async def request(self, cmd: str, timeout_s: float = 2.0, **args: Any) -> Any:
        """As ``Client.request``."""
        with self._control() as socket:
            return await self._ask(socket, cmd, args, timeout_s)

    async def hello(self) -> Session:
        """Who serves. Raises as ``request``."""
        session: Session = await self.request("hello")
        return session

    async def synchronise(self) -> bool:
        """As ``Client.synchronise``."""
        exchanges = []
        with self._control() as socket, suppress(RequestFailed):
            for _ in range(BURST):
                sent = self.clock.own()
                answer = await self._ask(socket, "time", {}, ANSWER_TIMEOUT_S)
                exchanges.append(Exchange(sent, answer.t, self.clock.own()))
        self.clock.on_burst(exchanges)
        return self.clock.is_fresh

    async def keep_synchronised(self) -> None:
        """Keep the clock until cancelled: for a client on another host than the service's."""
        session = ""
        while True:
            try:
                now = (await self.hello()).session
            except RequestFailed:
                now = session
            if now != session:
                self.clock.forget()
                session = now
            await self.synchronise()
            await asyncio.sleep(PERIOD_S)

    def close(self) -> None:
        """Close all that was made here, and the context if it is our own."""
        for made in self._made:
            made.close()
        self._made.clear()
        if self._own_context:
            self._plain.term()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _control(self) -> zmq.asyncio.Socket:
        """A new socket: one that was not answered is stuck, and nothing waits in this one for later."""
        socket = self._context.socket(zmq.REQ)
        set_up(socket, self.endpoints.control, self._keys)
        socket.connect(self.endpoints.control)
        return socket

    async def _ask(self, socket: zmq.asyncio.Socket, cmd: str, args: Mapping[str, Any], timeout_s: float) -> Any:
        try:
            async with asyncio.timeout(timeout_s):
                await socket.send(request_of(cmd, args))
                return result_of(cmd, (await socket.recv_multipart())[-1])
        except TimeoutError:
            raise NoAnswer(cmd, self.endpoints.control, timeout_s) from None
