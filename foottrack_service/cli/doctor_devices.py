"""What `foottrack doctor` knows of devices without asking the service."""

from __future__ import annotations

import socket
from importlib.util import find_spec

from foottrack_protocol.frames import SIDES
from foottrack_service.cli.findings import Finding
from foottrack_service.cli.running import run_loop
from foottrack_service.config import Settings

_LONGEST_EXPOSURE_S = 0.003
_RUNTIME_PACKAGES = {"openvr": "openvr", "openxr": "xr"}


def imus(settings: Settings, listen: bool) -> list[Finding]:
    """Serial ports, and what the settings expect of them; with ``listen``, what talks there."""
    from foottrack_service.imu import ports

    there = ports.available()
    named = ", ".join(port.device for port in there) or "none"
    found = [Finding("ok" if there else "note", "serial ports", named)]
    named_ports: dict[str, str] = {}
    devices = {side: getattr(settings.imu, side) for side in SIDES}
    allotment = ports.Allotment(
        {side: device.port for side, device in devices.items() if device.format not in ("off", "slimevr")}
    )
    for side, device in devices.items():
        if device.format == "off":
            found.append(
                Finding(
                    "note", f"imu {side}", "no device is configured", f"Name one under [imu.{side}], if there is one."
                )
            )
        elif device.format == "slimevr":
            found.append(
                Finding("ok", f"imu {side}", f"a SlimeVR tracker, awaited on UDP port {settings.imu.slimevr_port}")
            )
        else:
            try:
                port = allotment.find(side, there)
            except ports.PortNotFound as error:
                found.append(
                    Finding("error", f"imu {side}", str(error), "Plug it in, or mend the port in the settings.")
                )
            else:
                found.append(Finding("ok", f"imu {side}", f"{device.format} on {port}"))
                named_ports[port] = device.format
    if listen:
        found += [_heard(port, named_ports.get(port)) for port in sorted({*named_ports, *(p.device for p in there)})]
    elif there:
        found[0] = found[0]._replace(advice="foottrack doctor --listen opens them and says which IMU talks where.")
    return found


def camera(settings: Settings) -> list[Finding]:
    """The camera, its exposure and the tags."""
    source = settings.camera.source
    if source.kind == "none":
        return [Finding("note", "camera", "none is configured", "Choose one under [camera.source], if there is one.")]
    found = [Finding("ok", "camera", f"{source.kind}, exposure {1e3 * source.exposure:g} ms")]
    if source.exposure > _LONGEST_EXPOSURE_S:
        found.append(Finding("warning", "exposure", "walking feet blur", "Set it to at most 0.003 s and add light."))
    if source.kind == "realsense" and find_spec("pyrealsense2") is None:
        found.append(
            Finding("error", "camera", "pyrealsense2 is not installed", "Install it: pip install foottrack[realsense]")
        )
    sizes = sorted({tag.size for side in SIDES for tag in settings.camera.targets.of(side).tags})
    printed = ", ".join(f"{1e3 * size:g}" for size in sizes)
    found.append(
        Finding(
            "note", "tags", f"{settings.camera.dictionary}, {printed} mm", "Measure the print's ruler: scale matters."
        )
    )
    return found


def headset(settings: Settings) -> list[Finding]:
    """Where the head's pose comes from, and whether that can be."""
    chosen = settings.headset
    if chosen.source == "bus":
        found = [Finding("note", "headset", "an engine publishes head/pose", "Or choose one: [headset] source.")]
    elif chosen.source == "vmc":
        found = [_udp_port(chosen.vmc.host, chosen.vmc.port)]
    else:
        found = [_runtime("headset", chosen.source)]
    if chosen.needs_openvr and chosen.source != "openvr":
        found.append(_runtime("truth", "openvr"))
    return found


def _udp_port(host: str, port: int) -> Finding:
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind((host, port))
    except OSError as error:
        # The service itself may have it: its node and its stream say so below.
        reason = error.strerror or str(error)
        advice = "Fine if that is the service; otherwise choose another: [headset.vmc] port."
        return Finding("note", "headset", f"VMC on UDP {host}:{port}, which is in use ({reason})", advice)
    return Finding("ok", "headset", f"VMC on UDP {host}:{port}", "Let the application send there: 39539 is usual.")


def _runtime(subject: str, source: str) -> Finding:
    if find_spec(_RUNTIME_PACKAGES[source]) is None:
        return Finding("error", subject, f"{source} is not installed", f"pip install 'foottrack[{source}]'")
    return Finding("ok", subject, source, "Its runtime has to run before the service looks for it.")


def _heard(port: str, wanted: str | None) -> Finding:
    from foottrack_service.imu.probe import probe

    try:
        found = run_loop(probe(port))
    except OSError as error:
        return Finding("warning", port, f"cannot be opened: {error}", "Is the service using it?")
    if found.format is None:
        silent = "nothing is heard" if found.heard == 0 else f"{found.heard} bytes that no known IMU sends"
        return Finding("note" if wanted is None else "error", port, silent, "Check power, wires and baud rate.")
    speaks = f"{found.format} at {found.baud} baud"
    if wanted is None:
        return Finding("note", port, speaks, f'Use it: [imu.left] format = "{found.format}", port = "{port}".')
    if found.format != wanted:
        return Finding("error", port, speaks, f'The settings expect {wanted}: set format = "{found.format}".')
    return Finding("ok", port, speaks)
