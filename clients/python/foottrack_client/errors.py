"""What can go wrong for a client.

::

    ClientError
    ├── NotReady         no bus answered in time
    ├── KeyFileError     a key file is missing or unfit
    └── RequestFailed    the service refused a request; ``code`` says why (SPEC, section 7)
        └── NoAnswer     it did not answer at all
"""

from __future__ import annotations


class ClientError(Exception):
    """Base of all errors of this package."""


class NotReady(ClientError):
    """The bus was not there within the time given."""


class KeyFileError(ClientError):
    """A key file cannot be used."""


class RequestFailed(ClientError):
    """The service answered a request with an error."""

    def __init__(self, code: str, message: str) -> None:
        super().__init__(f"{message} ({code})")
        self.code = code
        self.message = message


class NoAnswer(RequestFailed):
    """Nobody answered. Whether the request was carried out is not known."""

    def __init__(self, cmd: str, endpoint: str, timeout_s: float) -> None:
        super().__init__("timeout", f"no answer to {cmd!r} from {endpoint} within {timeout_s:g} s: is it running?")
