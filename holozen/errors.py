"""What can go wrong on the bus. Each text is one line that says why."""


class BusError(Exception):
    """The bus could not do what was asked."""


class ServiceError(BusError):
    """A service answered with an error, or nobody answered. Handlers raise it to refuse a request."""


class NoReply(ServiceError):
    """Nobody answered in time."""
