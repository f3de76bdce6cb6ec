"""The bus itself: libzmq's XSUB/XPUB proxy in a thread. Nothing is forwarded in Python.

A greeter beside it answers subscriptions to ``sys/welcome/<token>``. The egress socket's own welcome says that a
connection stands, but not that its subscriptions were read: with the publisher in the broker's process and the
subscriber behind TCP, 1 message in 90 (two busy cores) to 600 (idle) that was published right after it was lost. The
egress socket reads one connection's subscriptions in order and passes each new one to all publishers, so the
greeter's answer proves that all before it are in force.
"""

from __future__ import annotations

import contextlib
import threading
import uuid
from types import TracebackType
from typing import Self

import zmq

from foottrack_protocol.topics import WELCOME
from foottrack_service.bus.door import Doorkeeper
from foottrack_service.bus.endpoints import HWM, MAX_FRAME_BYTES, Context, Socket, bind, release
from foottrack_service.bus.errors import BusError
from foottrack_service.config import BusSettings

SUBSCRIBE_ALL = b"\x01"
UNSUBSCRIBE_ALL = b"\x00"
_HOLD = 10_000
"""The ingress counts subscriptions, and the egress passes on to it whatever subscribers say: so many times one may take
back a subscription to everything that it never made, before publishers would think that the bus is gone."""
_STOP_TIMEOUT_S = 5.0


class Broker:
    """The proxy between publishers (ingress) and subscribers (egress). Starts once.

    ``endpoints`` are the actual ones after ``start`` (port 0 takes a free one); ``inproc`` are those for tasks of
    the same ``context``, which save the way through TCP. The control endpoint in both is the configured one.
    Where the settings say so, a ``doorkeeper`` opens encrypted endpoints beside the plain ones.
    A context of its own ends with ``stop``: close what was made of it before.
    """

    def __init__(self, settings: BusSettings, context: Context | None = None) -> None:
        name = uuid.uuid4().hex
        self.context: Context = context or zmq.Context()
        self.endpoints = settings
        self.inproc = settings.model_copy(
            update={"ingress": f"inproc://{name}/ingress", "egress": f"inproc://{name}/egress"}
        )
        self.doorkeeper = Doorkeeper(self.context, settings.curve) if settings.curve.listen else None
        self._own_context = context is None
        self._steering = f"inproc://{name}/steering"
        self._threads: list[threading.Thread] = []

    def start(self) -> None:
        """Bind and forward. Raises BindRefused (in the clear, not loopback), BindFailed (taken or malformed)."""
        if self._threads:
            raise BusError("this broker was started before; make a new one")
        ingress, egress, steering = (self._socket(kind) for kind in (zmq.XSUB, zmq.XPUB, zmq.PAIR))
        egress.setsockopt(zmq.XPUB_WELCOME_MSG, WELCOME)
        # Not for what it tells: without it the socket swallows a repeated subscription that is a part of a longer
        # message, and libzmq's proxy ends at the half message that remains.
        egress.setsockopt(zmq.XPUB_VERBOSER, 1)
        try:
            actual = {
                "ingress": bind(ingress, self.endpoints.ingress),
                "egress": bind(egress, self.endpoints.egress),
            }
            bind(ingress, self.inproc.ingress)
            bind(egress, self.inproc.egress)
            bind(steering, self._steering)
            encrypted: tuple[str, ...] = ("", "")
            if self.doorkeeper is not None:
                self.doorkeeper.start()
                encrypted = (self.doorkeeper.bind(ingress, "publish"), self.doorkeeper.bind(egress, "subscribe"))
        except BusError:
            for socket in (ingress, egress, steering):
                socket.close(0)
            if self.doorkeeper is not None:
                self.doorkeeper.stop()
            raise
        self.endpoints = self.endpoints.model_copy(update=actual)
        self._bound = ((actual["ingress"], encrypted[0]), (actual["egress"], encrypted[1]))
        # Before the proxy runs, so that no publisher meets an ingress that does not want everything.
        for _ in range(_HOLD):
            ingress.send(SUBSCRIBE_ALL)
        self._threads = [
            threading.Thread(target=self._proxy, args=(ingress, egress, steering), name="bus-proxy", daemon=True),
            threading.Thread(target=self._greet, name="bus-greeter", daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Stop forwarding; when this returns, the ports are free. Raises BusError when the threads do not end."""
        if any(thread.is_alive() for thread in self._threads):
            steering = self._socket(zmq.PAIR)
            steering.connect(self._steering)
            steering.send(b"TERMINATE")
            for thread in self._threads:
                thread.join(_STOP_TIMEOUT_S)
            steering.close(0)
            if any(thread.is_alive() for thread in self._threads):
                raise BusError(f"the bus did not stop within {_STOP_TIMEOUT_S:g} s")
        if self.doorkeeper is not None:
            self.doorkeeper.stop()
        if self._own_context and not self.context.closed:
            self.context.term()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def _socket(self, kind: int) -> Socket:
        socket = self.context.socket(kind)
        socket.set_hwm(HWM)
        socket.setsockopt(zmq.LINGER, 0)
        socket.setsockopt(zmq.MAXMSGSIZE, MAX_FRAME_BYTES)
        return socket

    def _proxy(self, ingress: Socket, egress: Socket, steering: Socket) -> None:
        with contextlib.suppress(zmq.ContextTerminated):
            zmq.proxy_steerable(ingress, egress, None, steering)
            release(ingress, *self._bound[0])
            release(egress, *self._bound[1])
        for socket in (ingress, egress, steering):
            socket.close(0)

    def _greet(self) -> None:
        greeter = self._socket(zmq.XPUB)
        greeter.connect(self.inproc.ingress)
        asked = SUBSCRIBE_ALL + WELCOME + b"/"
        with contextlib.suppress(zmq.ContextTerminated):
            # Frame by frame: what is part of a longer message may lack the rest. The unsubscription comes of itself
            # when the ingress closes.
            while (frame := greeter.recv()) != UNSUBSCRIBE_ALL:
                if frame.startswith(asked):
                    greeter.send(frame[1:])
        greeter.close(0)
