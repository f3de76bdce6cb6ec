"""A client's keys, where the service is on another host (SPEC, "From another host")."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple, Self

import zmq.auth

from foottrack_client.errors import KeyFileError


class Keys(NamedTuple):
    """Our own pair and the service's public key, Z85. ``foottrack keys new`` makes them."""

    public: str
    secret: str
    service: str

    @classmethod
    def load(cls, file: Path | str, service: str) -> Self:
        """From a file ``NAME.key_secret``. Raises KeyFileError."""
        try:
            public, secret = zmq.auth.load_certificate(file)
        except (OSError, ValueError) as error:
            raise KeyFileError(f"{file}: {error}. Make keys with: foottrack keys new") from None
        if secret is None:
            raise KeyFileError(f"{file} has no secret key: name the file that ends in .key_secret")
        return cls(public.decode(), secret.decode(), service)

    def __repr__(self) -> str:
        return f"Keys(public={self.public!r}, service={self.service!r})"
