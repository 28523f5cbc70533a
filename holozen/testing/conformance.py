"""The promises that every base keeps that obeys `cmd_vel`. Test a robot for them before people
stand beside it.

    @pytest.fixture(scope="module")
    def probe():
        with Wire() as wire:
            wire.start("sim")  # or your base
            yield Probe(wire.bus)

    @pytest.mark.parametrize("promise", PROMISES, ids=name)
    def test_the_base_keeps_its_promises(promise, probe):
        promise(probe)

For a base that is running, `python -m holozen.testing.conformance [ROBOT]` does the same. The robot
moves, forward and back at `speed` (m/s), for a few seconds at a time. Each promise raises
AssertionError with what was seen instead.
"""

import argparse
import math
import struct
import sys
import time
from collections.abc import Callable
from functools import partial
from itertools import count, pairwise
from typing import Any

from holozen import flags
from holozen.bus import Bus
from holozen.console import output, report
from holozen.messages import Odometry, TriggerReply, TriggerRequest, Twist
from holozen.messages.codec import encode, encoding
from holozen.testing.process import wait_for
from holozen.transport import connection
from holozen.transport.errors import BusError
from holozen.wire import COMMAND_SILENCE, key_for

SPEED = 0.1  # m/s
PATIENCE = 10.0  # s for a base to begin to move; it may be held up
# s from the last command to rest: COMMAND_SILENCE, its braking, and what a busy machine adds
SETTLING = 3.0
LOOK = 1.0  # s for which a base that must not move is watched
EVERY = 0.05  # s between two commands, as a teleop sends them
SCRIPTED = 5  # commands by the script for each one by the person, while both command
SLOWEST = 10.0  # Hz of odom: readers call it stale after 0.2 s
# s between two commands of the person, below which it is sure to drive; a busy machine may hold up
# this test
STEADY = COMMAND_SILENCE / 2
AGREES = 0.25  # share of the distance by which pose and twist of the odometry may disagree


class Probe:
    """A base, by its robot's name, and its two drivers: a script and a person. `connect` opens a
    bus for a node's name.

    The base is driven at `speed` (m/s); slower than a fifth of that counts as rest.
    """

    def __init__(
        self, connect: Callable[[str], Bus], robot: str = "", speed: float = SPEED
    ) -> None:
        self.speed, self._robot, self._bus = speed, robot, connect("conformance")
        self.odom = self._bus.subscribe(key_for("odom", robot), Odometry, depth=4096)
        key = key_for("cmd_vel", robot)
        self.script = self._bus.publisher(key, Twist)
        self.person = connect("conformance_person").publisher(key, Twist, "INTERACTIVE_HIGH")

    def call(self, service: str) -> None:
        """Call one of the robot's services without fields, such as `stop`."""
        self._bus.call(key_for(service, self._robot), TriggerRequest(), TriggerReply)

    def newest(self) -> Odometry:
        """The first odom that arrives after this call."""
        self._read()
        wait_for(lambda: bool(self._read()), PATIENCE, "odom")
        return self._last

    def watch(
        self,
        seconds: float,
        meanwhile: Callable[[], object] = lambda: None,
        every: float = EVERY,
        within: float = PATIENCE,
    ) -> list[Odometry]:
        """All odoms of the next `seconds`, during which `meanwhile` is called every `every`
        seconds; longer until the first one. Empty if none came `within` seconds.
        """
        began, found, due = time.monotonic(), list[Odometry](), 0.0
        while (passed := time.monotonic() - began) <= (seconds if found else within):
            if passed >= due:
                meanwhile()
                due = passed + every
            found += self._read()
            time.sleep(0.002)
        return found + self._read()

    def drive(self, commands: Callable[[], object], way: int, every: float = EVERY) -> None:
        """Call `commands` every `every` seconds until the robot moves forward (`way` 1) or back
        (-1).
        """
        due = 0.0

        def moves() -> bool:
            nonlocal due
            if time.monotonic() >= due:
                commands()
                due = time.monotonic() + every
            return any(way * odom.twist.twist.linear.x > self.speed / 2 for odom in self._read())

        wait_for(
            moves, PATIENCE, f"the robot to move {'forward' if way > 0 else 'back'} as commanded"
        )

    def rest(self, why: str, within: float = SETTLING) -> None:
        """Wait until the robot rests."""
        wait_for(lambda: any(map(self.rests, self._read())), within, f"the robot to rest {why}")

    def rests(self, odom: Odometry) -> bool:
        """Whether it moves slower than a fifth of the speed."""
        return odom.twist.twist.is_slow(self.speed / 5)

    def calm(self) -> None:
        """Send stops, wait for rest, and let every source drive again."""
        self.person.put(Twist())
        self.script.put(Twist())
        self.rest("after a stop was sent")
        time.sleep(2 * COMMAND_SILENCE)
        try:
            self.call("resume")
        except BusError:  # a base without that service holds no sources
            pass

    def _read(self) -> list[Odometry]:
        found = [
            received.message for received in iter(self.odom.try_recv, None) if received.message
        ]
        self._last = found[-1] if found else getattr(self, "_last", Odometry())
        return found


def it_obeys_and_stops_in_silence(probe: Probe) -> None:
    """It moves as commanded, and rests after 0.5 s without a command."""
    probe.drive(lambda: probe.script.put(Twist.planar(probe.speed)), 1)
    probe.rest(f"after {COMMAND_SILENCE:g} s without a command: is there a watchdog?")


def it_stops_at_once_on_command(probe: Probe) -> None:
    """A zero Twist stops it."""
    probe.drive(lambda: probe.script.put(Twist.planar(-probe.speed)), -1)
    probe.script.put(Twist())
    probe.rest("after a zero command")


def it_refuses_impossible_speeds(probe: Probe) -> None:
    """NaN, infinity and an absurd speed move nothing and leave odometry finite, and it obeys again
    afterwards.
    """
    for bad in (math.nan, math.inf, 1e300):
        payload = encode(Twist.planar(probe.speed), "cdr").replace(
            struct.pack("<d", probe.speed), struct.pack("<d", bad)
        )
        send = partial(probe.script.put_bytes, payload, encoding("cdr", Twist))
        seen = probe.watch(LOOK, send)
        assert seen, f"no odom after a speed of {bad}"
        for odom in seen:
            numbers = (
                *odom.pose.pose.planar(),
                odom.twist.twist.linear.x,
                odom.twist.twist.linear.y,
            )
            assert all(map(math.isfinite, numbers)), f"odom has {numbers} after a speed of {bad}"
            assert probe.rests(odom), (
                f"the robot moves at {numbers[3]:g} m/s after a speed of {bad}"
            )
    it_obeys_and_stops_in_silence(probe)


def a_person_comes_first(probe: Probe) -> None:
    """When a script commands forward and a person back, five times less often, it moves back."""
    number, sent = count(), list[float]()

    def both() -> None:
        # Commands are spread over time: in a burst, the last one to arrive may be either's.
        probe.script.put(Twist.planar(probe.speed))
        if next(number) % SCRIPTED == 0:
            probe.person.put(Twist.planar(-probe.speed))
            sent.append(time.monotonic())

    def look() -> list[Odometry]:
        """What comes while the person commands steadily; nothing if this was held up."""
        probe.drive(both, -1, EVERY / SCRIPTED)
        del sent[:-1]
        seen = probe.watch(LOOK, both, EVERY / SCRIPTED)
        return seen if all(after - before < STEADY for before, after in pairwise(sent)) else []

    probe.drive(lambda: probe.script.put(Twist.planar(probe.speed)), 1)
    seen = wait_for(look, 2 * PATIENCE, "odom while a person and a script command steadily")
    for odom in seen:
        x = odom.twist.twist.linear.x
        assert x < 0, (
            f"the robot moves at {x:g} m/s, while a person commands {-probe.speed:g} and a script "
            "the opposite"
        )
    probe.calm()


def it_stands_while_it_is_stopped(probe: Probe) -> None:
    """After the service `stop` no command moves it; after `release`, those of a source that has let
    go do.
    """
    forward = partial(probe.script.put, Twist.planar(probe.speed))
    probe.drive(forward, 1)
    probe.call("stop")
    try:
        deadline = time.monotonic() + SETTLING
        while not any(map(probe.rests, probe.watch(EVERY, forward))):
            assert time.monotonic() < deadline, "the robot goes on after `stop`"
        seen = probe.watch(LOOK, forward)
        assert seen, "no odom while it is stopped"
        moving = [odom for odom in seen if not probe.rests(odom)]
        assert not moving, (
            f"the robot moves at {moving[0].twist.twist.linear.x:g} m/s while it is stopped"
        )
    finally:
        probe.call("release")
    probe.calm()
    it_obeys_and_stops_in_silence(probe)


def its_odometry_is_steady_and_agrees_with_itself(probe: Probe) -> None:
    """odom comes at 10 Hz or more, with frames and increasing stamps, and its pose moves as its
    twist says.
    """
    probe.newest()
    seen = probe.watch(2 * LOOK, lambda: probe.script.put(Twist.planar(probe.speed)))
    stamps = [odom.header.stamp.seconds() for odom in seen]
    assert len(seen) > 1, f"{len(seen)} odoms in {2 * LOOK:g} s"
    assert all(later > earlier for earlier, later in pairwise(stamps)), "stamps do not increase"
    rate = (len(seen) - 1) / (stamps[-1] - stamps[0])
    assert rate >= SLOWEST, f"odom comes at {rate:.1f} Hz; at least {SLOWEST:g} Hz are needed"
    assert seen[0].header.frame_id, "odom has no header.frame_id"
    assert seen[0].child_frame_id, "odom has no child_frame_id"
    speeds = [odom.twist.twist.linear.x for odom in seen[1:]]
    way = sum(
        speed * (later - earlier)
        for speed, (earlier, later) in zip(speeds, pairwise(stamps), strict=True)
    )
    (x, y, _), (x1, y1, _) = seen[0].pose.pose.planar(), seen[-1].pose.pose.planar()
    went = math.hypot(x1 - x, y1 - y)
    assert abs(went - abs(way)) <= AGREES * abs(way) + 0.01, (
        f"its pose moved {went:.3f} m, its twist says {way:.3f} m"
    )
    probe.rest("after silence")


PROMISES: tuple[Callable[[Probe], None], ...] = (
    it_obeys_and_stops_in_silence,
    it_stops_at_once_on_command,
    it_refuses_impossible_speeds,
    a_person_comes_first,
    it_stands_while_it_is_stopped,
    its_odometry_is_steady_and_agrees_with_itself,
)


def name(promise: Any) -> str:
    """A promise in words, from the name of its function."""
    return str(promise.__name__).replace("_", " ")


def main(argv: list[str] | None = None) -> int:
    """Test a running robot for all promises; returns 0 if it keeps them."""
    parser = flags.Parser(
        prog="python -m holozen.testing.conformance",
        description="Test a base for its promises. The robot MOVES: clear a few metres, and keep "
        "a hand on its switch.",
        epilog="example: python -m holozen.testing.conformance Fred --speed 0.05",
    )
    parser.add_argument("robot", nargs="?", default="", type=flags.robot, help="the robot's name")
    parser.add_argument(
        "--speed",
        type=flags.number(0.01, 1.0, "m/s"),
        default=SPEED,
        metavar="M/S",
        help="default: %(default)g",
    )
    parser.add_argument(
        "--wait",
        type=flags.number(0.1, 1e6, "s"),
        default=PATIENCE / 2,
        metavar="S",
        help="how long to wait for the base's odom; default: %(default)g",
    )
    connection.add_arguments(parser)
    args: argparse.Namespace = parser.parse_args(argv)
    where, buses, broken = connection.from_arguments(args), list[Bus](), 0

    def connect(node: str) -> Bus:
        buses.append(Bus(node, where))
        return buses[-1]

    try:
        probe = Probe(connect, args.robot, args.speed)
        if not probe.watch(0.0, within=args.wait):
            report(
                f"conformance: no odom of {args.robot or 'the robot at the root'} at "
                f"{where.where}; start its base"
            )
            return 1
        for promise in PROMISES:
            try:
                promise(probe)
                output(f"ok      {name(promise)}")
            except AssertionError as error:
                broken += 1
                output(f"BROKEN  {name(promise)}: {error}")
                probe.calm()
    except (BusError, AssertionError) as error:
        report(f"conformance: {error}")
        return 1
    finally:
        for bus in buses:
            bus.close()
    return int(broken > 0)


if __name__ == "__main__":
    sys.exit(main())
