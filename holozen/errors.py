"""What can go wrong on the bus. Each text is one line that says why."""

TIMEOUT = b"Timeout"  # what Zenoh itself replies for a service that says nothing


class BusError(Exception):
    """The bus could not do what was asked."""


class ServiceError(BusError):
    """A service answered with an error, or nobody answered. Handlers raise it to refuse a request, with `fields` of the
    reply that go with the reason.
    """

    def __init__(self, text: str, **fields: object) -> None:
        super().__init__(text)
        self.fields = fields


class NoReply(ServiceError):
    """Nobody answered in time."""
