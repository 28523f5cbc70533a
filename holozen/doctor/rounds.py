"""All checks in their order. Robots are listened to while the rest of what runs is asked."""

import time
from collections.abc import Iterator

from holozen.about import version
from holozen.connection import LOOPBACK, Connection
from holozen.doctor import machine, places, software, terminal
from holozen.doctor.finding import ERROR, OK, Finding
from holozen.errors import BusError

LISTEN = 1.0  # s
FIND = 0.6  # s for others to be found
OPEN = 0.8  # s for a client to reach its router


def look(connection: Connection) -> Iterator[Finding]:
    """The findings about this machine, and about what runs at `connection`."""
    yield software.python()
    yield from software.wheels()
    yield machine.disk()
    yield from machine.docker()
    yield from terminal.look()
    try:
        yield from live(connection)
    except BusError as error:
        yield from places.look(connection, connected=False)
        yield Finding("zenoh", ERROR, str(error), "look at --mode, --connect and --config")
    except ModuleNotFoundError as error:
        yield from places.look(connection, connected=False)
        yield Finding("zenoh", ERROR, f"what runs cannot be looked at without {error.name}", "pip install holozen")


def live(connection: Connection) -> Iterator[Finding]:
    """The findings about what runs. Raises BusError."""
    from holozen.bus import Bus
    from holozen.doctor import peers
    from holozen.doctor.traffic import Robots

    with Bus("doctor", quiet(connection), patience=OPEN) as bus:
        endpoints = bus.graph().settled(bus.connected, patience=FIND)
        began = time.monotonic()
        robots = Robots(bus, endpoints)
        yield from places.look(connection, bus.connected())
        known = peers.ask(bus) if bus.connected() else {}
        yield from peers.versions(endpoints, known, version("holozen"))
        yield from peers.clocks(known.values())
        yield from peers.twins(endpoints, known)
        if robots.count:
            time.sleep(max(0.0, began + LISTEN - time.monotonic()))
            yield from robots.look(time.monotonic() - began)
        else:
            yield Finding("odom", OK, "no robot is there; `holozen up` starts one")


def quiet(connection: Connection) -> Connection:
    """A connection that holds no port that another process may want."""
    return connection.replace(listen=(LOOPBACK,)) if connection.mode == "peer" and not connection.config else connection
