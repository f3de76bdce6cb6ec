"""Somebody on a bus at the default ports of his host: sends one stream, receives another, and tells what came.

Run as a program: ``network_party.py SENT RECEIVED COUNT``. Says "ready" when nothing can be lost any more, waits for a
line, sends, and prints one JSON object when ``COUNT`` messages came.
"""

from __future__ import annotations

import asyncio
import json
import sys

from foottrack_protocol.messages import Truth
from foottrack_service.bus import Bus
from foottrack_service.bus.timesync import SyncedClock, synchronise
from foottrack_service.config import BusSettings

BODY = Truth(p=(0.1, 0.2, 0.3), q=(0.0, 0.0, 0.0, 1.0))


async def main(sent: str, expected: str, count: int) -> None:
    """Send and receive."""
    clock = SyncedClock()
    with Bus.connect(BusSettings(), clock=clock) as bus:
        keeping = asyncio.ensure_future(synchronise(clock, bus.control(), period_s=0.2))
        publisher, subscriber = bus.publisher("party"), bus.subscriber([f"user/{expected}"])
        await publisher.ready(20.0)
        await subscriber.ready(20.0)
        while not clock.fresh():  # noqa: ASYNC110 - nothing says when
            await asyncio.sleep(0.01)
        print("ready", flush=True)
        await asyncio.to_thread(sys.stdin.readline)
        for _ in range(count):
            publisher.publish("user", sent, clock(), BODY)
        received = []
        async for batch in subscriber.batches():
            received += batch
            if len(received) >= count:
                break
        keeping.cancel()
    session = {"offset": clock.offset, "uncertainty": clock.uncertainty}
    delays = [one.arrival - one.message.t_pub for one in received]
    valid = sum(one.message.valid for one in received)
    seq = [one.message.seq for one in received]
    print(json.dumps({**session, "delays": delays, "valid": valid, "seq": seq}), flush=True)
    # The other one still receives: what was sent leaves before the end, and he says when he is done.
    await asyncio.to_thread(sys.stdin.readline)


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], sys.argv[2], int(sys.argv[3])))
