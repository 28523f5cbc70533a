"""The other process of a benchmark, and where to meet it: loopback, on a port of its own."""

import multiprocessing
import os
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from holozen.transport.connection import Connection

PATIENCE = 60.0  # s for the other process to come up


def meeting_point() -> str:
    """An endpoint that no running robot uses."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def host(endpoint: str) -> Connection:
    """The connection of a peer that listens at `endpoint`."""
    return Connection(connect=(), listen=(endpoint,))


def guest(endpoint: str) -> Connection:
    """The connection of a peer that connects to `endpoint`."""
    return Connection(connect=(endpoint,), listen=())


@contextmanager
def beside(job: Callable[..., None], *args: Any) -> Iterator[None]:
    """Within this block another process runs `job(*args)`, which never ends by itself."""
    process = multiprocessing.get_context("spawn").Process(target=_run, args=(job, *args), daemon=True)
    process.start()
    try:
        yield
    finally:
        process.terminate()
        process.join()


def until(ready: Callable[[], object], every: float = 0.05) -> None:
    """Ask again and again until `ready()` is true; AssertionError if the other process does not come up."""
    deadline = time.monotonic() + PATIENCE
    while not ready():
        assert time.monotonic() < deadline, f"the other process did not come up within {PATIENCE:g} s"
        time.sleep(every)


def _run(job: Callable[..., None], *args: Any) -> None:
    threading.Thread(target=_end_with_parent, daemon=True).start()
    job(*args)


def _end_with_parent() -> None:
    if parent := multiprocessing.parent_process():
        parent.join()
    os._exit(0)
