"""Ports by name, by USB id, or found."""

from __future__ import annotations

from pathlib import Path

import pytest

from foottrack_service.imu import ports
from foottrack_service.imu.ports import Port, PortNotFound

FTDI_A = Port("/dev/ttyUSB0", 0x0403, 0x6001, "A10", "FT232R")
FTDI_B = Port("/dev/ttyUSB1", 0x0403, 0x6001, "B20", "FT232R")
ESP = Port("COM7", 0x303A, 0x1001, None, "ESP32-S3")
MODEM = Port("/dev/ttyACM9", 0x1199, 0x9071, "X", "LTE modem")
BOARD_OWN = Port("/dev/ttyS0")


def test_a_name_is_taken_as_it_is() -> None:
    assert ports.find("/dev/imu-left", []) == "/dev/imu-left"
    assert ports.find("COM3", [FTDI_A]) == "COM3"


def test_a_usb_id_with_and_without_a_serial_number() -> None:
    there = [FTDI_B, MODEM, FTDI_A]
    assert ports.find("0403:6001:B20", there) == "/dev/ttyUSB1"
    assert ports.find("0403:6001", there) == "/dev/ttyUSB0"
    assert ports.find("0403:6001", there, taken={"/dev/ttyUSB0"}) == "/dev/ttyUSB1"


def test_auto_takes_sensor_boards_only() -> None:
    there = [MODEM, BOARD_OWN, FTDI_A, ESP]
    assert ports.find("auto", there) == "/dev/ttyUSB0"
    assert ports.find("auto", there, taken={"/dev/ttyUSB0"}) == "COM7"
    with pytest.raises(PortNotFound, match="ttyACM9"):
        ports.find("auto", [MODEM, BOARD_OWN])


def test_what_is_not_there_is_said_with_what_is() -> None:
    with pytest.raises(PortNotFound) as error:
        ports.find("0403:6001:C30", [FTDI_A, ESP])
    assert "'0403:6001:C30'" in str(error.value)
    assert "/dev/ttyUSB0 (0403:6001:A10)" in str(error.value)
    assert "COM7" in str(error.value)
    with pytest.raises(PortNotFound, match="none"):
        ports.find("auto", [])


def test_this_machines_ports_can_be_listed(tmp_path: Path) -> None:
    assert all(port.device for port in ports.available())
    assert not ports.exists(str(tmp_path / "gone"))
