"""The door: the endpoint where the processes of one machine meet, kept open when the process that held it is gone.

Zenoh can retry a taken port by itself, but such a session takes 10 s to close; so this asks the kernel first.
"""

import socket
import threading
from collections.abc import Callable

LOOK = 0.2  # s between two looks at the port


def keep(
    endpoint: str, closing: threading.Event, open_door: Callable[[str], Callable[[], None] | None]
) -> threading.Thread:
    """From a thread, open `endpoint` whenever nobody holds it, until `closing` is set."""
    thread = threading.Thread(target=_keep, args=(endpoint, closing, open_door), daemon=True)
    thread.start()
    return thread


def is_free(endpoint: str) -> bool:
    """Whether a TCP endpoint such as tcp/127.0.0.1:7447 can be listened on. Connects to nobody."""
    host, _, port = endpoint.removeprefix("tcp/").rpartition(":")
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, int(port)))
        except (OSError, ValueError, OverflowError):
            return False
    return True


def _keep(endpoint: str, closing: threading.Event, open_door: Callable[[str], Callable[[], None] | None]) -> None:
    while not closing.wait(LOOK):
        close = open_door(endpoint) if is_free(endpoint) else None
        if close:
            closing.wait()
            close()
