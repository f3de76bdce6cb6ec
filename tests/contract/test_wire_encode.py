"""What our side sends, every receiver takes: encode refuses with a typed error whatever decode would refuse."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from foottrack_protocol import (
    MAX_PAYLOAD_BYTES,
    TOPICS,
    EncodeError,
    Message,
    ProtocolError,
    TopicError,
    decode,
    encode,
)
from foottrack_protocol import messages as m
from foottrack_protocol.control import COMMANDS, ReplayState
from foottrack_protocol.envelope import pack_map, unpack_map
from foottrack_protocol.golden.bodies import BODIES

IMU = m.Imu(acc=(0.0, 9.75, 0.0), gyro=(0.0, 0.0, 0.0), t_arr=5)
GOOD = Message("user", "imu/left", "imu-left", "a1", 0, 1, 2, True, IMU)

SCALARS: st.SearchStrategy[Any] = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(2**70), 2**70),
    st.floats(),
    st.text(),
    st.binary(max_size=5),
    st.just([]),
    st.just({}),
    st.integers(-128, 127).map(np.int8),
    st.integers(0, 2**63 - 1).map(np.int64),
    st.integers(0, 2**64 - 1).map(np.uint64),
    st.floats().map(np.float64),
    st.floats(width=32).map(np.float32),
    st.booleans().map(np.bool_),
    st.text().map(np.str_),
    st.just(np.zeros(3)),
)
BODY_MODELS: st.SearchStrategy[Any] = st.sampled_from(
    [entry.adapter.validate_python(BODIES[stream]) for stream, entry in TOPICS.items()]
)


@settings(max_examples=800)
@given(st.sampled_from(sorted(set(Message._fields) - {"data"})), SCALARS, BODY_MODELS | SCALARS)
def test_what_is_sent_can_be_read(field: str, value: Any, data: Any) -> None:
    for message in (
        GOOD._replace(**{field: value}),
        GOOD._replace(data=data),
        GOOD._replace(data=data, **{field: value}),
    ):
        try:
            frames = encode(message)
        except ProtocolError:
            continue
        assert decode(frames) == message


@pytest.mark.parametrize("field", ["seq", "t", "t_pub"])
@pytest.mark.parametrize("value", [np.int64(3), np.uint8(3), np.float64(3.0), 3.0, True, None, 2**63, "3"])
def test_numpy_and_other_integers_in_the_envelope_are_refused(field: str, value: Any) -> None:
    with pytest.raises(EncodeError, match=field):
        encode(GOOD._replace(**{field: value}))


@pytest.mark.parametrize("value", [np.bool_(True), 1, None, "true"])
def test_numpys_bool_and_other_truths_are_refused_in_the_envelope(value: Any) -> None:
    with pytest.raises(EncodeError, match="valid"):
        encode(GOOD._replace(valid=value))


def test_numpys_floats_and_arrays_become_plain_ones_in_a_body() -> None:
    body = m.Imu(
        acc=np.array([0.5, 9.75, -0.5]),
        gyro=(np.float64(0.25), np.float32(0.5), np.int64(1)),
        q=np.array([0.0, 0.0, 0.0, 1.0]),
        t_arr=5,
    )
    assert [type(number) for number in (*body.acc, *(body.gyro or ()), *(body.q or ()))] == [float] * 10
    assert decode(encode(GOOD._replace(data=body))).data.gyro == (0.25, 0.5, 1.0)


@pytest.mark.parametrize(
    "body",
    [
        lambda: m.Imu(acc=(0, 0, float("nan")), gyro=(0, 0, 0), t_arr=5),
        lambda: m.Imu(acc=(0, 0, np.float64("inf")), gyro=(0, 0, 0), t_arr=5),
        lambda: m.Imu(acc=(0, 0, 10**400), gyro=(0, 0, 0), t_arr=5),
        lambda: m.Imu(acc=(0, 0, 0), gyro=(0, 0, 0), t_arr=np.int64(5)),
        lambda: m.HeadPose(tracked=np.bool_(False)),
        lambda: IMU.model_copy(update={"acc": (0.0, 0.0, float("nan"))}),
        lambda: m.Imu(acc=(0, 0, 0), gyro=(0, 0, 0), t_arr=5, t_dev=2**63),
    ],
)
def test_a_body_that_no_receiver_takes_cannot_be_made(body: Any) -> None:
    with pytest.raises(ValidationError):
        body()


def test_a_copy_has_what_was_changed() -> None:
    assert IMU.model_copy(update={"t_dev": 7}) == m.Imu(acc=IMU.acc, gyro=IMU.gyro, t_arr=5, t_dev=7)
    assert IMU.model_copy() == IMU


def test_a_body_of_another_stream_is_refused() -> None:
    with pytest.raises(EncodeError, match="data must be Optical, not Imu"):
        encode(GOOD._replace(stream="marker/left"))
    with pytest.raises(EncodeError, match="not dict"):
        encode(GOOD._replace(data=IMU.model_dump()))


@pytest.mark.parametrize(
    ("user", "stream"), [("user", "imu"), ("User", "imu/left"), ("sys", "imu/left"), (3, "log"), ([], "log")]
)
def test_an_unknown_topic_is_refused(user: Any, stream: str) -> None:
    with pytest.raises(TopicError):
        encode(GOOD._replace(user=user, stream=stream))


def test_too_large_is_refused_at_the_byte() -> None:
    def picture(size: int) -> Message:
        return GOOD._replace(stream="camera/preview", data=m.CameraPreview(jpeg=bytes(size)))

    # The header of a bin grows with its size, so it is measured with one of nearly the same.
    rest = len(encode(picture(200_000))[1]) - 200_000
    assert len(encode(picture(MAX_PAYLOAD_BYTES - rest))[1]) == MAX_PAYLOAD_BYTES
    with pytest.raises(EncodeError, match=f"{MAX_PAYLOAD_BYTES + 1} bytes"):
        encode(picture(MAX_PAYLOAD_BYTES - rest + 1))


def test_text_that_utf8_does_not_have_is_refused() -> None:
    record = m.LogRecord(level="error", logger="x", message="\ud800")
    with pytest.raises(EncodeError):
        encode(GOOD._replace(user="sys", stream="log", data=record))


@pytest.mark.parametrize(
    "values",
    [{"a": np.int64(1)}, {"a": object()}, {"a": 2**64}, {1: 2}, {"a": bytes(MAX_PAYLOAD_BYTES)}, {"a": [0] * 1025}],
)
def test_a_request_that_no_service_takes_is_refused(values: Any) -> None:
    with pytest.raises(EncodeError):
        pack_map(values)


def test_bodies_inside_answers_are_maps() -> None:
    state = ReplayState(position=1.5, duration=60.0, rate=1.0, paused=False, published=7)
    answer = unpack_map(pack_map({"ok": True, "result": state}))
    assert COMMANDS["replay/pause"].result.model_validate(answer["result"]) == state
