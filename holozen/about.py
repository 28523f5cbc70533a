"""What a lasting node tells of itself when asked on `@holozen/<session>/about`, for `holozen doctor`."""

import json
import os
import threading
import time

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

EVERYBODY = "@holozen/*/about"


def key(session: str) -> str:
    """Where the node of a session answers."""
    return EVERYBODY.replace("*", session)


def version(package: str) -> str:
    """The installed version of a package; empty if there is none."""
    from importlib import metadata

    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""


class About:
    """Answers from a thread of its own, until the bus is closed."""

    def __init__(self, session: "Any", channel: "Any", node: str) -> None:
        self._key = key(str(session.zid()))
        self._queryable = session.declare_queryable(self._key, channel)
        self._queries = self._queryable.handler
        self._fixed = {"node": node, "host": os.uname().nodename, "pid": os.getpid()}
        self.thread = threading.Thread(target=self._serve, daemon=True)
        self.thread.start()

    def _serve(self) -> None:
        while True:
            try:
                query = self._queries.recv()
            except Exception:  # zenoh's own error type, which only bus.py may name: the session is closed
                return
            with query:
                # Looked up when first asked: it takes longer than all else of a start.
                if "version" not in self._fixed:
                    self._fixed |= {"version": version("holozen"), "zenoh": version("eclipse-zenoh")}
                told = self._fixed | {"time": time.time()}
                query.reply(self._key, json.dumps(told), encoding="application/json")
