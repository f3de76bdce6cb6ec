"""Golden results: what came out before, kept in a file, and the first field that moved since.

Results are compared with a tolerance that is far below what matters and above what another machine's arithmetic does.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest

from foottrack_protocol import Message, encode
from foottrack_service.recording.compare import Tolerance, compare
from foottrack_service.recording.file import RecordingFile
from foottrack_service.recording.reader import Frame, open_recording

FOLDER = Path(__file__).parent / "golden"
TOLERANCE = Tolerance(absolute=1e-7, relative=1e-7)
_MOST_FIELDS = 8


def check_golden(name: str, results: Iterable[Message], update: bool, folder: Path = FOLDER) -> None:
    """Fail when results differ from ``<name>.results.mcap``, naming the first field; with ``update`` write it anew."""
    path = folder / f"{name}.results.mcap"
    frames = [_frame(message) for message in results]
    if update:
        _write(path, frames)
    if not path.exists():
        pytest.fail(f"there is no {path.name} yet: look at the results, then run pytest tests/replay --update-golden")
    found = compare(open_recording(path).frames(), frames, TOLERANCE)
    if found.first is not None:
        moved = [
            f"  {field}: {moves.messages} messages, by at most {moves.largest:.3g}"
            for field, moves in sorted(found.moved.items(), key=lambda item: -item[1].messages)[:_MOST_FIELDS]
        ]
        pytest.fail(
            "\n".join(
                [
                    f"{name}: {found.first} (A is golden, B is now)",
                    f"{found.compared} compared, {found.only_a} only golden, {found.only_b} only now",
                    *moved,
                    "If that is what you wanted: pytest tests/replay --update-golden, and commit the files.",
                ]
            ),
            pytrace=False,
        )


def _frame(message: Message) -> Frame:
    topic, payload = encode(message)
    return Frame(message.t_pub, topic, payload)


def _write(path: Path, frames: list[Frame]) -> None:
    path.parent.mkdir(exist_ok=True)
    path.unlink(missing_ok=True)
    with RecordingFile(path, None) as file:
        for index, frame in enumerate(frames):
            file.add(frame.topic, frame.payload, frame.arrival, frame.arrival, index)
