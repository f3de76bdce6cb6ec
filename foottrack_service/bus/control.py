"""Control: requests ``{cmd, args}``, answers ``{ok, result}`` or ``{ok: false, error: {code, message}}``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from foottrack_service.bus.clock import BusClock, now
from foottrack_service.bus.endpoints import Context
from foottrack_service.bus.health import HealthBoard
from foottrack_service.bus.session import SessionInfo

Handler = Callable[..., Any]
"""A function or coroutine function with typed keyword arguments: they are the request's ``args``, checked by type
(pydantic, strict). It gives what msgpack can carry, or a body. ControlError is answered as it is raised."""


class ControlServer:
    """Answers requests; ``hello``, ``time`` and ``status`` by itself. Whatever comes in gets an answer.

    Codes: "bad_request" (not a request), "unknown_command", "bad_arguments", "busy", "internal", and what handlers
    raise.
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
    ) -> None:
        """Bind. Raises BindRefused, BindFailed."""
        self.endpoint = endpoint

    async def run(self) -> None:
        """Answer until cancelled. Handlers that wait do not hold up others."""

    def close(self) -> None:
        """Close the socket."""


class ControlClient:
    """Asks the service. Belongs to one event loop."""

    def __init__(self, context: Context, endpoint: str) -> None:
        self.endpoint = endpoint

    async def request(self, cmd: str, args: Mapping[str, Any] | None = None, timeout_s: float = 2.0) -> Any:
        """The result. Raises ControlError (its answer), ControlTimeout (none), EncodeError."""

    def close(self) -> None:
        """Close; requests that wait end with ControlTimeout."""
