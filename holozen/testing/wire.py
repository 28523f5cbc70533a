"""A network for the processes of one test."""

import contextlib
import random
import socket
import subprocess
from collections import deque
from typing import TYPE_CHECKING, Any, Self

from holozen.system import IS_LINUX
from holozen.testing.process import START, Process, run
from holozen.testing.terminal import Terminal
from holozen.transport.connection import Connection

if TYPE_CHECKING:
    from holozen.bus import Bus


STAMPED = ("timestamping/enabled", "true")


class Wire:
    """A loopback port on which only the processes and buses of one test meet.

    `connection` is for `holozen.bus.Bus`, `flags` for any holozen verb, `endpoint` for any Zenoh
    tool; `processes` and `terminals` are those that were started here. All samples have Zenoh's
    timestamp, of when they were sent.
    """

    def __init__(self) -> None:
        self.port = free_port()
        self.endpoint = f"tcp/127.0.0.1:{self.port}"
        self.connection = Connection(
            connect=(self.endpoint,), listen=(self.endpoint,), cfg=(STAMPED,)
        )
        self.flags = self.connection.arguments()
        self.processes: list[Process] = []
        self.terminals: list[Terminal] = []
        self._ends = contextlib.ExitStack()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    def start(self, verb: str, *words: str, **options: Any) -> Process:
        """Start `holozen VERB WORDS...` here. Options are those of Process."""
        process = self._ends.enter_context(Process(command(verb, *words, *self.flags), **options))
        self.processes.append(process)
        # pytest shows it on failure
        self._ends.callback(lambda: print(f"--- {process}\n{process.out}{process.err}"))
        return process

    def terminal(self, verb: str, *words: str, **options: Any) -> Terminal:
        """Start `holozen VERB WORDS...` here, in a pseudo-terminal. Options are those of
        Terminal.
        """
        terminal = self._ends.enter_context(Terminal(command(verb, *words, *self.flags), **options))
        self.terminals.append(terminal)
        return terminal

    def run(
        self, verb: str, *words: str, given: str = "", within: float = 30.0
    ) -> subprocess.CompletedProcess[str]:
        """Run `holozen VERB WORDS...` here to its end, with `given` as its standard input."""
        all_words = command(verb, *words, *self.flags)
        if given:
            return subprocess.run(
                all_words, input=given, capture_output=True, text=True, timeout=within
            )
        return run(all_words, within)

    def bus(self, node: str = "test", **options: Any) -> "Bus":
        """A bus here, closed with the test. Options are those of holozen.bus.Bus."""
        from holozen.bus import Bus

        return self._ends.enter_context(Bus(node, self.connection, **options))

    def close(self) -> None:
        """End everything started here, in reverse order."""
        self._ends.close()


def command(verb: str, *words: str) -> list[str]:
    """The command line that runs `holozen VERB WORDS...` with this Python."""
    return [*START, verb, *words]


KEPT = 200  # marks of ports
_marks = deque[socket.socket]()


def free_port() -> int:
    """A free TCP port on loopback, below the range of ephemeral ports.

    A Unix socket of that number marks it, so that no other test process is given it too before it
    is listened on.
    """
    while True:
        port = random.SystemRandom().randint(10_000, 32_000)  # Hypothesis seeds the other generator
        mark = socket.socket(socket.AF_UNIX)
        with socket.socket() as probe, contextlib.suppress(OSError):
            if IS_LINUX:
                mark.bind(f"\0holozen-test-{port}")  # abstract: there is no file of it
            probe.bind(("127.0.0.1", port))
            _marks.append(mark)
            if len(_marks) > KEPT:
                _marks.popleft().close()
            return port
        mark.close()
