"""Frames of one recording into another, unchanged."""

from __future__ import annotations

from collections.abc import Iterable

from foottrack_protocol import DecodeError, Reason, decode
from foottrack_service.recording.errors import RecordingError
from foottrack_service.recording.file import RecordingFile
from foottrack_service.recording.recording import Frame


def copy(frames: Iterable[Frame], out: RecordingFile) -> None:
    """Append frames in order; streams that this version does not know are kept as they are.

    Raises RecordingError for a payload that is no message, or when ``out`` cannot be written.
    """
    for frame in frames:
        publish_time, sequence = 0, 0
        try:
            message = decode((frame.topic, frame.payload))
            publish_time, sequence = message.t_pub, message.seq
        except DecodeError as error:
            if error.reason is not Reason.TOPIC:
                raise RecordingError(out.path, f"message that arrived at {frame.arrival} ns: {error}") from None
        out.add(frame.topic, frame.payload, frame.arrival, publish_time, sequence)
