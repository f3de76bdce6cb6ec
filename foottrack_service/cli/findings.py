"""What `foottrack doctor` found out about one thing."""

from __future__ import annotations

from typing import Literal, NamedTuple


class Finding(NamedTuple):
    """One thing that was looked at."""

    level: Literal["ok", "note", "warning", "error"]
    subject: str
    text: str
    advice: str = ""
