"""What one peer may send to end or occupy others, each in a process of its own: some of it hangs
the sender too.

    python -m tests.faults.attacks KIND HOST:PORT [FOLDER] [SECONDS]

FOLDER holds the certificate of a member, by whom a router is attacked. Prints `sent` when all has
been sent.
"""

import json
import os
import socket
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from itertools import count
from typing import Any

import zenoh

PATTERN, PLAIN = f"{'/'.join(20 * ['**/a'])}/b", "/".join(40 * ["a"])
"""Two keys whose comparison takes Zenoh exponential time."""
DEEP = "/".join(8000 * ["*"])  # 16 KB
LINKS = 120
TOKENS, KEEP = 500, 1000  # a second, and at a time
KEPT: list[Any] = []


def session(place: str, folder: str) -> Any:
    """A plain session, which is a client of whoever listens at `place`."""
    config = zenoh.Config()
    values: dict[str, object] = {
        "mode": "client",
        "connect/endpoints": [f"{'tls' if folder else 'tcp'}/{place}"],
        "scouting/multicast/enabled": False,
        "connect/timeout_ms": 5000,
        "connect/exit_on_failure": True,
    }
    if folder:
        tls = "transport/link/tls"
        values |= {
            f"{tls}/root_ca_certificate": f"{folder}/ca.pem",
            f"{tls}/connect_certificate": f"{folder}/cert.pem",
            f"{tls}/connect_private_key": f"{folder}/key.pem",
            f"{tls}/enable_mtls": True,
        }
    for path, value in values.items():
        config.insert_json5(path, json.dumps(value))
    return zenoh.open(config)


def subscribe(place: str, folder: str, *keys: str) -> None:
    """Subscribe to each of the keys in a session of its own, since the second would hang the one of
    the first.
    """
    for key in keys:
        KEPT.append(one := session(place, folder))
        KEPT.append(one.declare_subscriber(key, zenoh.handlers.RingChannel(1)))


def patterns(place: str, folder: str) -> None:
    """Two keys that take exponential time to match, which holds up all declarations of others."""
    subscribe(place, folder, PATTERN, PLAIN)


def deep(place: str, folder: str) -> None:
    """A key with thousands of chunks; the stack overflows when it is forgotten, too."""
    subscribe(place, folder, DEEP)
    time.sleep(0.5)
    KEPT[-2].close()


def idle(place: str, _folder: str) -> None:
    """Links on which nothing is ever sent; each is opened again as soon as it is closed."""
    host, _, port = place.rpartition(":")

    def hold() -> None:
        while True:
            with suppress(OSError), socket.create_connection((host, int(port)), 5) as link:
                link.settimeout(None)
                link.recv(1)

    for _ in range(LINKS):
        threading.Thread(target=hold, daemon=True).start()
    time.sleep(0.5)


def tokens(place: str, folder: str) -> None:
    """Tokens that come and go."""
    one = session(place, folder)

    def flood() -> None:
        for number in count():
            with suppress(zenoh.ZError):
                KEPT.append(
                    one.liveliness().declare_token(f"@holozen/{one.zid()}/flood/sub/x/y/z/{number}")
                )
            if len(KEPT) > KEEP:
                KEPT.pop(0).undeclare()
            time.sleep(1 / TOKENS)

    threading.Thread(target=flood, daemon=True).start()
    time.sleep(0.5)


KINDS: dict[str, Callable[[str, str], None]] = {
    one.__name__: one for one in (patterns, deep, idle, tokens)
}


def words(kind: str, place: str, folder: str = "") -> list[str]:
    """The command line of an attack."""
    return [sys.executable, "-m", "tests.faults.attacks", kind, place, folder]


def main(kind: str, place: str, folder: str = "", seconds: str = "60") -> None:
    threading.Timer(float(seconds), os._exit, (0,)).start()
    attack = threading.Thread(target=KINDS[kind], args=(place, folder), daemon=True)
    attack.start()
    attack.join(5)  # its own session may hang
    print("sent", flush=True)
    threading.Event().wait()


if __name__ == "__main__":
    main(*sys.argv[1:])
