"""The bus itself: libzmq's XSUB/XPUB proxy in a thread. Nothing is forwarded in Python."""

from __future__ import annotations

import threading
import uuid
from types import TracebackType
from typing import Self

import zmq

from foottrack_protocol.topics import WELCOME
from foottrack_service.bus.endpoints import HWM, MAX_FRAME_BYTES, Context, Socket, bind
from foottrack_service.bus.errors import BusError
from foottrack_service.config import BusSettings

_STOP_TIMEOUT_S = 5.0


class Broker:
    """The proxy between publishers (ingress) and subscribers (egress).

    ``endpoints`` are the actual ones after ``start`` (port 0 takes a free one); ``inproc`` are those for tasks of
    the same context, which save the way through TCP. The control endpoint in both is the configured one.
    """

    def __init__(self, settings: BusSettings, context: Context | None = None) -> None:
        self.context = context or zmq.Context()
        self.endpoints = settings
        self.inproc = settings
        self._own_context = context is None
        self._settings = settings
        self._thread: threading.Thread | None = None
        self._steer: Socket | None = None

    def start(self) -> None:
        """Bind and forward. Raises BindRefused (not loopback), BindFailed (taken or malformed)."""
        raise NotImplementedError

    def stop(self) -> None:
        """Stop forwarding; when this returns, the ports are free."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()
