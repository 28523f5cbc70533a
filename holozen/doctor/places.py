"""The endpoints where one meets: who holds them, and whether they speak Zenoh."""

import json
from collections.abc import Iterator

from holozen.connection import Connection
from holozen.doctor import sockets
from holozen.doctor.finding import ERROR, OK, Finding

LOOPBACK = ("127.0.0.1", "localhost", "::1", "0.0.0.0", "::")


def endpoints(connection: Connection) -> list[str]:
    """Those that are connected to; empty where only a configuration file says them."""
    found = json.loads(connection.settings().get("connect/endpoints", "[]"))
    return [endpoint for endpoint in found if isinstance(endpoint, str)] if isinstance(found, list) else []


def look(connection: Connection, connected: bool) -> Iterator[Finding]:
    """The findings about each endpoint; `connected` says whether a session has found anybody."""
    reasons = sockets.reached(endpoints(connection))
    for endpoint in endpoints(connection):
        if endpoint not in reasons:
            yield Finding("port", OK, f"{endpoint} is not TCP, so it is not looked at")
            continue
        yield _found(endpoint, reasons[endpoint], connected, asked_for=connection.connect is not None)


def _found(endpoint: str, reason: str, connected: bool, asked_for: bool) -> Finding:
    place = sockets.address(endpoint)
    here = sockets.holders(place[1]) if place and place[0] in LOOPBACK else []
    held = " and ".join(map(str, here)) or "somebody on another machine, or in a container"
    if reason and not here and not asked_for:
        return Finding("port", OK, f"{endpoint} is free: nothing runs here yet", "")
    if reason and not here:
        port = place[1] if place else 7447
        mend = f"start who should be there, such as: holozen router --listen tcp/0.0.0.0:{port}"
        return Finding("port", ERROR, f"nobody is reached at {endpoint}: {reason}", mend)
    if connected and not reason:
        return Finding("port", OK, f"{endpoint} is held by {held}, and speaks Zenoh")
    mend = here[0].mend if here else "look who that is; --connect says where to meet instead"
    return Finding("port", ERROR, f"{endpoint} is held by {held}, who does not answer as Zenoh does", mend)
