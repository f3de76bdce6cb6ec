"""The socket of the SlimeVR trackers."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import cast

from foottrack_service.bus.clock import BusClock
from foottrack_service.imu.slimevr import Address, Answer, SlimeVrServer, TrackerSample

OnSample = Callable[[TrackerSample, int], None]
"""A sample, and when it arrived (bus clock, ns)."""

OnDatagram = Callable[[bytes, Address, int], None]
"""A datagram, who sent it, and when it arrived; after its samples."""

_BEAT_S = 0.1


class SlimeVrSocket(asyncio.DatagramProtocol):
    """Feeds a ``SlimeVrServer`` and sends its answers. ``port`` is where it listens."""

    def __init__(
        self, server: SlimeVrServer, on_sample: OnSample, clock: BusClock, on_datagram: OnDatagram | None = None
    ) -> None:
        self._server = server
        self._on_sample = on_sample
        self._on_datagram = on_datagram
        self._clock = clock
        self._transport: asyncio.DatagramTransport | None = None

    @classmethod
    async def open(
        cls,
        host: str,
        port: int,
        server: SlimeVrServer,
        on_sample: OnSample,
        clock: BusClock,
        on_datagram: OnDatagram | None = None,
    ) -> SlimeVrSocket:
        """Listen. Raises OSError, for instance where SlimeVR's own server has the port."""
        loop = asyncio.get_running_loop()
        try:
            _, protocol = await loop.create_datagram_endpoint(
                lambda: cls(server, on_sample, clock, on_datagram), local_addr=(host, port)
            )
        except OSError as error:
            raise OSError(f"UDP {host}:{port} for SlimeVR trackers: {error.strerror or error}") from None
        return protocol

    @property
    def port(self) -> int:
        """Where it listens; 0 when closed."""
        return 0 if self._transport is None else int(self._transport.get_extra_info("sockname")[1])

    async def run(self) -> None:
        """Keep the trackers connected, until cancelled."""
        try:
            while True:
                self._send(self._server.beat(self._clock() * 1e-9))
                await asyncio.sleep(_BEAT_S)
        finally:
            self.close()

    def close(self) -> None:
        """Stop listening."""
        if self._transport is not None:
            self._transport.close()
            self._transport = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.DatagramTransport, transport)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        t_arr = self._clock()
        samples, answers = self._server.receive(data, (addr[0], addr[1]), t_arr * 1e-9)
        self._send(answers)
        for sample in samples:
            self._on_sample(sample, t_arr)
        if self._on_datagram is not None:
            self._on_datagram(data, (addr[0], addr[1]), t_arr)

    def error_received(self, exc: Exception) -> None:
        """A tracker that was switched off answers with an ICMP error: its silence says the same."""

    def _send(self, answers: list[Answer]) -> None:
        if self._transport is not None:
            for address, data in answers:
                self._transport.sendto(data, address)
