"""Offline replay: a recording through fusion without sockets, as fast as the machine can."""

from __future__ import annotations

import itertools
import logging
from collections.abc import Iterator
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from foottrack_protocol import Message, encode
from foottrack_service.config import Settings, from_toml, load, to_toml
from foottrack_service.fusion.core import FusionCore
from foottrack_service.fusion.offline import fuse
from foottrack_service.recording.file import RecordingFile
from foottrack_service.recording.reader import Recording, open_recording

_log = logging.getLogger(__name__)
_EVERY = 1000


def settings_of(recording: Recording, config: Path | None) -> Settings:
    """The settings to replay with: ``config``, else the recording's own, else defaults with a warning."""
    if config is not None:
        return load(config).settings
    if recording.config_toml is not None:
        return from_toml(recording.config_toml)
    _log.warning("%s carries no settings: defaults are used", recording.path)
    return Settings()


def results_of(recording: Recording, settings: Settings, quiet: bool = False) -> Iterator[Message]:
    """Result messages of a recording's measurements, with a progress bar. Raises RecordingError where it is damaged."""
    span = recording.span()
    with Progress(console=Console(stderr=True), transient=True, disable=quiet) as progress:
        bar = progress.add_task(f"replaying {recording.path.name}", total=1.0 if span is None else span.seconds)

        def arrivals() -> Iterator[tuple[int, Message]]:
            for count, recorded in enumerate(recording.messages()):
                if count % _EVERY == 0 and span is not None:
                    progress.update(bar, completed=(recorded.arrival - span.first) * 1e-9)
                yield recorded.arrival, recorded.message

        yield from fuse(arrivals(), FusionCore(settings))


def replay_offline(source: Path, out: Path, config: Path | None) -> int:
    """Write the results of a recording as another one, and say how many messages they are.

    Raises RecordingError, ConfigError.
    """
    recording = open_recording(source)
    settings = settings_of(recording, config)
    results = results_of(recording, settings)
    first = next(results, None)
    created = 0 if first is None else first.t_pub
    with RecordingFile(out, to_toml(settings), created) as file:
        for message in itertools.chain([] if first is None else [first], results):
            topic, payload = encode(message)
            file.add(topic, payload, message.t_pub, message.t_pub, message.seq)
    return file.messages
