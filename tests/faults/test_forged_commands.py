"""Forged names and meaningless commands: the person who drives goes on driving."""

import threading
import time
from collections.abc import Iterator

import pytest
import zenoh

from holozen.bus import Bus
from holozen.messages import CommandStatus, Twist
from holozen.messages.rcl_interfaces import (
    Parameter,
    ParameterValue,
    SetParametersReply,
    SetParametersRequest,
)
from holozen.testing import Wire, wait_for

NAMES = 1200


class Person:
    """Drives at 20 Hz from a thread, as a held key does."""

    def __init__(self, bus: Bus) -> None:
        self.source = bus.source
        self._commands = bus.publisher("cmd_vel", Twist, "INTERACTIVE_HIGH")
        self._let_go = threading.Event()
        self._thread = threading.Thread(target=self._drive)
        self._thread.start()

    def _drive(self) -> None:
        while not self._let_go.wait(0.05):
            self._commands.put(Twist.planar(0.2))
        self._commands.put(Twist())

    def let_go(self) -> None:
        self._let_go.set()
        self._thread.join()


@pytest.fixture
def statuses(wire: Wire) -> Iterator["Statuses"]:
    wire.start("sim").wait_for_line("listens on cmd_vel")
    bus = wire.bus()
    # for a person's thread on a busy machine
    longer = Parameter("command_timeout", ParameterValue.of(2.0))
    reported = bus.call("sim/set_parameters", SetParametersRequest([longer]), SetParametersReply)
    assert reported.results[0].successful, reported
    yield Statuses(bus)


class Statuses:
    """The sim's status of the drivers."""

    def __init__(self, bus: Bus) -> None:
        self.bus = bus
        self._subscription = bus.subscribe("cmd_vel_status", CommandStatus, depth=1)

    def next(self) -> CommandStatus:
        def newer() -> CommandStatus | None:
            received = self._subscription.try_recv()
            return received.message if received else None

        self._subscription.try_recv()
        return wait_for(newer) or CommandStatus()

    def wait_for(self, source: str) -> CommandStatus:
        """The next status in which a source drives. One that a busy machine holds up for seconds
        does not, until it goes on; one that is held never does.
        """

        def driven() -> CommandStatus | None:
            status = self.next()
            return status if status.obeyed == source else None

        found = wait_for(driven, what=lambda: f"{source} to drive; {self.next()}")
        assert found
        return found


def forge(bus: Bus, names: int, priority: zenoh.Priority) -> None:
    """Publish forged commands, fast, but not so fast that the sim misses most of them: it reads the
    newest 64 between two steps.
    """
    for number in range(names):
        time.sleep(0.02 * (number % 30 == 29))
        bus.session.put(
            "cmd_vel", "{}", attachment=f"forged{number}@{number:06x}", priority=priority
        )


def test_a_flood_of_names_at_the_lowest_priority_holds_no_person(
    wire: Wire, statuses: Statuses
) -> None:
    person = Person(wire.bus("teleop", lasting=True))
    try:
        statuses.wait_for(person.source)

        def flooded() -> bool:
            forge(statuses.bus, NAMES, zenoh.Priority.BACKGROUND)
            return sum(statuses.next().refused.values()) >= 0.5 * NAMES

        wait_for(flooded)  # again where a busy sim missed most of them
        status = statuses.wait_for(person.source)
        assert [each.held for each in status.sources if each.source == person.source] == [False]
    finally:
        person.let_go()
    another = Person(wire.bus("teleop", lasting=True))
    try:
        statuses.wait_for(another.source)
    finally:
        another.let_go()


def test_what_no_robot_can_mean_neither_stops_nor_moves_it(wire: Wire, statuses: Statuses) -> None:
    person = Person(wire.bus("teleop", lasting=True))
    try:
        statuses.wait_for(person.source)
        for x, more in (("1.5e308", ', "y": 1.5e308'), ("1e308", "")):
            twist = f'{{"linear": {{"x": {x}{more}}}}}'

            def refused(twist: str = twist, x: str = x) -> bool:
                """Whether that is the last refusal: a busy machine's late commands are others."""
                statuses.bus.session.put("cmd_vel", twist, priority=zenoh.Priority.REAL_TIME)
                return f"linear.x is {float(x):g}" in statuses.next().last_refusal

            wait_for(refused, what=lambda: f"a refusal; {statuses.next()}")
            assert statuses.wait_for(person.source).refused["implausible"]
    finally:
        person.let_go()
