"""The errors of the bus. Each text is one line with the reason."""

from holozen.console import Failure

TIMEOUT = b"Timeout"  # Zenoh's own reply for a service that does not reply
LONGEST_KEY = 1000  # characters; Zenoh aborts the processes that it tells a far longer one


class BusError(Failure):
    """The bus could not do what was asked."""


class ServiceError(BusError):
    """A service replied with an error, or did not reply. Handlers raise it to refuse a request,
    with more `fields` of the error reply.
    """

    def __init__(self, text: str, **fields: object) -> None:
        super().__init__(text)
        self.fields = fields


class NoReply(ServiceError):
    """There was no reply in time."""


class Elsewhere(BusError):
    """Another server of the same key replies to this request."""
