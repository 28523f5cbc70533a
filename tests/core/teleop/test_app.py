"""The application on a real bus, driven by the bytes of real keys, with a terminal that may take
nothing.
"""

import itertools
import os
import re
import select
import signal
import threading
from collections.abc import Callable, Iterator

import pytest

from holozen.bus import Bus
from holozen.messages import Twist
from holozen.testing import Wire, wait_for
from services.teleop.app import ENDS, TeleopApp
from services.teleop.control.layouts import TTK
from services.teleop.control.twist_mapper import Settings, TwistMapper
from services.teleop.input.terminal import Terminal
from services.teleop.session import Session
from services.teleop.telemetry import Telemetry

CTRL_C, PRESS_I, RELEASE_I = b"\x03", b"\x1b[105u", b"\x1b[105;1:3u"
REPLIES = {b"\x1b[?u": b"\x1b[?0u", b"\x1b[c": b"\x1b[?62c"}
"""What kitty replies to the teleop's queries."""
HANDLED = (*ENDS, signal.SIGTSTP, signal.SIGCONT, signal.SIGWINCH)


class Seat:
    """A pseudo-terminal in place of ours, and what was commanded."""

    def __init__(self, bus: Bus, master: int, slave: int) -> None:
        self.master, self.slave = master, slave
        self._read, self._answered = b"", 0
        self._commands = bus.subscribe("Fred/cmd_vel", Twist, depth=1000)
        self.commands: list[float] = []  # forward, m/s

    def wrote(self, text: bytes) -> bool:
        """Whether the teleop has written this by now. Reads no further than that."""
        while select.select([self.master], [], [], 0)[0]:
            self._read += os.read(self.master, 65536)
        return text in self._read

    def answers(self, text: bytes) -> bool:
        """Reply to each query that came since the last call; whether this text has come by now."""
        has_come = self.wrote(text)
        for query in re.compile(rb"\x1b\[(?:\?u|c)").finditer(self._read, self._answered):
            self._answered = query.end()
            self.type(REPLIES[query[0]])
        return has_come

    def type(self, data: bytes) -> None:
        os.write(self.master, data)

    def commanded(self) -> list[float]:
        """All commands so far."""
        while received := self._commands.try_recv():
            assert received.message
            self.commands.append(received.message.linear.x)
        return self.commands


@pytest.fixture
def seat(wire: Wire) -> Iterator[Seat]:
    handlers = {number: signal.getsignal(number) for number in HANDLED}
    master, slave = os.openpty()
    yield Seat(wire.bus("robot"), master, slave)
    os.close(slave)
    os.close(master)
    for number, handler in handlers.items():
        signal.signal(number, handler)


def drive(wire: Wire, seat: Seat, mode: str, person: Callable[[], object]) -> None:
    """Run the application while `person` types, until it ends."""
    failed: list[BaseException] = []

    def types() -> None:
        try:
            person()
        except BaseException as error:
            failed.append(error)
        finally:
            seat.type(CTRL_C)

    with wire.bus("teleop") as bus, Terminal(fileno=seat.slave) as terminal:
        session = Session(bus, ["Fred"], TwistMapper(Settings(mode=mode), TTK), None)
        telemetry = Telemetry(session)
        thread = threading.Thread(target=types, daemon=True)
        thread.start()
        try:
            TeleopApp(session, terminal, telemetry, None, False, False, True).run()
        finally:
            session.halt()
        thread.join(10)
    if failed:
        raise failed[0]


def test_a_key_drives_from_its_press_to_its_release(wire: Wire, seat: Seat) -> None:
    def person() -> None:
        wait_for(lambda: seat.answers(b"\x1b[>15u"), what="the releases to be asked for")

        def moves() -> bool:
            # one that a busy machine reads late is old, and moves nothing
            seat.answers(b"")
            seat.type(RELEASE_I + PRESS_I)
            return 0.5 in seat.commanded()

        wait_for(moves, what="a command")
        seat.type(RELEASE_I)
        wait_for(lambda: seat.commanded()[-1] == 0.0, what="a stop")

    drive(wire, seat, "hold", person)


def test_a_screen_that_takes_nothing_holds_no_command_up(wire: Wire, seat: Seat) -> None:
    os.set_blocking(seat.slave, False)
    with pytest.raises(BlockingIOError):
        while True:
            os.write(seat.slave, b" " * 4096)
    os.set_blocking(seat.slave, True)

    def person() -> None:
        forward = itertools.cycle((b"i", b"I"))

        def moves() -> bool:
            seat.type(next(forward))  # one that repeats since the start would be old
            return seat.commanded().count(0.5) > 20

        wait_for(moves, what="a command that is repeated")
        seat.type(b"k")
        wait_for(lambda: seat.commanded()[-1] == 0.0, what="a stop")

    drive(wire, seat, "latch", person)
