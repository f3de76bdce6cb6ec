"""``foottrack doctor``: what is plugged in, what is wrong with it, what to do about it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.console import Console
from rich.markup import escape

from foottrack_protocol import PROTOCOL_MAJOR
from foottrack_protocol.frames import SIDES
from foottrack_service.cli.doctor_clocks import clock, stamps
from foottrack_service.cli.findings import Finding
from foottrack_service.cli.joining import joined
from foottrack_service.cli.running import ConfigOption, ConnectOption, JsonOption, print_json, run_loop, settings_for
from foottrack_service.config import Settings
from foottrack_service.fusion.interface import Verdict

if TYPE_CHECKING:
    from foottrack_service.bus.control_client import ControlClient

_TOO_SLOW_HZ = {"imu": 50.0, "head": 60.0, "marker": 15.0}
_REFUSED = frozenset(Verdict) - {Verdict.ACCEPTED, Verdict.UNUSED, Verdict.INVALID}
"""What a filter says of fixes. Samples and heads that were left out have nothing to do with tags."""
_MARKS = {
    "ok": "[green]ok[/]     ",
    "note": "[blue]note[/]   ",
    "warning": "[yellow]warning[/]",
    "error": "[red]error[/]  ",
}


def doctor(
    config: ConfigOption = None,
    connect: ConnectOption = None,
    probe: Annotated[
        bool, typer.Option("--probe", help="Only whether the service answers: for health checks.")
    ] = False,
    listen: Annotated[
        bool, typer.Option("--listen", help="Open the serial ports and say which IMU talks there.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Look at ports, camera, headset, the service and its streams, and say what to do.

    Exit code 0 when nothing is wrong, 1 otherwise. Example: foottrack doctor
    """
    settings = settings_for(config, None, connect)
    findings = run_loop(_service(settings, brief=probe))
    if not probe:
        from foottrack_service.cli import doctor_devices as devices

        known = [*devices.imus(settings, listen), *devices.camera(settings), *devices.headset(settings)]
        findings = [*known, *_bridges(settings), *findings]
    sick = any(finding.level == "error" for finding in findings)
    if as_json:
        print_json({"healthy": not sick, "findings": [finding._asdict() for finding in findings]})
    else:
        console = Console()
        for finding in findings:
            text = f"{finding.subject}: {finding.text}"
            console.print(_MARKS[finding.level], escape(text), highlight=False)
            if finding.advice:
                console.print(f"         {escape(finding.advice)}", highlight=False)
    raise typer.Exit(int(sick))


def _bridges(settings: Settings) -> list[Finding]:
    from foottrack_service.bridges.conflicts import conflicts

    found = [
        Finding("ok", f"bridge {name}", f"bodies go to {target.host}, port {target.port}")
        for name, target in settings.bridges.enabled.items()
    ]
    return found + [Finding("warning", "bridges", text, "Mend [bridges].") for text in conflicts(settings)]


async def _service(settings: Settings, brief: bool) -> list[Finding]:
    from foottrack_service.bus.connection import Bus
    from foottrack_service.bus.errors import BusError, ControlError

    with Bus.connect(settings.bus) as bus:
        client = bus.control()
        try:
            session = await client.request("hello")
        except ControlError as error:
            return [Finding("error", "service", str(error), "Start it with: foottrack run")]
        found = [Finding("ok", "service", f"session {session['session']}, users {', '.join(session['users'])}")]
        major = session["protocol"]["major"]
        if major != PROTOCOL_MAJOR:
            found.append(Finding("error", "protocol", f"it speaks {major}, we {PROTOCOL_MAJOR}", "Update the older."))
        if not brief:
            found.append(await clock(client))
            try:
                async with joined(settings) as synchronised:
                    found += await stamps(synchronised, settings.user)
            except BusError as error:
                found.append(Finding("warning", "stamps", str(error)))
        return found + await _streams(client, settings.user)


def _slipped(times: int, found_again: bool) -> Finding:
    text = f"it has moved on the headset {times} times since the service was started"
    if found_again:
        return Finding("note", "camera mount", f"{text}, and was found again")
    return Finding("warning", "camera mount", text, "Fasten it; then look at your feet, or: foottrack calibrate mount")


async def _streams(client: ControlClient, user: str) -> list[Finding]:
    health: dict[str, Any] = await client.request("status")
    found = [
        Finding(
            "error" if node["state"] in ("failed", "restarting") else "ok",
            f"node {name}",
            node["state"],
            node["error"] or "",
        )
        for name, node in health["nodes"].items()
    ]
    for topic, stats in health["topics"].items():
        kind = topic.removeprefix(f"{user}/").partition("/")[0]
        wanted = _TOO_SLOW_HZ.get(kind)
        lost = f", {stats['gaps']} lost" if stats["gaps"] else ""
        drops = "".join(f", {count} refused: {reason}" for reason, count in stats["drops"].items())
        slow = wanted is not None and stats["hz"] < wanted
        advice = f"Expected at least {wanted:g} Hz." if slow else ""
        level: Literal["ok", "warning"] = "warning" if slow or lost or drops else "ok"
        found.append(Finding(level, topic, f"{stats['hz']:.0f} Hz{lost}{drops}", advice))
    for reason, count in health["drops"].items():
        kinds = {"control": "requests", "door": "connections"}
        what = kinds.get(reason.partition("/")[0], "messages of no known topic")
        found.append(Finding("warning", "bus", f"{count} {what} refused: {reason}"))
    if f"{user}/head/pose" not in health["topics"]:
        found.append(
            Finding(
                "note",
                f"{user}/head/pose",
                "nobody publishes it",
                "Without it feet come without legs, and no camera helps.",
            )
        )
    for name, counts in health["filters"].items():
        slips = counts["rejected"].get("slipped", 0)
        if slips:
            found.append(_slipped(slips, found_again=bool(counts["accepted"].get("found", 0))))
        if name.rpartition("/")[2] not in SIDES:
            continue
        total = sum(counts["accepted"].get(kind, 0) for kind in ("marker", "depth"))
        refused = sum(counts["rejected"].get(verdict, 0) for verdict in _REFUSED)
        if total + refused > 100 and refused > total:
            found.append(
                Finding(
                    "warning",
                    f"fixes {name}",
                    f"{refused} of {total + refused} refused",
                    "Check tag sizes, ids and the mount.",
                )
            )
    return found
