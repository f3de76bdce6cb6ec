"""A BNO08x's own calibration: saved in the chip, or cleared."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from foottrack_service.bus.clock import now
from foottrack_service.imu.formats import SERIAL_FORMATS
from foottrack_service.imu.formats.bno08x import Bno08xDecoder
from foottrack_service.imu.formats.sh2 import Command
from foottrack_service.imu.link import SerialLink


class NoAnswer(Exception):
    """The chip did not do it; the text says what is known."""


async def command_chip(
    find_port: Callable[[], str], command: Command, baud: int | None = None, timeout_s: float = 5.0
) -> None:
    """Connect, command, wait for the chip's word. The service must not have the port. Raises NoAnswer."""
    known = SERIAL_FORMATS["bno08x"]
    decoder = Bno08xDecoder()
    heard = asyncio.Event()
    done = asyncio.Event()
    commanded_in_epoch: int | None = None
    epoch = 0

    def on_data(data: bytes, t_arr: int) -> None:
        nonlocal epoch, commanded_in_epoch
        for sample in decoder.feed(data):
            heard.set()
            epoch = sample.epoch
            if commanded_in_epoch is None:
                commanded_in_epoch = epoch
                decoder.send_command(command)
        # Clearing is answered by a restart, saving by a response.
        restarted = commanded_in_epoch is not None and epoch != commanded_in_epoch
        if (command == Command.CLEAR_CALIBRATION_AND_RESET and restarted) or (int(command), 0) in decoder.answers:
            done.set()

    link = SerialLink(
        "chip", find_port, baud or known.baud, lambda: None, on_data, decoder.to_send, now, known.byte_gap_s
    )
    running = asyncio.create_task(link.run())
    try:
        async with asyncio.timeout(timeout_s):
            await done.wait()
    except TimeoutError:
        refused = next((status for code, status in decoder.answers if code == command), None)
        if link.connections == 0:
            raise NoAnswer(link.failure or "no connection") from None
        if refused is not None:
            raise NoAnswer(f"the chip refused, status {refused}") from None
        if not heard.is_set():
            raise NoAnswer(f"{link.port or 'the port'} is open, but no BNO08x answers there in UART-SHTP") from None
        raise NoAnswer("the chip sends samples but did not answer the command: is its RX connected?") from None
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
