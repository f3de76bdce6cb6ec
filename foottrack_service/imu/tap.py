"""An IMU's own bytes onto the bus, while somebody asks for them."""

from __future__ import annotations

from foottrack_protocol.messages import RawImu, Side
from foottrack_service.bus.publisher import Publisher


class Tap:
    """One foot's bytes, as they came."""

    def __init__(self, publisher: Publisher, user: str, side: Side, format_: str) -> None:
        self._publisher = publisher
        self._user = user
        self._stream = f"raw/imu/{side}"
        self._format = format_
        self._introduced: set[str] = set()

    def publish(
        self,
        data: bytes,
        t_arr: int,
        source: str,
        connection: int = 0,
        tracker: str | None = None,
        introduction: bytes | None = None,
    ) -> None:
        """What one read or one datagram gave, at ``t_arr`` (bus clock, ns).

        ``introduction`` came before, and goes first when somebody has just begun to ask: without it what follows from
        this source would mean nothing.
        """
        if not self._publisher.wanted(self._user, self._stream):
            self._introduced.clear()
            return
        pieces = [data]
        if source not in self._introduced:
            self._introduced.add(source)
            if introduction is not None and introduction != data:
                pieces.insert(0, introduction)
        for piece in pieces:
            body = RawImu(bytes=piece, format=self._format, source=source, connection=connection, tracker=tracker)
            self._publisher.publish(self._user, self._stream, t_arr, body)
