"""The bus: broker, publisher and subscriber, control, clock and time sync, and what the service says of itself."""

from foottrack_service.bus.broker import Broker
from foottrack_service.bus.clock import BusClock, ManualClock, now
from foottrack_service.bus.connection import Bus
from foottrack_service.bus.control import ControlServer
from foottrack_service.bus.control_client import ControlClient
from foottrack_service.bus.errors import (
    BindFailed,
    BindRefused,
    BusError,
    ControlError,
    ControlTimeout,
    KeyFileError,
    NotReady,
)
from foottrack_service.bus.publisher import Publisher
from foottrack_service.bus.subscriber import Received, Subscriber

__all__ = [
    "BindFailed",
    "BindRefused",
    "Broker",
    "Bus",
    "BusClock",
    "BusError",
    "ControlClient",
    "ControlError",
    "ControlServer",
    "ControlTimeout",
    "KeyFileError",
    "ManualClock",
    "NotReady",
    "Publisher",
    "Received",
    "Subscriber",
    "now",
]
