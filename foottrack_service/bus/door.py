"""The service's side of CURVE: whom it lets in for what (ZAP), and those whom it does not, in words.

A socket takes both kinds of connections: libzmq copies a socket's options into each listener when it is bound, so
what is set here holds for the encrypted endpoint alone and the plain one on loopback stays as it is.
"""

from __future__ import annotations

import contextlib
import logging
import threading
import time
import uuid
from collections import Counter

import zmq
from zmq.utils import z85
from zmq.utils.monitor import parse_monitor_message

from foottrack_service.bus.endpoints import Context, Socket, bind
from foottrack_service.bus.errors import BindFailed, BusError
from foottrack_service.bus.security import load_keys
from foottrack_service.config import BusSettings
from foottrack_service.curve_settings import CurveClient, CurveSettings, Role

REASONS = ("key", "role", "not_encrypted", "service_key", "protocol", "handshake")
"""Why somebody is not let in: his key is not on the list, or not for this role; he speaks in the clear; he means
another service; he speaks something else; he left before he had said what he speaks. Who speaks in the clear learns
from the first bytes that he should not, so he may be gone before libzmq has read his: then the last it is."""

_ZAP = "inproc://zeromq.zap.01"
"""Where libzmq asks whether a client may come in: https://rfc.zeromq.org/spec/27/."""
_LOOK, _STOP = b"look", b"stop"
_LOG_PERIOD_S = 1.0
_STOP_TIMEOUT_S = 5.0
_WATCHED = zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL | zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL | zmq.EVENT_MONITOR_STOPPED

_log = logging.getLogger(__name__)


class Doorkeeper:
    """Lets clients in by key and role. One for each context, which asks it through ZAP.

    Start it, ``bind`` the sockets, close these, and then stop it. ``refused`` counts those who were not let in, by
    reason: one of ``REASONS``.
    """

    def __init__(self, context: Context, settings: CurveSettings) -> None:
        """Raises KeyFileError. ``listen`` and ``secret`` are there."""
        assert settings.listen is not None
        assert settings.secret is not None
        ends = BusSettings.beginning_at(settings.listen)
        self.endpoints: dict[Role, str] = {"publish": ends.ingress, "subscribe": ends.egress, "control": ends.control}
        # All reasons from the start: others read it while the thread counts.
        self.refused = Counter(dict.fromkeys(REASONS, 0))
        self._context = context
        self._keys = load_keys(settings.secret)
        self._clients = {client.key: client for client in settings.clients}
        self._arrivals: list[tuple[Role, Socket]] = []
        self._monitors: dict[Socket, Role] = {}
        self._last_log = -_LOG_PERIOD_S
        self._thread = threading.Thread(target=self._run, name="bus-door", daemon=True)

    def start(self) -> None:
        """Answer libzmq's questions from now on. Raises BindFailed when another one of this context does."""
        self._zap = self._context.socket(zmq.REP)
        try:
            self._zap.bind(_ZAP)
        except zmq.ZMQError as error:
            self._zap.close(0)
            raise BindFailed(f"this context has a doorkeeper already: {error}") from None
        self._thread.start()

    def bind(self, socket: Socket, role: Role) -> str:
        """Open the encrypted endpoint of a role, and say the actual one. Raises BindFailed."""
        socket.curve_server = True
        socket.curve_secretkey = self._keys.secret.encode()
        socket.zap_domain = role.encode()
        # Without an answer from ZAP nobody comes in; libzmq's default lets everybody in then.
        socket.setsockopt(zmq.ZAP_ENFORCE_DOMAIN, 1)
        address = f"inproc://{uuid.uuid4().hex}"
        monitor = self._context.socket(zmq.PAIR)
        monitor.connect(address)
        socket.monitor(address, _WATCHED)
        self._arrivals.append((role, monitor))
        self._tell(_LOOK)
        self.endpoints[role] = bind(socket, self.endpoints[role], encrypted=True)
        return self.endpoints[role]

    def stop(self) -> None:
        """Let nobody in any more. Raises BusError when the thread does not end."""
        if self._thread.is_alive():
            self._tell(_STOP)
            self._thread.join(_STOP_TIMEOUT_S)
            if self._thread.is_alive():
                raise BusError(f"the doorkeeper did not stop within {_STOP_TIMEOUT_S:g} s")

    def _tell(self, word: bytes) -> None:
        asking = self._context.socket(zmq.REQ)
        asking.connect(_ZAP)
        asking.send(word)
        asking.close(int(_STOP_TIMEOUT_S * 1000))

    def _run(self) -> None:
        poller = zmq.Poller()
        poller.register(self._zap, zmq.POLLIN)
        try:
            while True:
                for socket, _ in poller.poll():
                    if socket is not self._zap:
                        self._overhear(socket, poller)
                    elif self._answer(self._zap.recv_multipart()):
                        return
                    while self._arrivals:
                        role, monitor = self._arrivals.pop()
                        self._monitors[monitor] = role
                        poller.register(monitor, zmq.POLLIN)
        except zmq.ContextTerminated:
            pass
        finally:
            for monitor in [*self._monitors, *(monitor for _, monitor in self._arrivals)]:
                monitor.close(0)
            # A socket's closing frees its address later.
            with contextlib.suppress(zmq.ZMQError):
                self._zap.unbind(_ZAP)
            self._zap.close(0)

    def _answer(self, frames: list[bytes]) -> bool:
        if len(frames) < 7:
            self._zap.send(b"")
            return frames == [_STOP]
        version, request, domain, address, _, _, key = frames[:7]
        client, refusal = self._judge(domain.decode(), z85.encode(key).decode() if len(key) == 32 else "")
        if refusal:
            who = address.decode(errors="replace")
            self._refuse("role" if client else "key", f"{who} was not let in to {domain.decode()}: {refusal}")
        verdict = (b"400", refusal.encode()) if refusal else (b"200", b"")
        self._zap.send_multipart([version, request, *verdict, client.name.encode() if client else b"", b""])
        return False

    def _judge(self, role: str, key: str) -> tuple[CurveClient | None, str]:
        client = self._clients.get(key)
        if client is None:
            return None, f"[bus.curve] clients names no key {key}"
        if role not in client.roles:
            return client, f"[bus.curve] clients does not name {role} among the roles of {client.name}"
        return client, ""

    def _overhear(self, monitor: Socket, poller: zmq.Poller) -> None:
        event = parse_monitor_message(monitor.recv_multipart())
        role = self._monitors[monitor]
        match event["event"], event["value"]:
            case zmq.EVENT_MONITOR_STOPPED, _:
                poller.unregister(monitor)
                del self._monitors[monitor]
                monitor.close(0)
            case zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL, zmq.PROTOCOL_ERROR_ZMTP_MECHANISM_MISMATCH:
                text = f"somebody without encryption was not let in to {role}: it needs keys, or a relay"
                self._refuse("not_encrypted", text)
            case zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL, zmq.PROTOCOL_ERROR_ZMTP_CRYPTOGRAPHIC:
                text = f"somebody with another service's key was not let in to {role}: ours is {self._keys.public}"
                self._refuse("service_key", text)
            case zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL, value:
                text = f"somebody who does not speak ZMTP's CURVE was not let in to {role} ({value:#x})"
                self._refuse("protocol", text)
            case _ if _port(event["endpoint"].decode()) == _port(self.endpoints[role]):
                self._refuse("handshake", f"somebody left before he was let in to {role}: without encryption, perhaps")
            case _:
                _log.debug("a connection to the plain endpoint of %s ended during its handshake", role)

    def _refuse(self, reason: str, text: str) -> None:
        self.refused[reason] += 1
        now = time.monotonic()
        if now - self._last_log >= _LOG_PERIOD_S:
            self._last_log = now
            _log.warning("%s", text)


def _port(endpoint: str) -> str:
    # Of the address alone: an event names the interface that somebody came in by, a listener may name all.
    return endpoint.rpartition(":")[2]
