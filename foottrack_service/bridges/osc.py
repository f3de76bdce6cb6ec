"""Open Sound Control 1.0 packets (https://opensoundcontrol.stanford.edu/spec-1_0.html), by python-osc."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message import OscMessage
from pythonosc.osc_message_builder import OscMessageBuilder


class Osc(NamedTuple):
    """An address and its arguments: int32, float32 and strings."""

    address: str
    arguments: tuple[int | float | str, ...] = ()


def message(osc: Osc) -> bytes:
    """One message as a datagram."""
    return bytes(_built(osc).dgram)


def bundle(messages: Iterable[Osc]) -> bytes:
    """Messages that belong together, due at once, as one datagram."""
    builder = OscBundleBuilder(IMMEDIATELY)
    for osc in messages:
        builder.add_content(_built(osc))
    return bytes(builder.build().dgram)


def _built(osc: Osc) -> OscMessage:
    builder = OscMessageBuilder(osc.address)
    for argument in osc.arguments:
        kind = {int: "i", float: "f", str: "s"}[type(argument)]
        builder.add_arg(argument, kind)
    return builder.build()
