"""The socket of a headset source that sends datagrams."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import cast

from foottrack_service.bus.clock import BusClock

OnDatagram = Callable[[bytes, int], None]
"""A datagram, and when it arrived (bus clock, ns)."""


class DatagramSocket(asyncio.DatagramProtocol):
    """Hands on what arrives. ``port`` is where it listens."""

    def __init__(self, on_datagram: OnDatagram, clock: BusClock) -> None:
        self._on_datagram = on_datagram
        self._clock = clock
        self._transport: asyncio.DatagramTransport | None = None

    @classmethod
    async def open(cls, host: str, port: int, on_datagram: OnDatagram, clock: BusClock) -> DatagramSocket:
        """Listen. Raises OSError, for instance where somebody else has the port."""
        loop = asyncio.get_running_loop()
        _, protocol = await loop.create_datagram_endpoint(lambda: cls(on_datagram, clock), local_addr=(host, port))
        return protocol

    @property
    def port(self) -> int:
        """Where it listens; 0 when closed."""
        return 0 if self._transport is None else int(self._transport.get_extra_info("sockname")[1])

    def close(self) -> None:
        """Stop listening."""
        if self._transport is not None:
            self._transport.close()
            self._transport = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.DatagramTransport, transport)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        self._on_datagram(data, self._clock())

    def error_received(self, exc: Exception) -> None:
        """We never send, so there is nothing that could have failed."""
