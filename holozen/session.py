"""How a Zenoh session is opened and closed, and what Zenoh refuses told in one line."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial

import zenoh

from holozen import zenoh_words
from holozen.connection import Connection
from holozen.errors import BusError

TYPE_CHECKING = False  # importing `typing` takes 3 ms, which a verb that only looks at bytes would wait for
if TYPE_CHECKING:
    import threading
    from typing import Any


def open_session(connection: Connection, patience: float | None, stop: threading.Event) -> Any:
    """The open session. A peer opens at once and connects when it can; a client waits for its router.

    Ends the process, in peace, when `stop` is set meanwhile.
    """
    deadline = None if patience is None else time.monotonic() + patience
    told = connection.mode != "client" or patience is not None
    while True:
        try:
            return zenoh.open(configuration(connection))
        except zenoh.ZError as error:
            if connection.mode != "client" or (deadline and time.monotonic() > deadline):
                raise BusError(zenoh_words.opening(error, connection.mode, connection.where, patience)) from None
        if not told:
            print(f"waiting for a Zenoh router at {connection.where}", file=sys.stderr, flush=True)
            told = True
        if stop.wait(0.05):
            raise SystemExit(0)


def configuration(connection: Connection) -> zenoh.Config:
    """Zenoh's configuration for a connection. Raises BusError."""
    with one_line(f"Zenoh configuration {connection.config}"):
        config = zenoh.Config.from_file(connection.config) if connection.config else zenoh.Config()
    for path, value in connection.settings().items():
        with one_line(f"Zenoh setting {path}:{value}"):
            config.insert_json5(path, value)
    return config


def open_door(endpoint: str) -> Callable[[], None] | None:
    """A session that only listens at `endpoint`: how to close it, or None if another process was faster."""
    cfg = (("listen/endpoints", f'["{endpoint}"]'), ("listen/exit_on_failure", "true"))
    try:
        session = zenoh.open(configuration(Connection(connect=(), listen=(), cfg=cfg)))
    except zenoh.ZError:
        return None
    token = session.liveliness().declare_token(f"@holozen/{session.zid()}/door/door")  # no stranger, and no node
    return partial(close, session, token)


def close(session: Any, *_kept: Any) -> None:
    """Close a session, also one that is closed."""
    with contextlib.suppress(zenoh.ZError):
        session.close()


@contextlib.contextmanager
def one_line(what: str) -> Iterator[None]:
    """What Zenoh refuses within is a BusError that begins with `what`."""
    try:
        yield
    except zenoh.ZError as error:
        raise BusError(f"{what}: {zenoh_words.reason(error)}") from None
