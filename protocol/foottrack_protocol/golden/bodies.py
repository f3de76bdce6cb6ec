"""One complete body a stream, as it comes out of msgpack: nothing nil, no two numbers alike."""

from __future__ import annotations

from typing import Any

_HALF_TURN = [0.0, 1.0, 0.0, 0.0]
_TURN = [0.36, 0.48, 0.0, 0.8]
_TILT = [-0.6, 0.0, 0.0, 0.8]
_UPRIGHT = [0.0, 0.0, 0.0, 1.0]

_IMU = {
    "acc": [0.125, 9.75, -0.5],
    "gyro": [0.03125, -0.25, 1.5],
    "q": _TURN,
    "t_dev": 4294967296,
    "t_arr": 1234567890123,
    "accuracy": 3,
}
_MARKER = {
    "p": [-0.15, -1.375, -0.45],
    "q": _TILT,
    "q_alt": _TURN,
    "cov": [1.0e-6, 2.0e-7, -1.0e-7, 2.0e-6, 3.0e-7, 9.0e-6],
    "size_ratio": 1.015625,
    "reproj_px": 0.3125,
    "edge_px": 112.5,
    "frame": 1801,
}
_DEPTH = {**_MARKER, "q": None, "q_alt": None, "size_ratio": None, "reproj_px": None, "frame": 1802}

_RAW_IMU = {
    "bytes": b"\x00\x00\x00\x11\xff\xc0 no packet \x7f\x80",
    "format": "slimevr",
    "source": "192.168.1.20:6969",
    "connection": 2,
    "tracker": "A0:00:00:00:00:01/0",
}


def _foot(x: float, stage: str) -> dict[str, Any]:
    return {
        "hip": [x, 0.875, 0.0625],
        "knee": [x, 0.5, -0.0625],
        "ankle": {"p": [x, 0.09375, 0.03125], "q": _UPRIGHT},
        "toe": [x, 0.015625, -0.1875],
        "v": [0.0, 0.25, -1.5],
        "contact": stage == "marker",
        "stage": stage,
        "sigma": 0.0078125,
        "age": 0.015625,
    }


def _gait(phase: str, height: float) -> dict[str, Any]:
    return {"phase": phase, "height": height, "vy": -0.375}


BODIES: dict[str, dict[str, Any]] = {
    "imu/left": _IMU,
    "imu/right": {**_IMU, "acc": [-0.125, 9.875, 0.25], "t_dev": 4294970000},
    "marker/left": _MARKER,
    "marker/right": {**_MARKER, "p": [0.15, -1.3125, -0.375]},
    "depth/left": _DEPTH,
    "depth/right": {**_DEPTH, "p": [0.140625, -1.25, -0.40625]},
    "head/pose": {
        "p": [0.0625, 1.6875, -0.125],
        "q": _TILT,
        "tracked": True,
        "origin": 2,
        "moved": {"p": [0.5, 0.0, -0.25], "q": _HALF_TURN},
    },
    "truth/left": {"p": [-0.125, 0.09375, 0.0], "q": _UPRIGHT},
    "truth/right": {"p": [0.125, 0.21875, -0.34375], "q": _TILT},
    "calibration": {"kind": "floor", "values": {"height": -0.0234375}},
    "camera/preview": {"jpeg": b"\xff\xd8\xff\xe0 no picture, but its first bytes \x00\xff\xd9"},
    "raw/imu/left": _RAW_IMU,
    "raw/imu/right": {**_RAW_IMU, "bytes": b"\xaa\xaa\x00", "format": "rvc", "source": "COM3", "tracker": None},
    "raw/camera": {
        "frame": 1803,
        "layer": "depth",
        "part": 1,
        "parts": 3,
        "png": b"no picture, but some of its bytes \x00\xff IEND\xaeB`\x82",
        "depth_unit": 0.0009765625,
        "exposure": 0.00390625,
        "readout": 0.0078125,
        "lens": {
            "width": 848,
            "height": 480,
            "fx": 612.5,
            "fy": 613.25,
            "cx": 423.75,
            "cy": 239.125,
            "distortion": [0.0625, -0.1875, 0.00048828125, -0.000244140625, 0.03125],
        },
    },
    "pose/body": {
        "head": {"p": [0.0, 1.65625, 0.0], "q": _TILT},
        "hips": {"p": [0.0, 0.90625, 0.078125], "q": _HALF_TURN},
        "left": _foot(-0.125, "marker"),
        "right": _foot(0.109375, "inertial"),
    },
    "pose/ik": {
        "mode": "walk",
        "left": {"p": [-0.09375, 0.09375, 0.25], "q": _UPRIGHT, "hint": [-0.09375, 0.5, -0.29]},
        "right": {"p": [0.09375, 0.1875, -0.125], "q": _TILT, "hint": [0.09375, 0.5625, -0.29]},
        "pelvis_dy": -0.03125,
        "speed": 1.25,
        "heading": [0.6, 0.0, -0.8],
    },
    "gait/state": {
        "left": _gait("stance", 0.0),
        "right": _gait("descending", 0.0859375),
        "cadence": 1.75,
        "speed": 1.25,
        "steps": 41,
    },
    "gait/event": {"side": "right", "event": "foot_strike", "step": 42},
}
"""Streams of a user."""

CALIBRATIONS: tuple[dict[str, Any], ...] = (
    {"kind": "heading", "values": {"yaw": 0.4375, "imu_yaw": {"left": -2.5, "right": 3.0}}},
    {
        "kind": "body",
        "values": {
            "height": 1.75,
            "thigh": 0.4375,
            "shank": 0.40625,
            "torso": 0.75,
            "hip_width": 0.1875,
            "hip_back": 0.078125,
            "neck_down": 0.125,
            "neck_back": 0.09375,
        },
    },
    {
        "kind": "mount",
        "values": {
            "p": [0.001953125, -0.00390625, 0.0],
            "q": _UPRIGHT,
            "sigma_p": 0.0009765625,
            "sigma_q": 0.00048828125,
            "base": "9f86d081884c7d65",
        },
    },
    {
        "kind": "imu",
        "values": {
            "side": "left",
            "acc_bias": [0.0625, -0.03125, 0.015625],
            "gyro_bias": [-0.001953125, 0.0009765625, 0.0],
            "p": [0.0, -0.03125, -0.0625],
            "q": _TURN,
        },
    },
)
"""The other kinds of ``calibration``."""

PAIR_EVENT: dict[str, Any] = {"side": None, "event": "first_step", "step": 1}
"""A ``gait/event`` of the pair, which needs no side."""

SYSTEM_BODIES: dict[str, dict[str, Any]] = {
    "session": {
        "session": "3f9a61c2",
        "protocol": {"major": 1, "minor": 0},
        "clock": {"bus": 1234567890123, "unix": 1760000000123456789},
        "users": ["user", "guest-2"],
        "config_hash": "9f86d081884c7d65",
    },
    "health": {
        "topics": {
            "user/imu/left": {"hz": 399.5, "messages": 12000, "gaps": 2, "drops": {"not_finite": 1}, "age": 0.0025}
        },
        "filters": {"user/left": {"accepted": {"imu": 12000, "marker": 1790}, "rejected": {"gate": 3}}},
        "nodes": {"imu-left": {"state": "restarting", "restarts": 1, "error": "the serial port went away"}},
        "drops": {"topic": 4},
        "latency_ms": {"p50": 0.375, "p99": 1.125},
    },
    "log": {"level": "warning", "logger": "foottrack_service.imu", "message": "links: Sensor hängt — 再接続 👣"},
}
"""Streams of the service."""
