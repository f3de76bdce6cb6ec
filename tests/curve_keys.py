"""A service with CURVE and clients with keys, on free ports of loopback."""

from __future__ import annotations

from pathlib import Path

from foottrack_service.bus import Broker
from foottrack_service.bus.security import new_keys
from foottrack_service.config import BusSettings
from foottrack_service.curve_settings import CurveClient, CurveSettings, Role

EPHEMERAL = BusSettings.beginning_at("0")


class Keyring:
    """Keys in a folder: the service's, and one for each client of the allow-list."""

    def __init__(self, folder: Path, clients: dict[str, tuple[Role, ...]]) -> None:
        self.folder = folder
        self.service = new_keys(folder, "service").public
        entries = [
            CurveClient(name=name, key=new_keys(folder, name).public, roles=roles) for name, roles in clients.items()
        ]
        curve = CurveSettings(secret=folder / "service.key_secret", listen="tcp://127.0.0.1:0", clients=tuple(entries))
        self.settings = EPHEMERAL.model_copy(update={"curve": curve})

    def client(self, broker: Broker, name: str | None, service: str | None = None) -> BusSettings:
        """How a client of that name connects to the encrypted endpoints; None: without encryption."""
        assert broker.doorkeeper is not None
        ends = broker.doorkeeper.endpoints
        curve = self.key_settings(name, service)
        return BusSettings(ingress=ends["publish"], egress=ends["subscribe"], control=ends["control"], curve=curve)

    def key_settings(self, name: str | None, service: str | None = None) -> CurveSettings:
        """Of a client of that name."""
        if name is None:
            return CurveSettings()
        return CurveSettings(secret=self.folder / f"{name}.key_secret", service=service or self.service)
