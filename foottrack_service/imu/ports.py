"""Serial ports by name, by USB id, or found."""

from __future__ import annotations

import os
import re
import sys
import threading
from collections.abc import Collection, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from foottrack_protocol.messages import Side

_USB_ID = re.compile(r"([0-9a-fA-F]{4}):([0-9a-fA-F]{4})(?::(.+))?")

# FTDI, Silicon Labs, WCH, Prolific, Espressif, Arduino, Teensy, Raspberry Pi, Adafruit, SparkFun, Seeed.
_BOARD_VENDORS = {0x0403, 0x10C4, 0x1A86, 0x067B, 0x303A, 0x2341, 0x16C0, 0x2E8A, 0x239A, 0x1B4F, 0x2886}


class PortNotFound(Exception):
    """No port is what the setting says; the text lists those that there are."""


class Port(NamedTuple):
    """A serial port. ``device`` is the name to open; ids and serial number are those of its USB adapter."""

    device: str
    vendor: int | None = None
    product: int | None = None
    serial: str | None = None
    description: str = ""

    def __str__(self) -> str:
        usb = "" if self.vendor is None else f" ({self.vendor:04x}:{self.product or 0:04x}:{self.serial or ''})"
        return f"{self.device}{usb}"


def available() -> list[Port]:
    """The machine's serial ports, by name."""
    from serial.tools.list_ports import comports

    return sorted(Port(p.device, p.vid, p.pid, p.serial_number, p.description or "") for p in comports())


def find(wanted: str, ports: Iterable[Port], taken: Collection[str] = ()) -> str:
    """The device name of the setting ``port``. Raises PortNotFound.

    A name is taken as it is. A USB id without a serial number, and ``auto`` (USB adapters that sensor boards have),
    give the first by name that is not ``taken``: two alike are told apart by tapping them (``calibrate imu``).
    """
    usb = _USB_ID.fullmatch(wanted)
    if wanted != "auto" and usb is None:
        return wanted
    ports = sorted(ports)
    for port in ports:
        if port.device not in taken and (_is_board(port) if usb is None else _matches(port, usb)):
            return port.device
    seen = ", ".join(str(port) for port in ports) or "none"
    raise PortNotFound(f"no free serial port is {wanted!r}; there are: {seen}")


class Allotment:
    """Which port each foot's device has, whichever foot asks first. Threads may ask at the same time.

    ``wanted`` are the settings ``port``. Who names one goes before who names an adapter, and that one before ``auto``;
    alike, the first goes first. A port that was found stays its foot's until another one is found for it.
    """

    def __init__(self, wanted: Mapping[Side, str]) -> None:
        self._turns = sorted(wanted.items(), key=lambda item: _vagueness(item[1]))
        self._found: dict[Side, str] = {}
        self._lock = threading.Lock()

    def find(self, side: Side, ports: Collection[Port]) -> str:
        """The device name of this foot's port. Raises PortNotFound."""
        with self._lock:
            taken: set[str] = set()
            for other, device in self._found.items():
                if other != side:
                    taken |= _names(device)
            for each, wanted in self._turns:
                if each == side:
                    self._found[side] = find(wanted, ports, taken)
                    return self._found[side]
                if each not in self._found:
                    with suppress(PortNotFound):
                        taken |= _names(find(wanted, ports, taken))
        raise KeyError(side)


def exists(device: str) -> bool:
    """Whether an open port is still plugged in."""
    if sys.platform == "win32":
        return any(port.device == device for port in available())
    return Path(device).exists()


def _is_board(port: Port) -> bool:
    return port.vendor in _BOARD_VENDORS


def _vagueness(wanted: str) -> int:
    if wanted == "auto":
        return 3
    usb = _USB_ID.fullmatch(wanted)
    return 0 if usb is None else 1 if usb[3] else 2


def _names(device: str) -> set[str]:
    """A setting may name a port by a link, and Windows does not care for case."""
    return {device, device.upper(), os.path.realpath(device)}


def _matches(port: Port, usb: re.Match[str]) -> bool:
    vendor, product, serial = usb.groups()
    if (port.vendor, port.product) != (int(vendor, 16), int(product, 16)):
        return False
    return serial is None or port.serial == serial
