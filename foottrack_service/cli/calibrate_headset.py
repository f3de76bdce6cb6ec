"""``foottrack calibrate headset``: how late the head's stamps are against the camera's."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from foottrack_protocol import Message
from foottrack_protocol.frames import SIDES
from foottrack_service.cli.running import (
    CommandFailed,
    ConfigOption,
    ConnectOption,
    JsonOption,
    UserOption,
    print_json,
    run_loop,
    settings_for,
)
from foottrack_service.config import Settings
from foottrack_service.headset.latency import Fixes, HeadTrack, Unobservable, head_against_camera


def headset(
    file: Annotated[Path | None, typer.Argument(help="A recording of it; live if absent.")] = None,
    seconds: Annotated[float, typer.Option("--seconds", min=3.0, help="Live: how long.")] = 12.0,
    config: ConfigOption = None,
    user: UserOption = None,
    connect: ConnectOption = None,
    as_json: JsonOption = False,
) -> None:
    """Measure the headset's latency: stand still, tags in the camera's view, and look about briskly.

    It is relative to the camera's stamps, which is what matters. Example: foottrack calibrate headset
    """
    settings = settings_for(config, user, connect)
    if file is None:
        typer.echo(f"Stand still and look about briskly for {seconds:g} s: left, right, up, down.", err=True)
        messages = run_loop(_listened(settings, seconds))
    else:
        from foottrack_service.recording.reader import open_recording

        messages = [recorded.message for recorded in open_recording(file).messages()]
    try:
        found = head_against_camera(*_tracks(messages, settings.user))
    except Unobservable as error:
        raise CommandFailed(str(error)) from None
    if as_json:
        print_json(found._asdict())
        return
    typer.echo(
        f"The head's stamps are {1e3 * found.seconds:+.1f} ms off the camera's (sigma {1e3 * found.sigma:.1f} ms); "
        f"standing tags then wander by {1e3 * found.spread:.1f} mm."
    )
    if settings.headset.source == "vmc":
        latency = max(0.0, settings.headset.vmc.latency + found.seconds)
        typer.echo(f"Set it: [headset.vmc] latency = {latency:.4f}")


async def _listened(settings: Settings, seconds: float) -> list[Message]:
    from foottrack_service.bus.connection import Bus

    with Bus.connect(settings.bus) as bus:
        subscriber = bus.subscriber([f"{settings.user}/head/", f"{settings.user}/marker/"])
        await subscriber.ready()
        messages: list[Message] = []
        with suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                async for batch in subscriber.batches():
                    messages += [received.message for received in batch]
        return messages


def _tracks(messages: Iterable[Message], user: str) -> tuple[HeadTrack, list[Fixes]]:
    """Head poses of the last stage, and the sights of both tags while it lay so."""
    usable = [message for message in messages if message.valid and message.user == user]
    heads = [message for message in usable if message.stream == "head/pose" and message.data.tracked]
    last = heads[-1].data.origin if heads else 0
    heads = sorted((message for message in heads if message.data.origin == last), key=lambda message: message.t)
    began = heads[0].t if heads else 0
    head = HeadTrack(
        np.array([message.t for message in heads], dtype=np.int64),
        np.array([message.data.p for message in heads], dtype=np.float64).reshape(-1, 3),
        np.array([message.data.q for message in heads], dtype=np.float64).reshape(-1, 4),
    )
    tags = []
    for side in SIDES:
        sights = [message for message in usable if message.stream == f"marker/{side}" and message.t >= began]
        t = np.array([message.t for message in sights], dtype=np.int64)
        tags.append(Fixes(t, np.array([message.data.p for message in sights], dtype=np.float64).reshape(-1, 3)))
    return head, tags
