"""Fusion without sockets: messages in order of arrival, in virtual time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from foottrack_protocol import Message
from foottrack_service.fusion.core import FusionCore


def fuse(arrivals: Iterable[tuple[int, Message]], core: FusionCore) -> Iterator[Message]:
    """Results of measurements that arrive at given instants (ns, never falling); the core's timer runs in between.

    Results that a recording already holds are not taken for measurements: the core ignores them.
    """
    for arrival, message in arrivals:
        deadline = core.deadline
        while deadline is not None and deadline < arrival:
            yield from core.tick(deadline)
            deadline = core.deadline
        yield from core.handle(message, arrival)
