"""CURVE: keys and their files, the client's side of a connection, and what went wrong with one in words.

Keys are Curve25519's, as Z85 text, in files of pyzmq's certificate format. libzmq does the cryptography
(https://rfc.zeromq.org/spec/26/).
"""

from __future__ import annotations

import os
import stat
import sys
import uuid
from dataclasses import dataclass, field
from pathlib import Path

import zmq
import zmq.auth
from zmq.utils.monitor import parse_monitor_message

from foottrack_service.bus.endpoints import Context, Socket
from foottrack_service.bus.errors import KeyFileError
from foottrack_service.curve_settings import CurveSettings

SECRET_SUFFIX = ".key_secret"
PUBLIC_SUFFIX = ".key"

_HEARTBEAT_MS = 1_000
_HEARTBEAT_TIMEOUT_MS = 5_000
"""A host that is switched off says no goodbye: without heartbeats its connection would seem to stand for hours."""
_LONGEST_RECONNECT_MS = 2_000
_DIAGNOSIS_MS = 1_000
_CONCLUSIVE = (
    zmq.EVENT_HANDSHAKE_SUCCEEDED
    | zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL
    | zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL
    | zmq.EVENT_HANDSHAKE_FAILED_AUTH
    | zmq.EVENT_CONNECT_RETRIED
)


@dataclass(frozen=True, slots=True)
class KeyPair:
    """A party's keys, Z85."""

    public: str
    secret: str = field(repr=False)


@dataclass(frozen=True, slots=True)
class Credentials:
    """Who connects, and the public key of the service that it means, Z85."""

    own: KeyPair
    service: str


def new_keys(folder: Path, name: str) -> KeyPair:
    """Make a pair and write ``NAME.key`` and ``NAME.key_secret``, the latter for the owner alone.

    Raises KeyFileError: a file is there already (keys are never overwritten), or cannot be written.
    """
    public, secret = (key.decode() for key in zmq.curve_keypair())
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _write(folder / f"{name}{SECRET_SUFFIX}", 0o600, [("public-key", public), ("secret-key", secret)])
        _write(folder / f"{name}{PUBLIC_SUFFIX}", 0o644, [("public-key", public)])
    except FileExistsError as error:
        raise KeyFileError(f"{error.filename} is there already: keys are not overwritten") from None
    except OSError as error:
        raise KeyFileError(f"cannot write keys into {folder}: {error}") from None
    return KeyPair(public, secret)


def load_keys(file: Path) -> KeyPair:
    """Read a secret key file. Raises KeyFileError: missing, no such file's content, or open to others (POSIX)."""
    try:
        public, secret = zmq.auth.load_certificate(file)
        if sys.platform != "win32" and stat.S_IMODE(file.stat().st_mode) & 0o077:
            raise KeyFileError(f"{file} is open to other users of this host. Close it: chmod 600 {file}")
    except (OSError, ValueError) as error:
        raise KeyFileError(f"{file}: {error}. Make keys with: foottrack keys new") from None
    if secret is None:
        raise KeyFileError(f"{file} has no secret key: name the file that ends in {SECRET_SUFFIX}")
    return KeyPair(public.decode(), secret.decode())


def credentials(settings: CurveSettings) -> Credentials | None:
    """A client's keys; None where connections are plain. Raises KeyFileError."""
    if settings.service is None or settings.secret is None:
        return None
    return Credentials(load_keys(settings.secret), settings.service)


def connect(socket: Socket, endpoint: str, who: Credentials | None) -> None:
    """Connect, encrypted where there are credentials."""
    if "[" in endpoint:
        socket.setsockopt(zmq.IPV6, 1)
    if who is not None and endpoint.startswith("tcp://"):
        socket.curve_publickey = who.own.public.encode()
        socket.curve_secretkey = who.own.secret.encode()
        socket.curve_serverkey = who.service.encode()
        socket.setsockopt(zmq.HEARTBEAT_IVL, _HEARTBEAT_MS)
        socket.setsockopt(zmq.HEARTBEAT_TIMEOUT, _HEARTBEAT_TIMEOUT_MS)
        socket.setsockopt(zmq.RECONNECT_IVL_MAX, _LONGEST_RECONNECT_MS)
    socket.connect(endpoint)


def why_not(context: Context, endpoint: str, kind: int, who: Credentials | None) -> str:
    """Why a connection does not come about, in words for a person: tries one of its own, for a second at most."""
    nobody = f"no bus answers at {endpoint}: is the service running?"
    if not endpoint.startswith("tcp://"):
        return nobody
    address = f"inproc://{uuid.uuid4().hex}"
    socket, monitor = context.socket(kind), context.socket(zmq.PAIR)
    try:
        monitor.connect(address)
        socket.monitor(address, _CONCLUSIVE)
        connect(socket, endpoint, who)
        if not monitor.poll(_DIAGNOSIS_MS):
            return nobody
        event = parse_monitor_message(monitor.recv_multipart())
    finally:
        socket.close(0)
        monitor.close(0)
    match event["event"]:
        case zmq.EVENT_HANDSHAKE_SUCCEEDED:
            return f"{endpoint} takes the connection, but no bus answers behind it: is the service running?"
        case zmq.EVENT_HANDSHAKE_FAILED_AUTH if who is not None:
            return (
                f"{endpoint} does not let the key {who.own.public} in: "
                "the service's [bus.curve] clients do not name it, or not for this role"
            )
        # Which of the two it is depends on who closes first.
        case zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL | zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL if who is None:
            return f"{endpoint} takes encrypted connections only: set [bus.curve] secret and service, or run a relay"
        case zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL:
            return f"{endpoint} does not speak CURVE: is that one of the ports of the service's [bus.curve] listen?"
        case zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL if who is not None:
            return (
                f"{endpoint} broke the handshake off: it has another key than [bus.curve] service = "
                f'"{who.service}", or does not speak CURVE'
            )
    return nobody


def _write(file: Path, mode: int, keys: list[tuple[str, str]]) -> None:
    lines = ["curve", *(f'    {name} = "{key}"' for name, key in keys)]
    with os.fdopen(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "w", encoding="utf-8") as out:
        out.write("\n".join(lines) + "\n")
