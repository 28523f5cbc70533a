"""The server of Forked: it has imported what the verbs need, and a process that is forked from it
starts at once.

`python -m holozen.testing.fork_server FD` gets its requests from the socket FD. It ends when the
other end is closed, and all that it has forked ends with it.
"""

import fcntl
import gc
import importlib
import io
import json
import os
import runpy
import selectors
import signal
import socket
import sys
import termios
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from holozen import cli, engines
from holozen.console import Failure
from holozen.process import dies_with_parent

LIBRARIES = ("zenoh", "numpy", "numpy.ma", "xacro", "prompt_toolkit", "holozen.bus")
SIM = (
    "cameras",
    "entities",
    "loop",
    "spawn",
    "io.entity_services",
    "io.simulation_services",
    "physics.world",
)
"""What verbs import once they run, and the modules of the sim that it does."""
MAX_REQUEST = 200_000  # bytes


def _serve(requests: socket.socket) -> tuple[dict[str, Any], list[int]] | None:
    """Fork for each request. Returns None once there will be no more, and in a new process its
    request and files.
    """
    with selectors.DefaultSelector() as selector:
        selector.register(requests, selectors.EVENT_READ)
        while True:
            for key, _ in selector.select():
                if key.data:
                    _tell_end(*key.data)
                    selector.unregister(key.fd)
                    os.close(key.fd)
                    continue
                request, files, _, _ = socket.recv_fds(requests, MAX_REQUEST, 4)
                if not request:
                    return None
                *standard, status = files
                if (pid := os.fork()) == 0:
                    # each keeps the socket of a test open
                    for other in list(selector.get_map().values()):
                        if other.data:
                            os.close(other.data[1])
                            os.close(other.fd)
                    os.close(status)
                    return json.loads(request), standard
                for descriptor in standard:
                    os.close(descriptor)
                process = os.pidfd_open(pid)
                with socket.socket(fileno=os.dup(status)) as end, suppress(OSError):
                    socket.send_fds(end, [b"%d" % pid], [process])
                selector.register(process, selectors.EVENT_READ, (pid, status))


def _tell_end(pid: int, status: int) -> None:
    """Tell the test, which may no longer wait for it, the exit code of a process that has ended."""
    code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    with suppress(OSError):
        os.write(status, b"%d" % code)
    os.close(status)


def _become(request: dict[str, Any], files: Sequence[int]) -> None:
    """Make this forked process what a new Python would be for the words of a request."""
    os.setsid()
    for number, descriptor in enumerate(files):
        os.dup2(descriptor, number)
        os.close(descriptor)
    if request["terminal"]:
        fcntl.ioctl(0, termios.TIOCSCTTY, 0)
    os.chdir(request["folder"])
    os.environ.clear()
    os.environ.update(request["env"])
    for number, (name, mode) in enumerate((("stdin", "rb"), ("stdout", "wb"), ("stderr", "wb"))):
        old = getattr(sys, name)
        unbuffered = old.write_through  # by PYTHONUNBUFFERED
        file: Any = open(number, mode, 0 if unbuffered and number else -1, closefd=False)  # noqa: SIM115
        getattr(file, "raw", file).name = old.name
        lines = not unbuffered and (number == 2 or file.isatty())
        stream = io.TextIOWrapper(
            file, old.encoding, old.errors, line_buffering=lines, write_through=unbuffered
        )
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)
    sys.argv[1:] = request["words"]


def main() -> None:
    # as in holozen/__main__.py, so that a Ctrl-C ends a process that has not begun yet quietly
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    for verb in cli.VERBS:
        with suppress(Failure):  # an extension is left out
            cli.command(verb)
    for library in (*LIBRARIES, engines.choose().engine):
        importlib.import_module(library)
    services = cli.command("teleop").__package__.rpartition(".")[0]
    for module in SIM:
        importlib.import_module(f"{services}.sim.{module}")
    gc.collect()
    # else a collection in a forked process would write to, and so copy, all of this memory
    gc.freeze()
    dies = dies_with_parent()
    with socket.socket(fileno=int(sys.argv[1])) as requests:
        forked = _serve(requests)
    if forked:
        dies()
        _become(*forked)
        runpy.run_module("holozen", run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
