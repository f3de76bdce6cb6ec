"""The service's control socket speaks for a replay that runs in a process of its own.

The replay tells the service where it can be asked (``replay/attach``); ``replay/pause|resume|seek|rate`` are passed on.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from foottrack_protocol.control import Code
from foottrack_service.bus.control_client import ControlClient
from foottrack_service.bus.endpoints import Context, check_loopback
from foottrack_service.bus.errors import BusError, ControlError, ControlTimeout

_PATIENCE_S = 1.0


class ReplayDesk:
    """Knows the replay that runs, if one does."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._replay: ControlClient | None = None

    @property
    def handlers(self) -> dict[str, Callable[..., Any]]:
        """For the control socket."""
        return {
            "replay/attach": self.attach,
            "replay/pause": self.pause,
            "replay/resume": self.resume,
            "replay/seek": self.seek,
            "replay/rate": self.set_rate,
        }

    def attach(self, endpoint: str) -> dict[str, Any]:
        """A replay can be asked at ``endpoint`` on this host. The last one that came is the one that is spoken for.

        Raises ControlError for an endpoint that is none, or that others could reach.
        """
        try:
            check_loopback(endpoint)
        except BusError as error:
            raise ControlError(Code.BAD_ARGUMENTS, str(error)) from None
        self.close()
        self._replay = ControlClient(self._context, endpoint)
        return {}

    async def pause(self) -> Any:
        """Hold it."""
        return await self._ask("replay/pause")

    async def resume(self) -> Any:
        """Let it go on."""
        return await self._ask("replay/resume")

    async def seek(self, position: float) -> Any:
        """Go on from there, s from the recording's first message."""
        return await self._ask("replay/seek", position=position)

    async def set_rate(self, rate: float) -> Any:
        """Go on at that speed."""
        return await self._ask("replay/rate", rate=rate)

    def close(self) -> None:
        """Forget the replay."""
        if self._replay is not None:
            self._replay.close()
            self._replay = None

    async def _ask(self, cmd: str, **args: float) -> Any:
        asked = self._replay
        if asked is not None:
            try:
                return await asked.request(cmd, args, _PATIENCE_S)
            except ControlTimeout:
                # Another one may have come meanwhile.
                if self._replay is asked:
                    self.close()
        raise ControlError(Code.NOT_RUNNING, "no replay runs")
