"""SH-2, what the BNO08x says inside SHTP: report layouts, commands and calibration.

Sources: the BNO08x data sheet, 1.4 and 5.2, and the SH-2 reference manual. All numbers are little-endian.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from enum import IntEnum
from typing import NamedTuple


class Report(IntEnum):
    """Ids of the reports that this project reads or writes."""

    ACCELEROMETER = 0x01
    GYROSCOPE = 0x02
    GAME_ROTATION_VECTOR = 0x08
    COMMAND_RESPONSE = 0xF1
    COMMAND_REQUEST = 0xF2
    PRODUCT_RESPONSE = 0xF8
    PRODUCT_REQUEST = 0xF9
    TIMESTAMP_REBASE = 0xFA
    BASE_TIMESTAMP = 0xFB
    GET_FEATURE_RESPONSE = 0xFC
    SET_FEATURE = 0xFD
    GET_FEATURE_REQUEST = 0xFE


class Command(IntEnum):
    """Commands inside COMMAND_REQUEST."""

    INITIALIZE = 0x04
    SAVE_CALIBRATION = 0x06
    CALIBRATION_CONFIG = 0x07
    CLEAR_CALIBRATION_AND_RESET = 0x0B


RESET = b"\x01"
"""To the executable channel: start again. From it: done."""

SENSORS = (Report.ACCELEROMETER, Report.GYROSCOPE, Report.GAME_ROTATION_VECTOR)

_HEAD = 4
"""Report id, sequence number, status (accuracy in bits 1:0, delay's upper bits in 7:2), delay's lower byte."""

# Lengths of all reports that may stand before one of ours in a cargo.
_LENGTHS = {
    0x01: 10, 0x02: 10, 0x03: 10, 0x04: 10, 0x05: 14, 0x06: 10, 0x07: 16, 0x08: 12, 0x09: 14, 0x0A: 8, 0x0B: 8,
    0x0C: 6, 0x0D: 6, 0x0E: 6, 0x0F: 16, 0x10: 5, 0x11: 12, 0x12: 6, 0x13: 6, 0x14: 16, 0x15: 16, 0x16: 16, 0x18: 8,
    0x19: 6, 0x1A: 6, 0x1B: 8, 0x1C: 6, 0x1E: 16, 0x1F: 6, 0x20: 6, 0x21: 6, 0x22: 6, 0x23: 6, 0x28: 14, 0x29: 12,
    0xEF: 2, 0xFA: 5, 0xFB: 5,
}  # fmt: skip
_TIMEBASE = struct.Struct("<i")
_VECTOR = struct.Struct("<3h")
_QUATERNION = struct.Struct("<4h")
_FEATURE = struct.Struct("<BBBHIII")
_TICK_US = 100
_SCALE = {Report.ACCELEROMETER: 2.0**-8, Report.GYROSCOPE: 2.0**-9, Report.GAME_ROTATION_VECTOR: 2.0**-14}


class SensorReport(NamedTuple):
    """One input report. ``values`` in SI units; the quaternion as ``x, y, z, w``, not normalised."""

    kind: Report
    sequence: int
    accuracy: int
    age_us: int
    """Before the device raised its interrupt, which is about when it began to send."""
    values: tuple[float, ...]


class Damaged(NamedTuple):
    """The rest of a cargo cannot be read."""

    reason: str


def input_reports(payload: bytes) -> Iterator[SensorReport | Damaged]:
    """The reports of one input cargo, with the time base that precedes them taken into account."""
    at, base = 0, 0
    while at < len(payload):
        kind = payload[at]
        length = _LENGTHS.get(kind)
        if length is None:
            yield Damaged("report_id")
            return
        if at + length > len(payload):
            yield Damaged("report_length")
            return
        if kind == Report.BASE_TIMESTAMP:
            base = _TIMEBASE.unpack_from(payload, at + 1)[0]
        elif kind == Report.TIMESTAMP_REBASE:
            base -= _TIMEBASE.unpack_from(payload, at + 1)[0]
        elif kind in SENSORS:
            sequence, status, delay = payload[at + 1 : at + _HEAD]
            layout = _QUATERNION if kind == Report.GAME_ROTATION_VECTOR else _VECTOR
            report = Report(kind)
            scale = _SCALE[report]
            values = tuple(scale * value for value in layout.unpack_from(payload, at + _HEAD))
            age = (base - ((status & 0xFC) << 6) - delay) * _TICK_US
            yield SensorReport(report, sequence, status & 3, age, values)
        at += length


def input_report(report: SensorReport) -> bytes:
    """The other direction, for a simulated device: the time base and the report."""
    scale = 1.0 / _SCALE[report.kind]
    layout = _QUATERNION if report.kind == Report.GAME_ROTATION_VECTOR else _VECTOR
    numbers = (max(-32768, min(32767, round(scale * value))) for value in report.values)
    base = bytes([Report.BASE_TIMESTAMP]) + _TIMEBASE.pack(report.age_us // _TICK_US)
    return base + bytes([report.kind, report.sequence % 256, report.accuracy, 0]) + layout.pack(*numbers)


def set_feature(sensor: Report, interval_us: int) -> bytes:
    """Ask for a sensor's reports; 0 us turns it off. For the control channel."""
    return _FEATURE.pack(Report.SET_FEATURE, sensor, 0, 0, interval_us, 0, 0)


def feature_response(sensor: Report, interval_us: int) -> bytes:
    """What the device answers: the interval that it chose."""
    return _FEATURE.pack(Report.GET_FEATURE_RESPONSE, sensor, 0, 0, interval_us, 0, 0)


def read_feature(payload: bytes) -> tuple[int, int] | None:
    """(sensor's report id, interval in us) of a Set Feature or Get Feature Response, or None if it is neither."""
    if len(payload) != _FEATURE.size or payload[0] not in (Report.SET_FEATURE, Report.GET_FEATURE_RESPONSE):
        return None
    _, sensor, _, _, interval, _, _ = _FEATURE.unpack(payload)
    return sensor, interval


def command(sequence: int, code: Command, *parameters: int) -> bytes:
    """A command request, for the control channel. At most nine parameters, a byte each."""
    return bytes([Report.COMMAND_REQUEST, sequence % 256, code, *parameters]).ljust(12, b"\0")


def command_response(code: Command, command_sequence: int, status: int) -> bytes:
    """What the device answers: status 0 is success."""
    return bytes([Report.COMMAND_RESPONSE, 0, code, command_sequence % 256, 0, status]).ljust(16, b"\0")


def read_command_response(payload: bytes) -> tuple[int, int] | None:
    """(command, status; 0 is success), or None if it is no such response."""
    if len(payload) != 16 or payload[0] != Report.COMMAND_RESPONSE:
        return None
    # The top bit marks responses that nobody asked for.
    return payload[2] & 0x7F, payload[5]
