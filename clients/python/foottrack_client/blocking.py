"""The blocking client."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from types import TracebackType
from typing import Any, Self

import zmq

from foottrack_client.clock import ANSWER_TIMEOUT_S, BURST, Clock, Exchange
from foottrack_client.endpoints import HWM, Endpoints, set_up
from foottrack_client.errors import NoAnswer, NotReady, RequestFailed
from foottrack_client.keys import Keys
from foottrack_client.publisher import Publisher
from foottrack_client.receiver import Receiver, Statistics, newest
from foottrack_client.requests import request_of, result_of
from foottrack_client.revival import PATIENCE_S, Revival
from foottrack_protocol import Message
from foottrack_protocol.messages import Session
from foottrack_protocol.topics import DEFAULT_USER, SYSTEM, WELCOME

Context = zmq.Context[zmq.Socket[bytes]]


class Subscription:
    """Messages of the topics asked for, in order. An iterator that never ends by itself; belongs to one thread."""

    def __init__(
        self, context: Context, endpoint: str, prefixes: Iterable[str], clock: Clock, keys: Keys | None = None
    ) -> None:
        self._waiting: deque[Message] = deque()
        self._socket = context.socket(zmq.SUB)
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

    def wait_ready(self, timeout_s: float = 5.0) -> None:
        """Wait until the bus knows the subscription: nothing published after that is missed. Raises NotReady."""
        deadline = time.monotonic() + timeout_s
        while self.statistics.connections == 0:
            if not self._receive(deadline - time.monotonic()):
                raise NotReady(self._revival.why_not)

    def receive(self, timeout_s: float | None = None) -> Message | None:
        """The next message, or None when none came in time. Without a timeout it waits for ever."""
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        while not self._waiting:
            if not self._receive(None if deadline is None else deadline - time.monotonic()):
                return None
        return self._waiting.popleft()

    def drain(self) -> list[Message]:
        """What is there now: the newest of streams where only that counts, all of the others."""
        for _ in range(HWM):
            if not self._receive(0.0):
                break
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

    def __iter__(self) -> Iterator[Message]:
        while (message := self.receive()) is not None:
            yield message

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _receive(self, timeout_s: float | None) -> bool:
        """Read one message from the socket, whatever it is. Says whether there was one in time."""
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        wait_s = PATIENCE_S if timeout_s is None else max(0.0, min(timeout_s, PATIENCE_S))
        while not self._socket.poll(int(wait_s * 1000)):
            self._revival.check()
            if deadline is not None:
                wait_s = min(deadline - time.monotonic(), PATIENCE_S)
                if wait_s <= 0:
                    return False
        message = self._receiver.take(self._socket.recv_multipart())
        if message is not None:
            self._waiting.append(message)
        return True


class Client:
    """A service's client. Makes subscriptions and publishers, and asks. Closes what it made.

    ``clock`` is the bus clock; on another host than the service's, ``synchronise`` every 2 s keeps it. There, ``keys``
    make the connections encrypted, and ``endpoints`` are the service's encrypted ones; or a relay stands in for it.
    """

    def __init__(
        self,
        endpoints: Endpoints = Endpoints(),  # noqa: B008 - immutable
        *,
        user: str = DEFAULT_USER,
        same_host: bool = True,
        keys: Keys | None = None,
        context: Context | None = None,
    ) -> None:
        self.endpoints = endpoints
        self.user = user
        self.clock = Clock(same_host)
        self._keys = keys
        self._context: Context = context or zmq.Context()
        self._own_context = context is None
        self._made: list[Subscription | Publisher] = []

    def subscribe(self, *streams: str) -> Subscription:
        """The user's streams, such as "pose/body"; "sys/..." are the service's; none is everything of the user."""
        wanted = prefixes(self.user, streams)
        subscription = Subscription(self._context, self.endpoints.egress, wanted, self.clock, self._keys)
        self._made = [each for each in self._made if not each.closed]
        self._made.append(subscription)
        return subscription

    def publisher(self, src: str) -> Publisher:
        """A source of messages called ``src``."""
        publisher = Publisher(self._context, self.endpoints.ingress, src, self.user, self.clock, self._keys)
        self._made = [each for each in self._made if not each.closed]
        self._made.append(publisher)
        return publisher

    def request(self, cmd: str, timeout_s: float = 2.0, **args: Any) -> Any:
        """Ask; the result is the model that SPEC's section 7 names. Calibrations take up to 60 s.

        Raises RequestFailed (its answer), NoAnswer, EncodeError.
        """
        with self._control() as socket:
            return self._ask(socket, cmd, args, timeout_s)

    def hello(self) -> Session:
        """Who serves. Raises as ``request``."""
        session: Session = self.request("hello")
        return session

    def synchronise(self) -> bool:
        """Measure the offset to the service's clock once. Says whether stamps may be trusted."""
        exchanges = []
        with self._control() as socket, suppress(RequestFailed):
            for _ in range(BURST):
                sent = self.clock.own()
                answer = self._ask(socket, "time", {}, ANSWER_TIMEOUT_S)
                exchanges.append(Exchange(sent, answer.t, self.clock.own()))
        self.clock.on_burst(exchanges)
        return self.clock.is_fresh

    def close(self) -> None:
        """Close all that was made here, and the context if it is our own."""
        for made in self._made:
            made.close()
        self._made.clear()
        if self._own_context:
            self._context.term()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _control(self) -> zmq.Socket[bytes]:
        """A new socket: one that was not answered is stuck, and nothing waits in this one for later."""
        socket = self._context.socket(zmq.REQ)
        set_up(socket, self.endpoints.control, self._keys)
        socket.connect(self.endpoints.control)
        return socket

    def _ask(self, socket: zmq.Socket[bytes], cmd: str, args: Mapping[str, Any], timeout_s: float) -> Any:
        socket.send(request_of(cmd, args))
        if not socket.poll(int(timeout_s * 1000)):
            raise NoAnswer(cmd, self.endpoints.control, timeout_s)
        return result_of(cmd, socket.recv_multipart()[-1])


def prefixes(user: str, streams: Iterable[str]) -> list[str]:
    """Subscriptions for streams by the names that ``Client.subscribe`` takes."""
    return [stream if stream.startswith(SYSTEM + "/") else f"{user}/{stream}" for stream in streams or [""]]
