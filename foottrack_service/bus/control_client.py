"""Control, the client's side."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Mapping
from typing import Any

import zmq

from foottrack_protocol.envelope import pack_map, unpack_map
from foottrack_protocol.errors import DecodeError
from foottrack_service.bus.endpoints import Context
from foottrack_service.bus.errors import ControlError, ControlTimeout
from foottrack_service.bus.revival import Revival
from foottrack_service.bus.security import Credentials, connect, why_not
from foottrack_service.bus.watch import SocketWatch


class ControlClient:
    """Asks the service, one request at a time. Belongs to one event loop."""

    def __init__(self, context: Context, endpoint: str, credentials: Credentials | None = None) -> None:
        self.endpoint = endpoint
        self._context = context
        self._credentials = credentials
        self._numbers = itertools.count()
        self._turn = asyncio.Lock()
        self._socket = context.socket(zmq.DEALER)
        self._socket.setsockopt(zmq.LINGER, 0)
        # Without a connection nothing is sent: a command that waits would be obeyed long after its sender gave up.
        self._socket.setsockopt(zmq.IMMEDIATE, 1)
        revival = Revival(context, self._socket, endpoint)
        connect(self._socket, endpoint, credentials)
        self._watch = SocketWatch(self._socket, revival)

    async def request(self, cmd: str, args: Mapping[str, Any] | None = None, timeout_s: float = 2.0) -> Any:
        """The result. Raises ControlError (its answer), ControlTimeout (none), EncodeError."""
        payload = pack_map({"cmd": cmd, "args": dict(args or {})})
        try:
            async with asyncio.timeout(timeout_s), self._turn:
                answer = await self._exchange(payload)
        except TimeoutError:
            reason = await asyncio.to_thread(why_not, self._context, self.endpoint, zmq.DEALER, self._credentials)
            raise ControlTimeout(f"no answer to {cmd!r} within {timeout_s:g} s: {reason}") from None
        return _result(answer)

    @property
    def closed(self) -> bool:
        """Whether it was closed."""
        return self._socket.closed

    def close(self) -> None:
        """Close; requests that wait end with ControlTimeout."""
        if not self._socket.closed:
            self._watch.close()
            self._socket.close(0)

    async def _exchange(self, payload: bytes) -> bytes:
        number = b"%d" % next(self._numbers)
        await self._send([number, b"", payload])
        while not self._socket.closed:
            while self._watch.has_input:
                frames = self._socket.recv_multipart(zmq.NOBLOCK)
                # An answer to a request that was given up carries another number.
                if len(frames) == 3 and frames[0] == number:
                    return frames[2]
            await self._watch.readable()
        raise TimeoutError

    async def _send(self, frames: list[bytes]) -> None:
        while not self._socket.closed:
            try:
                self._socket.send_multipart(frames, zmq.NOBLOCK)
            except zmq.Again:
                await self._watch.writable()
            else:
                return


def _result(payload: bytes) -> Any:
    try:
        answer = unpack_map(payload)
    except DecodeError as error:
        raise ControlError("bad_answer", error.detail) from None
    if answer.get("ok") is True:
        return answer.get("result")
    failure = answer.get("error")
    if not isinstance(failure, dict):
        raise ControlError("bad_answer", "neither a result nor an error")
    raise ControlError(str(failure.get("code")), str(failure.get("message")))
