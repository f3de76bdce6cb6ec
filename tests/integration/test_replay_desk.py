"""The service speaks for a replay in a process of its own, once it was told where that can be asked."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import closing
from typing import Any

import pytest
from free_ports import three_free_ports

from foottrack_protocol.control import ReplayState
from foottrack_service.bus import ControlClient, ControlError, ControlServer
from foottrack_service.bus.endpoints import Context
from foottrack_service.recording.replay_desk import ReplayDesk

LOCAL = "tcp://127.0.0.1:0"
STATE = ReplayState(position=1.5, duration=60.0, rate=2.0, paused=False, published=7)


def seek(position: float) -> ReplayState:
    return STATE.model_copy(update={"position": position})


def test_requests_are_passed_on_to_the_replay_that_was_attached(context: Context, run: Callable[..., Any]) -> None:
    async def scenario() -> None:
        desk = ReplayDesk(context)
        with (
            closing(ControlServer(context, LOCAL, desk.handlers)) as service,
            closing(ControlServer(context, LOCAL, {"replay/seek": seek})) as replay,
            closing(ControlClient(context, service.endpoint)) as client,
            closing(desk),
        ):
            serving = [asyncio.create_task(server.run()) for server in (service, replay)]

            async def error_of(cmd: str, args: dict[str, Any]) -> str:
                with pytest.raises(ControlError) as caught:
                    await client.request(cmd, args)
                return caught.value.code

            for endpoint in ("", "nowhere", "tcp://192.0.2.1:7713"):
                assert await error_of("replay/attach", {"endpoint": endpoint}) == "bad_arguments"
            assert await error_of("replay/seek", {"position": 2.5}) == "not_running"
            assert await client.request("replay/attach", {"endpoint": replay.endpoint}) == {}
            answer = await client.request("replay/seek", {"position": 2.5})
            assert ReplayState.model_validate(answer) == seek(2.5)
            assert await error_of("replay/seek", {"position": -1.0}) == "bad_arguments"
            for task in serving:
                task.cancel()
            await asyncio.gather(*serving, return_exceptions=True)

    run(scenario())


def test_a_replay_that_comes_while_one_that_died_is_still_asked_is_kept(
    context: Context, run: Callable[..., Any]
) -> None:
    async def scenario() -> None:
        desk = ReplayDesk(context)
        with closing(ControlServer(context, LOCAL, {"replay/seek": seek})) as replay, closing(desk):
            serving = asyncio.create_task(replay.run())
            desk.attach(f"tcp://127.0.0.1:{three_free_ports()}")
            asked = asyncio.create_task(desk.pause())
            await asyncio.sleep(0)
            desk.attach(replay.endpoint)
            with pytest.raises(ControlError, match="no replay runs"):
                await asked
            assert ReplayState.model_validate(await desk.seek(2.5)) == seek(2.5)
            serving.cancel()
            await asyncio.gather(serving, return_exceptions=True)

    run(scenario())
