"""A service on another host as if it were here: CURVE towards it, plain ZMTP on this host's loopback.

Messages go through libzmq's proxies unchanged, in both directions; so do subscriptions and the bus's greetings, and a
local party sees the bus when, and only when, the whole way stands. Requests go through as well, except ``time``,
which is answered here from an offset that is measured all the time: local parties synchronise over loopback.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import threading
import uuid
from types import TracebackType
from typing import Any, Self

import zmq

from foottrack_protocol.control import Code
from foottrack_protocol.envelope import pack_map, unpack_map
from foottrack_protocol.errors import DecodeError
from foottrack_protocol.topics import WELCOME
from foottrack_service.bus.control_client import ControlClient
from foottrack_service.bus.endpoints import HWM, MAX_FRAME_BYTES, Context, Socket, bind, release
from foottrack_service.bus.errors import BusError, ControlError
from foottrack_service.bus.revival import Revival
from foottrack_service.bus.security import Credentials, connect, credentials
from foottrack_service.bus.timesync import SyncedClock, synchronise
from foottrack_service.bus.watch import SocketWatch
from foottrack_service.config import BusSettings

_BATCH = 64
_LOOK_S = 2.0
_STOP_TIMEOUT_S = 5.0
_log = logging.getLogger(__name__)


class Relay:
    """Binds ``local`` (loopback) and stands in there for the service at ``service``, whose ``curve`` has the keys.

    A context manager; ``run`` inside it. ``endpoints`` are the actual local ones.
    """

    def __init__(self, service: BusSettings, local: BusSettings, clock: SyncedClock | None = None) -> None:
        """Raises KeyFileError. ``clock`` is made of this host's."""
        self.endpoints = local
        self.clock = clock or SyncedClock()
        self._service = service
        self._credentials = credentials(service.curve)
        self._context: Context = zmq.Context()
        self._context.linger = 0
        self._proxies: list[_Proxy] = []

    def __enter__(self) -> Self:
        """Raises BindRefused (not loopback), BindFailed."""
        try:
            self._open()
        except BaseException:
            self._context.destroy(0)
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._watches[0].close()
        self._watches[1].close()
        release(self._local, self.endpoints.control)
        self._local.close(0)
        self._remote.close(0)
        self._asking.close()
        for proxy in self._proxies:
            proxy.stop()
        self._context.term()

    async def run(self) -> None:
        """Answer and pass on requests, keep the clock, and say when the service is out of reach, until cancelled."""
        for proxy in self._proxies:
            proxy.attend(asyncio.get_running_loop())
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(synchronise(self.clock, self._asking))
            tasks.create_task(self._requests())
            tasks.create_task(self._answers())
            tasks.create_task(self._tell())

    def _open(self) -> None:
        ingress, egress = self._service.ingress, self._service.egress
        # Each connects to the service with the one, and is bound here with the other.
        up = _Proxy(self._context, zmq.XPUB, ingress, zmq.XSUB, self.endpoints.ingress, self._credentials)
        self._proxies.append(up)
        down = _Proxy(self._context, zmq.XSUB, egress, zmq.XPUB, self.endpoints.egress, self._credentials)
        self._proxies.append(down)
        self._local, self._remote = self._context.socket(zmq.ROUTER), self._context.socket(zmq.DEALER)
        for socket in (self._local, self._remote):
            _limit(socket)
        # What cannot be sent now is answered now, and not obeyed much later.
        self._remote.setsockopt(zmq.IMMEDIATE, 1)
        revival = Revival(self._context, self._remote, self._service.control)
        connect(self._remote, self._service.control, self._credentials)
        control = bind(self._local, self.endpoints.control)
        self._watches = (SocketWatch(self._local), SocketWatch(self._remote, revival))
        self._asking = ControlClient(self._context, self._service.control, self._credentials)
        self.endpoints = self.endpoints.model_copy(
            update={"ingress": up.endpoint, "egress": down.endpoint, "control": control}
        )
        for proxy in self._proxies:
            proxy.start()

    async def _requests(self) -> None:
        watch = self._watches[0]
        while not self._local.closed:
            for frames in _received(self._local):
                answer = self._answer(frames)
                if answer is not None:
                    with contextlib.suppress(zmq.Again):
                        self._local.send_multipart([*frames[:-1], pack_map(answer)], zmq.NOBLOCK)
            await watch.readable()

    async def _answers(self) -> None:
        watch = self._watches[1]
        while not self._remote.closed:
            for frames in _received(self._remote):
                with contextlib.suppress(zmq.Again):
                    self._local.send_multipart(frames, zmq.NOBLOCK)
            await watch.readable()

    def _answer(self, frames: list[bytes]) -> dict[str, Any] | None:
        """An answer of ours, or None where the service gives it. The service returns all frames but the last."""
        with contextlib.suppress(DecodeError):
            if unpack_map(frames[-1]).get("cmd") == "time":
                if self.clock.fresh():
                    return {"ok": True, "result": {"t": self.clock()}}
                return _unavailable(f"the relay has not reached the clock of the service at {self._service.control}")
        try:
            self._remote.send_multipart(frames, zmq.NOBLOCK)
        except zmq.Again:
            return _unavailable(f"the relay has no connection to the service at {self._service.control}")
        return None

    async def _tell(self) -> None:
        """Say in the log when the service is found and lost, and why it is not found."""
        known = ""
        while True:
            level, state = logging.INFO, f"the service at {self._service.control} answers"
            try:
                await self._asking.request("hello")
            except ControlError as error:
                level, state = logging.WARNING, str(error)
            if state != known:
                known = state
                _log.log(level, "%s", state)
            await asyncio.sleep(_LOOK_S)


class _Proxy:
    """libzmq's proxy in a thread, between a socket that connects to the service and one that is bound here."""

    def __init__(
        self, context: Context, far: int, service: str, near: int, local: str, who: Credentials | None
    ) -> None:
        steering = f"inproc://{uuid.uuid4().hex}"
        self._sockets = [context.socket(kind) for kind in (far, near, zmq.PAIR)]
        for socket in self._sockets:
            _limit(socket)
            if socket.type == zmq.XPUB:
                # As in the broker: a swallowed part of a longer message would end libzmq's proxy.
                socket.setsockopt(zmq.XPUB_VERBOSER, 1)
        if near == zmq.XPUB:
            self._sockets[1].setsockopt(zmq.XPUB_WELCOME_MSG, WELCOME)
        # A lost connection ends the subscriptions that came over it: local publishers learn that the bus is gone.
        self._sockets[0].setsockopt(zmq.IMMEDIATE, 1)
        self.endpoint = bind(self._sockets[1], local)
        bind(self._sockets[2], steering)
        self._steering = context.socket(zmq.PAIR)
        self._steering.connect(steering)
        self._service = service
        self._ending = False
        # The thread has the socket: it connects anew when it comes out of the proxy.
        self._revival = Revival(context, self._sockets[0], service, self._interrupt)
        connect(self._sockets[0], service, who)
        self._thread = threading.Thread(target=self._run, name=f"relay {self.endpoint}", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def attend(self, loop: asyncio.AbstractEventLoop) -> None:
        """Connect anew where libzmq does not, from now on."""
        self._revival.attend(loop)

    def stop(self) -> None:
        """Raises BusError when the thread does not end."""
        self._revival.leave()
        self._ending = True
        self._interrupt()
        self._thread.join(_STOP_TIMEOUT_S)
        self._steering.close(0)
        if self._thread.is_alive():
            raise BusError(f"the relay did not stop within {_STOP_TIMEOUT_S:g} s")

    def _interrupt(self) -> None:
        self._steering.send(b"TERMINATE")

    def _run(self) -> None:
        far, near, steering = self._sockets
        with contextlib.suppress(zmq.ContextTerminated):
            zmq.proxy_steerable(far, near, None, steering)
            while not self._ending:
                far.disconnect(self._service)
                far.connect(self._service)
                zmq.proxy_steerable(far, near, None, steering)
            release(near, self.endpoint)
        self._revival.close()
        for socket in self._sockets:
            socket.close(0)


def _limit(socket: Socket) -> None:
    socket.set_hwm(HWM)
    socket.setsockopt(zmq.LINGER, 0)
    socket.setsockopt(zmq.MAXMSGSIZE, MAX_FRAME_BYTES)


def _received(socket: Socket) -> list[list[bytes]]:
    received: list[list[bytes]] = []
    with contextlib.suppress(zmq.Again):
        while len(received) < _BATCH:
            received.append(socket.recv_multipart(zmq.NOBLOCK))
    return received


def _unavailable(message: str) -> dict[str, Any]:
    return {"ok": False, "error": {"code": Code.UNAVAILABLE, "message": message}}
