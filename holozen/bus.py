"""The public face of the bus: what a program on the wire imports."""

from holozen.transport.bus import Bus
from holozen.transport.connection import Connection
from holozen.transport.errors import BusError, NoReply, ServiceError
from holozen.transport.pubsub import Latest, Publisher, Received, Subscription

__all__ = [
    "Bus",
    "BusError",
    "Connection",
    "Latest",
    "NoReply",
    "Publisher",
    "Received",
    "ServiceError",
    "Subscription",
]
