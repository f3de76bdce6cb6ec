"""Outputs that get in each other's way."""

from __future__ import annotations

import ipaddress
from itertools import combinations

from foottrack_service.config import Settings


def conflicts(settings: Settings) -> list[str]:
    """One sentence for each pair that feeds the same application."""
    enabled = settings.bridges.enabled
    found = [
        f"{one} and {other} both send to {a.host}:{a.port}: that application gets two streams"
        for (one, a), (other, b) in combinations(enabled.items(), 2)
        if (_host(a.host), a.port) == (_host(b.host), b.port)
    ]
    if {"vrchat", "vmt"} <= enabled.keys():
        found.append("vrchat and vmt are both on: VRChat in SteamVR gets every foot twice. Keep one of them")
    vmc, own = settings.bridges.vmc, settings.headset.vmc
    listening = settings.headset.source == "vmc" and _host(vmc.host) == "loopback"
    if vmc.enabled and listening and vmc.port == own.port:
        found.append(f"vmc sends to port {own.port}, where this service itself waits for a headset's poses")
    return found


def _host(host: str) -> str:
    if host == "localhost":
        return "loopback"
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return host.lower()
    return "loopback" if address.is_loopback else str(address)
