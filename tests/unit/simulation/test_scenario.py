"""A scenario's messages: on the wire, in order, the same every time, each sensor's noise its own."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import numpy as np
import pytest

from foottrack_protocol import Message, decode, encode
from foottrack_service.config import FeetSettings, FootSettings, Settings, TimingSettings
from foottrack_service.simulation.scenario import Scenario, simulate
from foottrack_service.simulation.tasks import TASKS


def by_stream(scenario: Scenario) -> dict[str, list[Message]]:
    streams: dict[str, list[Message]] = defaultdict(list)
    for _, message in scenario.messages():
        streams[message.stream].append(message)
    return streams


def test_the_tasks_of_the_study_and_the_bench_are_there() -> None:
    assert list(TASKS) == [
        "still", "head-moving", "steps", "side-steps", "line", "circle", "knee-bends", "upper-body",
        "tracker-moving", "head-bench", "sudden-move", "walk-in-place", "walk", "stairs", "s-curve",
        "calibration",
    ]  # fmt: skip
    assert all(task.name == name and task.description and task.seconds >= 15.0 for name, task in TASKS.items())


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize(("imu", "feet"), [("fused", "mild"), ("raw", "hard")])
def test_every_message_survives_the_wire(task: str, imu: Any, feet: Any) -> None:
    count = 0
    for _, message in simulate(task, 1, seconds=6.0, imu=imu, feet=feet).messages():
        assert decode(encode(message)) == message
        count += 1
    assert count > 6 * 500


def test_rates_sources_and_numbers() -> None:
    streams = by_stream(simulate("still", 1, seconds=10.0, imu_hz=400.0))
    assert {stream: round(len(messages) / 10.0, -1) for stream, messages in streams.items()} == {
        "imu/left": 400, "imu/right": 400, "marker/left": 60, "marker/right": 60, "depth/left": 60, "depth/right": 60,
        "head/pose": 90, "truth/left": 100, "truth/right": 100,
    }  # fmt: skip
    for stream, messages in streams.items():
        assert [message.seq for message in messages] == list(range(len(messages))), (
            "no gap: nothing was lost on the bus"
        )
        assert len({message.sid for message in messages}) == 1
        source = {"imu": stream.replace("/", "-"), "head": "headset", "truth": "truth"}.get(
            stream.split("/")[0], "camera"
        )
        assert {message.src for message in messages} == {source}
        assert all(message.t < message.t_pub for message in messages)


def test_messages_come_in_order_of_arrival_after_they_were_published() -> None:
    arrivals = [(arrival, message.t_pub) for arrival, message in simulate("walk", 2, seconds=8.0).messages()]
    assert arrivals == sorted(arrivals)
    assert all(0 < arrival - t_pub < 1_000_000 for arrival, t_pub in arrivals)


def test_pictures_arrive_30_ms_late_and_imu_samples_3() -> None:
    streams = by_stream(simulate("still", 1, seconds=10.0))
    late = {s: np.median([m.t_pub - m.t for m in messages]) / 1e6 for s, messages in streams.items()}
    assert 27.0 < late["marker/left"] < 35.0
    assert 2.0 < late["imu/left"] < 4.0
    assert 4.0 < late["head/pose"] < 7.0


def test_the_same_seed_gives_the_same_bytes_and_another_does_not() -> None:
    def data(seed: int, **more: Any) -> list[tuple[int, tuple[bytes, bytes]]]:
        return [(t, encode(m)) for t, m in simulate("walk", seed, seconds=4.0, feet="hard", **more).messages()]

    assert data(3) == data(3)
    assert data(3) != data(4)
    first = simulate("walk", 3, seconds=4.0)
    assert list(first.messages()) == list(first.messages())
    assert first.sid != simulate("walk", 4, seconds=4.0).sid


def test_a_scenario_can_begin_at_any_bus_time() -> None:
    early, late = simulate("steps", 1, seconds=3.0), simulate("steps", 1, seconds=3.0, start=10**15)
    assert list(early.at(10**15).messages()) == list(late.messages())
    for (a, one), (b, other) in zip(early.messages(), late.messages(), strict=True):
        assert b - a == other.t - one.t == other.t_pub - one.t_pub == 10**15
        if one.stream.startswith("imu"):
            assert other.data.t_arr - one.data.t_arr == 10**15


def test_leaving_a_sensor_out_changes_no_other() -> None:
    full = by_stream(simulate("walk", 5, seconds=4.0))
    for left_out, gone in (
        ({"left_imu": False}, {"imu/left"}),
        ({"right_imu": False}, {"imu/right"}),
        ({"depth": False}, {"depth/left", "depth/right"}),
        ({"camera": False}, {"depth/left", "depth/right", "marker/left", "marker/right"}),
    ):
        rest = by_stream(simulate("walk", 5, seconds=4.0, **left_out))  # type: ignore[arg-type]
        assert set(full) - set(rest) == gone
        assert all(rest[stream] == full[stream] for stream in rest)


def test_rates_and_kinds_of_imu_walk_the_same_way() -> None:
    one, other = simulate("walk", 5, seconds=4.0), simulate("walk", 5, seconds=4.0, imu_hz=400.0, imu="raw")
    assert by_stream(one)["truth/left"] == by_stream(other)["truth/left"]
    assert by_stream(one)["marker/left"] == by_stream(other)["marker/left"]
    assert all(m.data.gyro is None and m.data.q is not None for m in by_stream(one)["imu/left"])
    assert all(m.data.gyro is not None and m.data.q is None for m in by_stream(other)["imu/left"])


def test_settings_place_user_sensors_and_delay() -> None:
    quarter = (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))
    settings = Settings(
        user="anna",
        feet=FeetSettings(left=FootSettings(imu={"q": quarter})),  # type: ignore[arg-type]
        timing=TimingSettings(imu_delay=0.01),
    )
    turned = by_stream(simulate("still", 1, seconds=3.0, settings=settings))
    plain = by_stream(simulate("still", 1, seconds=3.0))
    assert all(m.user == "anna" for messages in turned.values() for m in messages)
    assert abs(np.mean([m.data.acc[0] for m in turned["imu/left"]]) - 9.8) < 0.6
    assert abs(np.mean([m.data.acc[1] for m in turned["imu/right"]]) - 9.8) < 0.6
    assert turned["imu/left"][5].t - plain["imu/left"][5].t == pytest.approx(10_000_000, abs=2)
    assert turned["imu/left"][5].t_pub == plain["imu/left"][5].t_pub


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"task": "flying"}, "no task is called 'flying'; there are still,"),
        ({"seconds": 0.5}, "1 to 3600 s"),
        ({"imu_hz": 5000.0}, "20 to 1600 Hz"),
    ],
)
def test_what_cannot_be_is_refused(arguments: dict[str, Any], text: str) -> None:
    with pytest.raises(ValueError, match=text):
        simulate(**{"task": "walk", "seed": 1, **arguments})


@pytest.mark.parametrize("body", [{"height": 1.0}, {"height": 2.2}, {"height": 1.6, "thigh": 0.5, "shank": 0.5}])
@pytest.mark.parametrize("task", ["knee-bends", "upper-body", "steps"])
def test_any_body_has_a_head_in_every_posture(task: str, body: dict[str, float]) -> None:
    settings = Settings.model_validate({"body": body})
    truth = simulate(task, 1, settings=settings, seconds=12.0, camera=False, left_imu=False, right_imu=False).truth
    t = np.linspace(0.0, 12.0, 400)
    p, q = truth.head.pose(t)
    assert np.isfinite(p).all() and np.isfinite(q).all()
    assert p[:, 1].min() > 0.2 * body["height"]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("task", ["line", "circle", "walk", "walk-in-place", "steps", "side-steps"])
def test_any_seed_and_length_makes_a_plan(task: str, seed: int) -> None:
    for seconds in (1.0, 7.3, 45.0):
        truth = simulate(task, seed, seconds=seconds, camera=False, left_imu=False, right_imu=False).truth
        t = np.linspace(0.0, seconds, 400)
        assert np.isfinite(truth.left.pose(t)[0]).all()
        assert np.linalg.norm(truth.left.velocity(t), axis=-1).max() < 6.5
