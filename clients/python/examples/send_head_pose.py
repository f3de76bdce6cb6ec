"""Send a head pose at 90 Hz, as a headset would: a head that sways at 1.7 m."""

import asyncio
import math

from foottrack_client import AsyncClient
from foottrack_protocol.messages import HeadPose


async def main() -> None:
    with AsyncClient() as client:
        head = await client.publisher("my-headset")
        while True:
            sway_m = 0.05 * math.sin(client.clock() * 1e-9)
            head.publish("head/pose", HeadPose(p=(sway_m, 1.7, 0.0), q=(0.0, 0.0, 0.0, 1.0), tracked=True))
            await asyncio.sleep(1 / 90)


asyncio.run(main())
