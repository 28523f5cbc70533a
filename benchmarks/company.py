"""The other processes of a benchmark, and where to meet them: on loopback, at a port of its own."""

import compileall
import multiprocessing
import os
import shutil
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from holozen.bus import Bus
from holozen.messages import Odometry
from holozen.testing.wire import free_port
from holozen.transport.connection import Connection

PATIENCE = 60.0  # s for the other process to come up
ROOT = Path(__file__).resolve().parents[1]
WITHOUT_CARD = ("--no-sandbox", "--enable-unsafe-swiftshader")
HOLOZEN = str(Path(sys.executable).with_name("holozen"))
PROCESSES = multiprocessing.get_context("forkserver")
"""They are forked from one that has loaded the benchmark and has no session."""


def chromium(playwright: Any) -> Any:
    """Debian's Chromium, which draws without a graphics card."""
    return playwright.chromium.launch(executable_path=shutil.which("chromium"), args=WITHOUT_CARD)


def page_address(printed: str) -> str:
    """The address of its page, which a view has printed."""
    return next(word for word in printed.split() if word.startswith("http://"))


def meeting_point() -> str:
    """An endpoint that no running robot uses."""
    return f"tcp/127.0.0.1:{free_port()}"


def host(endpoint: str) -> Connection:
    """The connection of a peer that listens at `endpoint`, and is in the group of its port."""
    return Connection(connect=(endpoint,), listen=(endpoint,))


def guest(endpoint: str) -> Connection:
    """The connection of a peer that connects to `endpoint`."""
    return Connection(connect=(endpoint,), listen=())


def client(endpoint: str) -> Connection:
    """The connection of a client of the router at `endpoint`."""
    return Connection("client", connect=(endpoint,))


@contextmanager
def beside(job: Callable[..., None], *args: Any) -> Iterator[None]:
    """Within this block another process runs `job(*args)`. If that fails, the benchmark ends."""
    benchmark = Path(sys.modules[job.__module__].__file__ or "").stem
    PROCESSES.set_forkserver_preload([f"benchmarks.{benchmark}"])
    process = PROCESSES.Process(target=_run, args=(job, *args), daemon=True)
    process.start()
    try:
        yield
    finally:
        process.terminate()
        process.join()


def until(ready: Callable[[], object], every: float = 0.05) -> None:
    """Wait until `ready()` is true, polled `every` seconds. AssertionError if the other process
    does not come up.
    """
    deadline = time.monotonic() + PATIENCE
    while not ready():
        assert time.monotonic() < deadline, (
            f"the other process did not come up within {PATIENCE:g} s"
        )
        time.sleep(every)


def wait_for_odom(endpoint: str) -> None:
    """Wait until a robot publishes odom at `endpoint`."""
    with Bus("waits", guest(endpoint)) as bus:
        assert bus.latest("odom", Odometry).wait(0, timeout=PATIENCE), (
            f"the robot did not come up within {PATIENCE:g} s"
        )


def processor_time(pid: int) -> float:
    """The processor time (s) of a process so far, in all its threads: proc(5), fields 14 and 15 of
    stat.
    """
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def compile_tree() -> None:
    """Make the byte code, which an installed package always has; without it half of a start is the
    compiler's.
    """
    for folder in ("holozen", "services", "extensions"):
        compileall.compile_dir(ROOT / folder, quiet=2)


def _run(job: Callable[..., None], *args: Any) -> None:
    parent = multiprocessing.parent_process()
    assert parent and parent.pid
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    try:
        job(*args)
    except BaseException:  # the benchmark would wait for its result
        os.kill(parent.pid, signal.SIGINT)
        raise


def _end_with(parent: Any) -> None:
    parent.join()
    os._exit(0)
