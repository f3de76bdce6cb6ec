"""Settings: flags, then environment, then what calibration stored, then ``foottrack.toml``, then defaults.

Everything that results depend on is here, so a recording that carries these settings can be replayed to the bit.
Device rooms describe their own settings and are composed here.
"""

from __future__ import annotations

import hashlib
import json
import logging
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import AfterValidator, Field, ValidationError
from pydantic_settings import BaseSettings, EnvSettingsSource, PydanticBaseSettingsSource, SettingsConfigDict

from foottrack_protocol.frames import TAG_ON_INSTEP
from foottrack_protocol.messages import Float, Quat, Side, Vec3
from foottrack_protocol.topics import DEFAULT_USER, is_user
from foottrack_service.bridges.settings import BridgesSettings
from foottrack_service.camera.settings import SourceSettings
from foottrack_service.curve_settings import CurveSettings
from foottrack_service.gait.settings import GaitSettings
from foottrack_service.headset.settings import HeadsetSettings
from foottrack_service.imu.settings import ImuSettings
from foottrack_service.section import Section

DEFAULT_FILE = Path("foottrack.toml")
_log = logging.getLogger(__name__)
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


class ConfigError(Exception):
    """Settings that cannot be used; the text names the place and what was wrong."""


class Placement(Section):
    """A part's place [m] and rotation (part to parent) on its parent."""

    p: Vec3 = (0.0, 0.0, 0.0)
    q: Quat = (0.0, 0.0, 0.0, 1.0)


class ToePlacement(Section):
    """The toes' tip in the foot's frame, m."""

    p: Vec3 = (0.0, -0.07, -0.19)


class BodySettings(Section):
    """The user's measures, m. What is nil is scaled from the height."""

    height: Positive = 1.75
    thigh: Positive | None = None
    shank: Positive | None = None
    torso: Positive | None = None
    hip_width: Positive | None = None
    hip_back: Float | None = None
    neck_down: Positive | None = Field(default=None, description="what the head nods about, below the eyes")
    neck_back: Float | None = Field(default=None, description="the same, behind the eyes")
    solver: Literal["two-bone", "fabrik"] = Field(
        default="two-bone", description="hips by trunk and legs, or by a spine with joint limits besides (FABRIK)"
    )


class FootSettings(Section):
    """What one shoe carries, in the foot's frame: origin at the ankle, +Y up, -Z to the toes."""

    ankle_height: Positive = Field(default=0.09, description="ankle joint above the sole, m")
    imu: Placement = Placement()
    marker: Placement = Placement(p=(0.0, -0.04, -0.15), q=TAG_ON_INSTEP)
    toe: ToePlacement = ToePlacement()


class FeetSettings(Section):
    """Both shoes."""

    shoes: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,40}$")] = Field(
        default="default", description="name of the pair; what is calibrated on shoes is kept by it"
    )
    left: FootSettings = FootSettings()
    right: FootSettings = FootSettings()

    def of(self, side: Side) -> FootSettings:
        """One side's settings."""
        return self.left if side == "left" else self.right


class TagSettings(Section):
    """One printed tag. ``p`` and ``q`` place it in the target's frame."""

    id: Annotated[int, Field(ge=0)]
    size: Positive = Field(description="edge of the black square, m")
    p: Vec3 = (0.0, 0.0, 0.0)
    q: Quat = (0.0, 0.0, 0.0, 1.0)


class TargetSettings(Section):
    """The optical target of one shoe: one tag or several."""

    tags: tuple[TagSettings, ...]


class TargetsSettings(Section):
    """Both shoes' targets."""

    left: TargetSettings = TargetSettings(tags=(TagSettings(id=0, size=0.06),))
    right: TargetSettings = TargetSettings(tags=(TagSettings(id=1, size=0.06),))

    def of(self, side: Side) -> TargetSettings:
        """One side's target."""
        return self.left if side == "left" else self.right


class CameraSettings(Section):
    """The downward camera on the headset."""

    mount: Placement = Field(
        default=Placement(p=(0.0, 0.0, -0.08), q=(-0.17364817766693033, 0.0, 0.0, 0.984807753012208)),
        description="camera (-Z into the picture, +Y up) to head: 20 deg down",
    )
    dictionary: str | Annotated[tuple[str, ...], Field(min_length=1)] = Field(
        default="DICT_4X4_50",
        description="OpenCV's name, GENERATED_3X3_4 (found in more blur, and where there is none in 0.3 % of windows), "
        "or the tags' cells as strings of 0 and 1",
    )
    targets: TargetsSettings = TargetsSettings()
    source: SourceSettings = SourceSettings()

    @property
    def mount_hash(self) -> str:
        """Names the configured mount, so that a correction found on top of it is never applied to another."""
        return _digest(self.mount.model_dump(mode="json"))


class TimingSettings(Section):
    """Known delays."""

    imu_delay: Float = Field(default=0.0, description="from what the sensor felt to its stamp, s; fusion takes it off")


class FusionSettings(Section):
    """The fusion node."""

    filter: Literal["error-state", "reference"] = Field(
        default="error-state", description="ours, or the published one that reports compare with"
    )
    floor: bool = Field(default=True, description="a standing sole is on the floor; false where there are stairs")
    mount_calibration: bool = Field(
        default=True, description="find in use, and apply, what the camera's mount lacks (not with the reference)"
    )
    max_output_hz: Positive = 200.0
    silence: Positive = Field(default=0.02, description="when nothing came for so long, a timer publishes, s")


class BusSettings(Section):
    """Where the bus listens: on loopback only, and encrypted elsewhere."""

    ingress: str = "tcp://127.0.0.1:7701"
    egress: str = "tcp://127.0.0.1:7702"
    control: str = "tcp://127.0.0.1:7703"
    curve: CurveSettings = CurveSettings()

    @classmethod
    def beginning_at(cls, where: str) -> BusSettings:
        """Three ports in a row: ``tcp://127.0.0.1:7701``, ``127.0.0.1:7701`` or ``7701``; 0 takes free ones.

        Raises ConfigError when that is no address with a port.
        """
        host, _, port = where.removeprefix("tcp://").rpartition(":")
        if not port.isdecimal() or int(port) > 65533:
            raise ConfigError(f"{where!r} is no address with a port, such as tcp://127.0.0.1:7701")
        first = int(port)
        ports = [0, 0, 0] if first == 0 else [first, first + 1, first + 2]
        ingress, egress, control = (f"tcp://{host or '127.0.0.1'}:{number}" for number in ports)
        return cls(ingress=ingress, egress=egress, control=control)


class RecordingSettings(Section):
    """Recordings on request."""

    folder: Path = Field(default=Path("recordings"), description="where `record/start` puts them, and nowhere else")


def _user_name(name: str) -> str:
    if not is_user(name):
        raise ValueError("a user is a-z, 0-9 and '-', at most 32 characters, and not 'sys'")
    return name


class Settings(BaseSettings):
    """Everything that can be set."""

    model_config = SettingsConfigDict(
        extra="forbid", frozen=True, env_prefix="FOOTTRACK_", env_nested_delimiter="__", validate_default=True
    )

    user: Annotated[str, AfterValidator(_user_name)] = DEFAULT_USER
    body: BodySettings = BodySettings()
    feet: FeetSettings = FeetSettings()
    camera: CameraSettings = CameraSettings()
    imu: ImuSettings = ImuSettings()
    headset: HeadsetSettings = HeadsetSettings()
    timing: TimingSettings = TimingSettings()
    fusion: FusionSettings = FusionSettings()
    gait: GaitSettings = GaitSettings()
    bus: BusSettings = BusSettings()
    recording: RecordingSettings = RecordingSettings()
    bridges: BridgesSettings = BridgesSettings()

    @classmethod
    def settings_customise_sources(
        cls,
        settings_cls: type[BaseSettings],
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,
        file_secret_settings: PydanticBaseSettingsSource,
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """Only what ``load`` hands over: it merges the layers itself, to know where each value came from."""
        return (init_settings,)

    @property
    def digest(self) -> str:
        """Hash of all settings, as ``sys/session`` shows it."""
        return _digest(self.model_dump(mode="json"))


class Loaded(NamedTuple):
    """Settings, and for each key that is not a default the name of the layer that set it."""

    settings: Settings
    origins: dict[str, str]


def load(
    file: Path | None = None,
    flags: Mapping[str, Any] | None = None,
    calibration: Mapping[str, Any] | None = None,
) -> Loaded:
    """Merge the layers. ``file`` None takes ``foottrack.toml`` of the working folder if it is there.

    Raises ConfigError: a file that is missing or no TOML, an unknown key, a value out of range.
    """
    layers: list[tuple[str, Mapping[str, Any]]] = []
    if file is not None or DEFAULT_FILE.exists():
        chosen = file or DEFAULT_FILE
        layers.append((str(chosen), _read(chosen)))
    layers.append(("calibration", calibration or {}))
    layers.append(("environment", EnvSettingsSource(Settings)()))
    layers.append(("flag", flags or {}))
    merged: dict[str, Any] = {}
    origins: dict[str, str] = {}
    for name, layer in layers:
        _merge(merged, layer, name, "", origins)
    return Loaded(_validated(merged, origins), origins)


def from_toml(text: str) -> Settings:
    """Settings of a recording's attachment: the file alone, no environment. Raises ConfigError.

    A recording outlives a setting's name: keys that this version does not know are left out, with a warning.
    """
    try:
        values = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"not TOML: {error}") from None
    while True:
        try:
            return Settings(**values)
        except ValidationError as error:
            unknown = [item["loc"] for item in error.errors(include_url=False) if item["type"] == "extra_forbidden"]
            if not unknown:
                return _validated(values, {})
            for place in unknown:
                _log.warning("the recording's setting %s is not known to this version", ".".join(map(str, place)))
                _remove(values, place)


def to_toml(settings: Settings) -> str:
    """All settings, defaults too, as TOML that ``from_toml`` reads back unchanged."""
    return "\n".join(_toml_lines(settings.model_dump(mode="json", exclude_none=True), ())) + "\n"


def toml_value(value: Any) -> str:
    """A plain value as TOML writes it."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(toml_value(item) for item in value) + "]"
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value)


def _read(file: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{file}: {error}") from None
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{file}: not TOML: {error}") from None


def _remove(values: Any, place: Sequence[int | str]) -> None:
    for key in place[:-1]:
        values = values[key]
    del values[place[-1]]


def _merge(into: dict[str, Any], layer: Mapping[str, Any], name: str, prefix: str, origins: dict[str, str]) -> None:
    for key, value in layer.items():
        place = f"{prefix}{key}"
        if isinstance(value, Mapping):
            below = into.setdefault(key, {})
            if isinstance(below, dict):
                _merge(below, value, name, place + ".", origins)
                continue
        into[key] = value
        origins[place] = name


def _validated(merged: dict[str, Any], origins: Mapping[str, str]) -> Settings:
    try:
        return Settings(**merged)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        source = next((f" ({layer})" for key, layer in origins.items() if key.startswith(place)), "")
        raise ConfigError(f"[{place}]{source}: {first['msg']}") from None


def _toml_lines(table: Mapping[str, Any], path: tuple[str, ...]) -> list[str]:
    values = {key: value for key, value in table.items() if not isinstance(value, dict)}
    lines = [f"[{'.'.join(path)}]"] if path and values else []
    lines += [f"{key} = {toml_value(value)}" for key, value in values.items()]
    for key, value in table.items():
        if isinstance(value, dict):
            lines += _toml_lines(value, (*path, key))
    return lines


def _digest(values: Any) -> str:
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:16]
