"""What can be set about CURVE: encrypted and authenticated connections beside the plain ones on loopback."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from foottrack_service.section import Section

Role = Literal["publish", "subscribe", "control"]
ROLES: tuple[Role, ...] = ("publish", "subscribe", "control")

PublicKey = Annotated[str, StringConstraints(pattern=r"^[0-9a-zA-Z.\-:+=^!/*?&<>()\[\]{}@%$#]{40}$")]
"""32 bytes in Z85 (https://rfc.zeromq.org/spec/32/), as `foottrack keys new` prints them."""


class CurveClient(Section):
    """Somebody who is let in."""

    name: str = Field(description="for the log")
    key: PublicKey
    roles: tuple[Role, ...] = Field(default=ROLES, description="what it may do; all, unless fewer are named")


class CurveSettings(Section):
    """Keys. The service has `secret`, `listen` and `clients`; who connects to it from another host `secret` and
    `service`."""

    secret: Path | None = Field(default=None, description="this party's own secret key file")
    listen: str | None = Field(
        default=None, description="first of three ports that take encrypted connections, as in tcp://0.0.0.0:7711"
    )
    clients: tuple[CurveClient, ...] = ()
    service: PublicKey | None = Field(default=None, description="the service's public key, by which a client knows it")

    @model_validator(mode="after")
    def _has_its_key(self) -> Self:
        for name in ("listen", "service"):
            if getattr(self, name) is not None and self.secret is None:
                raise ValueError(f"{name} needs secret, a key file: make one with `foottrack keys new`")
        return self
