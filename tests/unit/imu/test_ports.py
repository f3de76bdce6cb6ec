"""Ports by name, by USB id, or found."""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from foottrack_protocol.frames import SIDES
from foottrack_protocol.messages import Side
from foottrack_service.imu import ports
from foottrack_service.imu.ports import Allotment, Port, PortNotFound

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


@pytest.mark.parametrize("first", ["left", "right"])
def test_two_alike_are_always_dealt_in_the_same_order(first: Side) -> None:
    allotment = Allotment({"left": "auto", "right": "auto"})
    second: Side = "right" if first == "left" else "left"
    found = {side: allotment.find(side, [FTDI_B, FTDI_A]) for side in (first, second)}
    assert found == {"left": "/dev/ttyUSB0", "right": "/dev/ttyUSB1"}
    # A board that is unplugged does not make the other foot's one its own.
    with pytest.raises(PortNotFound):
        allotment.find("left", [FTDI_B])
    assert allotment.find("right", [FTDI_B]) == "/dev/ttyUSB1"


@pytest.mark.parametrize("named", ["/dev/ttyUSB0", "0403:6001:A10"])
def test_auto_leaves_alone_what_the_other_foot_names(named: str) -> None:
    allotment = Allotment({"left": "auto", "right": named})
    assert allotment.find("left", [FTDI_A, FTDI_B]) == "/dev/ttyUSB1"
    assert allotment.find("right", [FTDI_A, FTDI_B]) == "/dev/ttyUSB0"


@pytest.mark.skipif(sys.platform == "win32", reason="links to devices are POSIX")
def test_auto_leaves_alone_what_the_other_foot_names_by_a_link(tmp_path: Path) -> None:
    (tmp_path / "ttyUSB0").touch()
    (tmp_path / "imu-right").symlink_to(tmp_path / "ttyUSB0")
    there = [FTDI_A._replace(device=str(tmp_path / "ttyUSB0")), FTDI_B]
    assert Allotment({"left": "auto", "right": str(tmp_path / "imu-right")}).find("left", there) == "/dev/ttyUSB1"


def test_feet_that_ask_at_the_same_time_never_get_one_port() -> None:
    for _ in range(50):
        allotment = Allotment({"left": "auto", "right": "auto"})
        with ThreadPoolExecutor(2) as threads:
            found = list(threads.map(allotment.find, SIDES, [[FTDI_A, FTDI_B]] * 2))
        assert found == ["/dev/ttyUSB0", "/dev/ttyUSB1"]


def test_this_machines_ports_can_be_listed(tmp_path: Path) -> None:
    assert all(port.device for port in ports.available())
    assert not ports.exists(str(tmp_path / "gone"))
