"""What can go wrong on the bus.

::

    BusError
    ├── BindRefused      the endpoint is not on loopback
    ├── BindFailed       the endpoint is malformed or taken
    ├── KeyFileError     a key file is missing, unfit, or open to others
    ├── NotReady         nothing answered at the other end in time
    ├── NodeFailed       a node without which the service is of no use has ended
    └── ControlError     the service answered a request with an error; ``code`` says which
        └── ControlTimeout   the service did not answer at all
"""

from __future__ import annotations


class BusError(Exception):
    """Base of all errors of this package."""


class BindRefused(BusError):
    """Binding there would open the bus to the network."""


class BindFailed(BusError):
    """The endpoint cannot be bound."""


class KeyFileError(BusError):
    """A key file cannot be used or written."""


class NotReady(BusError):
    """The bus was not there within the time given."""


class NodeFailed(BusError):
    """A node without which the service is of no use has ended; the text says which and why."""


class ControlError(BusError):
    """A request failed. Handlers raise it too; ``code`` and ``message`` go to the client as they are."""

    def __init__(self, code: str, message: str) -> None:
        super().__init__(f"{message} ({code})")
        self.code = code
        self.message = message


class ControlTimeout(ControlError):
    """Nobody answered."""

    def __init__(self, message: str) -> None:
        super().__init__("timeout", message)
