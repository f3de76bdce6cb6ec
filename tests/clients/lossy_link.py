"""A cable between two network namespaces that delays each packet and loses some (Linux, root).

Run as a program: ``lossy_link.py NAMESPACE NAMESPACE DELAY_S LOSS``. It makes a TUN device "link0" in either, carries
packets between them, and says "up" when they may be configured. Unlike ``tc netem`` it needs no module of the kernel.
"""

from __future__ import annotations

import contextlib
import ctypes
import fcntl
import heapq
import os
import random
import select
import struct
import sys
import time

_TUNSETIFF = 0x400454CA
_IFF_TUN, _IFF_NO_PI = 0x0001, 0x1000
_CLONE_NEWNET = 0x40000000
_MTU_AND_MORE = 65536


def _open(namespace: str) -> int:
    libc = ctypes.CDLL(None, use_errno=True)
    own = os.open("/proc/self/ns/net", os.O_RDONLY)
    there = os.open(f"/run/netns/{namespace}", os.O_RDONLY)
    if libc.setns(there, _CLONE_NEWNET):
        raise OSError(ctypes.get_errno(), f"cannot enter {namespace}")
    tun = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(tun, _TUNSETIFF, struct.pack("16sH22x", b"link0", _IFF_TUN | _IFF_NO_PI))
    libc.setns(own, _CLONE_NEWNET)
    return tun


def carry(ends: tuple[int, int], delay_s: float, loss: float) -> None:
    """Until the process is ended."""
    chance = random.Random(1)
    under_way: list[tuple[float, int, int, bytes]] = []
    packets = 0
    while True:
        wait = max(0.0, under_way[0][0] - time.monotonic()) if under_way else None
        readable, _, _ = select.select(ends, [], [], wait)
        for end in readable:
            packet = os.read(end, _MTU_AND_MORE)
            if chance.random() >= loss:
                packets += 1
                other = ends[1] if end == ends[0] else ends[0]
                heapq.heappush(under_way, (time.monotonic() + delay_s, packets, other, packet))
        while under_way and under_way[0][0] <= time.monotonic():
            _, _, target, packet = heapq.heappop(under_way)
            # An end that is down takes nothing, and a cable does not mind.
            with contextlib.suppress(OSError):
                os.write(target, packet)


if __name__ == "__main__":
    devices = (_open(sys.argv[1]), _open(sys.argv[2]))
    print("up", flush=True)
    carry(devices, float(sys.argv[3]), float(sys.argv[4]))
