"""Control, the service's side: ``{cmd, args}`` in, ``{ok, result}`` or ``{ok, error: {code, message}}`` out."""

from __future__ import annotations

import asyncio
import functools
import inspect
import logging
from collections.abc import Awaitable, Callable, Mapping
from typing import Any

import zmq
from pydantic import ConfigDict, ValidationError, validate_call

from foottrack_protocol.control import COMMANDS, Code
from foottrack_protocol.envelope import pack_map, unpack_map
from foottrack_protocol.errors import DecodeError, EncodeError
from foottrack_protocol.messages import Health, Session
from foottrack_service.bus.clock import BusClock, now
from foottrack_service.bus.door import Doorkeeper
from foottrack_service.bus.endpoints import HWM, MAX_FRAME_BYTES, Context, bind, release
from foottrack_service.bus.errors import BusError, ControlError
from foottrack_service.bus.health import HealthBoard
from foottrack_service.bus.session import SessionInfo
from foottrack_service.bus.watch import SocketWatch

Handler = Callable[..., Any]
"""A function or coroutine function whose typed keyword arguments are the request's ``args``, checked against the
protocol's registry and the types (pydantic, strict). It gives what msgpack can carry, or a body. ControlError is
answered as it is raised."""

MAX_WAITING = 64
"""Requests whose handlers wait at the same time; more are answered "busy"."""
_BATCH = 64
_STRICT = ConfigDict(strict=True)
_OWN_CODES = frozenset({Code.BAD_REQUEST, Code.UNKNOWN_COMMAND, Code.BAD_ARGUMENTS, Code.BUSY, Code.INTERNAL})
_log = logging.getLogger(__name__)


class ControlServer:
    """Answers requests; ``hello``, ``time`` and ``status`` by itself. Whatever comes in gets an answer.

    Its own codes are BAD_REQUEST, UNKNOWN_COMMAND, BAD_ARGUMENTS, BUSY and INTERNAL of foottrack_protocol.control;
    what it refuses with them is counted in ``sys/health`` as "control/<code>".
    """

    def __init__(
        self,
        context: Context,
        endpoint: str,
        handlers: Mapping[str, Handler],
        *,
        session: SessionInfo | None = None,
        board: HealthBoard | None = None,
        clock: BusClock = now,
        doorkeeper: Doorkeeper | None = None,
    ) -> None:
        """Bind, also where the doorkeeper says; ``endpoint`` then is the actual one. Raises BindRefused, BindFailed."""
        session, board = session or SessionInfo(clock=clock), board or HealthBoard()

        def hello() -> Session:
            return session.body()

        def status() -> Health:
            return board.body()

        def time() -> dict[str, int]:
            return {"t": clock()}

        known = {"hello": hello, "status": status, "time": time, **handlers}
        self._handlers = {name: _checked(handler) for name, handler in known.items()}
        self._board = board
        self._waiting = 0
        self._socket = context.socket(zmq.ROUTER)
        self._socket.set_hwm(HWM)
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.setsockopt(zmq.MAXMSGSIZE, MAX_FRAME_BYTES)
        try:
            self.endpoint = bind(self._socket, endpoint)
            self._bound = [self.endpoint]
            if doorkeeper is not None:
                self._bound.append(doorkeeper.bind(self._socket, "control"))
        except BusError:
            self._socket.close(0)
            raise
        self._watch = SocketWatch(self._socket)

    async def run(self) -> None:
        """Answer until cancelled or closed. Handlers that wait do not hold up others."""
        async with asyncio.TaskGroup() as tasks:
            while not self._socket.closed:
                for _ in range(_BATCH):
                    try:
                        frames = self._socket.recv_multipart(zmq.NOBLOCK)
                    except zmq.Again:
                        break
                    self._take(frames, tasks)
                await self._watch.readable()

    def close(self) -> None:
        """Close the socket, and with it the port; ``run`` ends when its handlers have."""
        if not self._socket.closed:
            self._watch.close()
            release(self._socket, *self._bound)
            self._socket.close(0)

    def _take(self, frames: list[bytes], tasks: asyncio.TaskGroup) -> None:
        # REQ puts an empty frame before its payload, DEALER may put anything: it goes back as it came.
        address, payload = frames[:-1], frames[-1]
        answer = self._call(payload)
        if inspect.isawaitable(answer):
            tasks.create_task(self._finish(address, answer))
        else:
            self._answer(address, answer)

    def _call(self, payload: bytes) -> dict[str, Any] | Awaitable[dict[str, Any]]:
        try:
            cmd, args = _request(payload)
            handler = self._handlers.get(cmd)
            if handler is None:
                known = ", ".join(sorted(self._handlers))
                raise ControlError(Code.UNKNOWN_COMMAND, f"no command is called {cmd[:100]!r}; there are: {known}")
            if self._waiting >= MAX_WAITING:
                raise ControlError(Code.BUSY, f"{self._waiting} requests wait already")
            if cmd in COMMANDS:
                COMMANDS[cmd].args.model_validate(args)
            result = handler(**args)
        except ValidationError as error:
            return self._failure(Code.BAD_ARGUMENTS, "; ".join(_detail(item) for item in error.errors()))
        except Exception as error:  # whatever a handler does, the client gets an answer
            return self._explained(error)
        if inspect.isawaitable(result):
            self._waiting += 1
            return self._result(result)
        return {"ok": True, "result": result}

    async def _result(self, awaitable: Awaitable[Any]) -> dict[str, Any]:
        try:
            return {"ok": True, "result": await awaitable}
        except Exception as error:  # as above
            return self._explained(error)
        finally:
            self._waiting -= 1

    async def _finish(self, address: list[bytes], answer: Awaitable[dict[str, Any]]) -> None:
        self._answer(address, await answer)

    def _answer(self, address: list[bytes], answer: dict[str, Any]) -> None:
        try:
            payload = pack_map(answer)
        except EncodeError as error:
            payload = pack_map(self._explained(error))
        if not self._socket.closed:
            self._socket.send_multipart([*address, payload], zmq.NOBLOCK)

    def _explained(self, error: Exception) -> dict[str, Any]:
        if isinstance(error, ControlError):
            return self._failure(error.code, error.message)
        # What a handler raises within itself is no fault of the request's, whatever its kind.
        cause = error.__cause__ if isinstance(error, _HandlerFailed) and error.__cause__ else error
        _log.error("a control request failed", exc_info=cause)
        return self._failure(Code.INTERNAL, f"{type(cause).__name__}: {cause}")

    def _failure(self, code: str, message: str) -> dict[str, Any]:
        if code in _OWN_CODES:
            self._board.refuse(f"control/{code}")
        return {"ok": False, "error": {"code": code, "message": message}}


class _HandlerFailed(Exception):
    """A handler's own ValidationError, which its caller's arguments did not cause."""


def _checked(handler: Handler) -> Handler:
    # As a plain function: of a coroutine function pydantic would look at the arguments only when it is awaited.
    @functools.wraps(handler)
    def call(*args: Any, **kwargs: Any) -> Any:
        try:
            return handler(*args, **kwargs)
        except ValidationError as error:
            raise _HandlerFailed from error

    return validate_call(config=_STRICT)(call)


def _request(payload: bytes) -> tuple[str, dict[str, Any]]:
    try:
        request = unpack_map(payload)
    except DecodeError as error:
        raise ControlError(Code.BAD_REQUEST, error.detail) from None
    cmd, args = request.get("cmd"), request.get("args")
    if not isinstance(cmd, str):
        raise ControlError(Code.BAD_REQUEST, "cmd must be a string")
    if args is None:
        return cmd, {}
    if not isinstance(args, dict) or not all(isinstance(key, str) for key in args):
        raise ControlError(Code.BAD_REQUEST, "args must be a map with strings as keys")
    return cmd, args


def _detail(item: Any) -> str:
    place = ".".join(str(part) for part in item["loc"])
    return f"{place}: {item['msg']}"
