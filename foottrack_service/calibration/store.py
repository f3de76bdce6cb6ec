"""What calibrations found, kept for the next start: one JSON file per user, written whole or not at all.

What belongs to a pair of shoes (where an IMU sits on it) is kept by the shoes' name. A heading is not kept: each IMU's
yaw is another one whenever it is switched on.
"""

from __future__ import annotations

import json
import logging
import os
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any

import platformdirs
from pydantic import TypeAdapter, ValidationError

from foottrack_protocol.messages import BodyCalibration, Calibration, HeadingCalibration, ImuCalibration

FOLDER_VARIABLE = "FOOTTRACK_CALIBRATION_FOLDER"
"""Another folder than the system's own for a user's data."""
_BODY = TypeAdapter(Calibration)
_log = logging.getLogger(__name__)


class StoreError(Exception):
    """A result could not be kept; the text says where and why."""


class Store:
    """Calibrations of one user in one pair of shoes."""

    def __init__(self, folder: Path, user: str, shoes: str) -> None:
        self.path = folder / f"{user}.json"
        self._shoes = shoes
        self._said: set[str] = set()

    @classmethod
    def at_home(cls, user: str, shoes: str) -> Store:
        """In this person's folder of this machine."""
        chosen = os.environ.get(FOLDER_VARIABLE)
        folder = Path(chosen) if chosen else Path(platformdirs.user_data_dir("foottrack", appauthor=False))
        return cls(folder / "calibration" if not chosen else folder, user, shoes)

    def load(self) -> list[Any]:
        """Bodies of ``calibration`` messages. What cannot be read is left out, and said in the log."""
        kept = self._read()
        found = []
        for name, entry in {**kept.get("user", {}), **kept.get("shoes", {}).get(self._shoes, {})}.items():
            try:
                found.append(_BODY.validate_python(entry))
            except ValidationError as error:
                self._say_once(f"{name} is left out: {error.errors(include_url=False)[0]['msg']}")
        return found

    def layer(self) -> dict[str, Any]:
        """The same as far as settings have a place for it, for ``config.load``."""
        layer: dict[str, Any] = {}
        for body in self.load():
            if isinstance(body, BodyCalibration):
                layer["body"] = body.values.model_dump(mode="json", exclude_none=True)
            elif isinstance(body, ImuCalibration):
                placed = body.values.model_dump(mode="json", include={"p", "q"})
                layer.setdefault("feet", {})[body.values.side] = {"imu": placed}
        return layer

    def keep(self, body: Any) -> None:
        """Add a result, in place of an older one of its kind. A heading is left out. Raises StoreError."""
        if isinstance(body, HeadingCalibration):
            return
        kept = self._read()
        if isinstance(body, ImuCalibration):
            place = kept.setdefault("shoes", {}).setdefault(self._shoes, {})
            name = f"imu_{body.values.side}"
        else:
            place, name = kept.setdefault("user", {}), body.kind
        place[name] = body.model_dump(mode="json")
        try:
            self._write(json.dumps(kept, indent=2) + "\n")
        except OSError as error:
            raise StoreError(f"{self.path}: {error}") from None

    def _read(self) -> dict[str, Any]:
        try:
            kept = json.loads(self.path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            return {}
        except (OSError, ValueError) as error:
            self._say_once(f"it is left out: {error}")
            return {}
        if not isinstance(kept, dict) or not all(isinstance(part, dict) for part in _parts(kept)):
            self._say_once("it is left out: it is no file of calibrations")
            return {}
        return kept

    def _say_once(self, text: str) -> None:
        # The service looks into the file every few seconds.
        if text not in self._said:
            self._said.add(text)
            _log.warning("%s: %s", self.path, text)

    def _write(self, text: str) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=self.path.parent, prefix=self.path.name, suffix=".part")
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
            Path(name).replace(self.path)
        except OSError:
            with suppress(OSError):
                Path(name).unlink()
            raise


def _parts(kept: dict[str, Any]) -> list[Any]:
    shoes = kept.get("shoes", {})
    return [kept.get("user", {}), shoes, *(shoes.values() if isinstance(shoes, dict) else ())]
