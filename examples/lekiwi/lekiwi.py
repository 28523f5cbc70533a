"""LeKiwi's base on the wire, in place of the sim: three omni wheels on STS3215 servos.

    python examples/lekiwi/lekiwi.py /dev/ttyACM0

Without the robot: `python examples/lekiwi/simulated_servos.py` prints a port to use instead. See docs/real-robots.md.
"""

import argparse
import contextlib
import fcntl
import math
import os
import select
import signal
import sys
import threading
import time
from pathlib import Path

from feetech import ServoError, Servos

from holozen import flags
from holozen.bus import Bus, BusError
from holozen.command.base import Base
from holozen.console import report
from holozen.kinematics import Wheel, planar_velocity, wheel_rate
from holozen.limits import STOP, Planar
from holozen.process import stop_event
from holozen.transport import connection

RATE = 50.0  # Hz
RADIUS, ARM = 0.05, 0.125  # m; the radius of a wheel, and its distance from the centre
ROLLS = {7: 150, 8: -90, 9: 30}  # servo -> its wheel's rolling direction, in degrees from forward: left, back, right
MAX_LINEAR, MAX_ANGULAR = 0.2, 1.0  # m/s, rad/s
MAX_RATE = 4.6  # rad/s of a wheel, 3000 steps/s; beyond, all turn slower, so that the robot keeps its direction
SILENCE = 0.3  # s without a pass of the loop after which the guard stops the wheels
LAST_STOPS = 10  # of the guard: one may get lost, while a servo still answers the process that has ended
UNREAD = 64  # beats that the guard may leave unread, 1.3 s, a power of two; beyond, the process ends
MAX_LOST = 5  # missing answers in a row; beyond, the process ends


def wheel(degrees: float) -> Wheel:
    """The wheel that rolls in a direction (degrees from forward) when the base turns left."""
    roll = math.radians(degrees)
    return Wheel("", ARM * math.sin(roll), -ARM * math.cos(roll), -math.sin(roll), math.cos(roll), RADIUS)


WHEELS = {servo: wheel(degrees) for servo, degrees in ROLLS.items()}


def rates_for(velocity: Planar) -> dict[int, float]:
    """The rate (rad/s) of each servo for a body-frame velocity, none above MAX_RATE."""
    rates = {servo: wheel_rate(velocity, wheel) for servo, wheel in WHEELS.items()}
    scale = min(1.0, MAX_RATE / max(MAX_RATE, *map(abs, rates.values())))
    return {servo: rate * scale for servo, rate in rates.items()}


class GuardError(Exception):
    """The guard is gone or hangs. The text is one line."""


class Guard:
    """A process that stops the wheels when this one is gone or hangs, since servos turn until they are commanded.

    It has a session of its own: what suspends or kills this process together with its job or its terminal, such as
    Ctrl-Z, Ctrl-\\ and `kill -9 %1`, does not reach it. Start it before there are threads, which a fork does not copy.
    Raises GuardError.
    """

    def __init__(self, servos: Servos) -> None:
        # In packet mode each beat takes a page of the pipe, so that a guard that does not read is soon noticed.
        (heard, self._beat), (ready, begun) = os.pipe2(os.O_DIRECT), os.pipe()
        with contextlib.suppress(OSError):  # where pages are large it has room for 16 beats
            fcntl.fcntl(self._beat, fcntl.F_SETPIPE_SZ, UNREAD * os.sysconf("SC_PAGE_SIZE"))
        self.pid = os.fork()
        if not self.pid:
            try:
                os.close(self._beat)
                _keep_guard(servos, heard, begun)
            finally:
                os._exit(0)
        os.close(heard)
        os.close(begun)
        os.set_blocking(self._beat, False)
        if not os.read(ready, 1):
            raise self._lost()
        os.close(ready)

    def beat(self) -> None:
        """Tell it that this process is alive; at each pass of the loop. Raises GuardError."""
        try:
            os.write(self._beat, b".")
        except OSError:  # it is gone, or the pipe is full
            raise self._lost() from None

    def _lost(self) -> GuardError:
        return GuardError(
            f"the guard that stops the wheels, process {self.pid}, has ended or hangs; start lekiwi.py again"
        )


def _keep_guard(servos: Servos, heard: int, begun: int) -> None:
    """Stop the wheels whenever nothing has been `heard` for SILENCE, and for good once it is closed. Writes to `begun`
    when nothing that is sent to the guarded process's job or terminal ends this one.
    """
    os.setsid()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)  # systemd sends SIGTERM to all processes of a unit
    os.write(begun, b".")
    while not (is_heard := bool(select.select([heard], [], [], SILENCE)[0])) or os.read(heard, 4096):
        if not is_heard:
            with contextlib.suppress(ServoError):
                servos.turn(rates_for(STOP))
    for _ in range(LAST_STOPS):
        with contextlib.suppress(ServoError):
            servos.turn(rates_for(STOP))
        time.sleep(1 / RATE)


def run(base: Base, servos: Servos, guard: Guard, stop: threading.Event) -> None:
    """Drive as commanded until `stop` is set. Raises BusError, GuardError and ServoError."""
    due, lost = time.monotonic(), 0
    while not stop.wait(max(0.0, due - time.monotonic())):
        due = max(due + 1 / RATE, time.monotonic())
        guard.beat()
        servos.turn(rates_for(base.velocity()))
        try:
            base.publish(planar_velocity([servos.rate(servo) for servo in WHEELS], [*WHEELS.values()]))
            lost = 0
        except ServoError:
            lost += 1  # without odom a controller stops
            if lost > MAX_LOST:
                raise


def main(argv: list[str] | None = None) -> int:
    parser = flags.Parser(prog="lekiwi.py", description="Drive LeKiwi's base by cmd_vel.",
        epilog="example: python examples/lekiwi/lekiwi.py /dev/ttyACM0 Kiwi")  # fmt: skip
    parser.add_argument("port", help="the serial port of the servos")
    parser.add_argument("robot", nargs="?", default="", type=flags.robot, help="the robot's name; default: none")
    parser.add_argument("--state", type=Path, metavar="DIR",
        help="keep software stops in files there (default: HOLOZEN_STATE, else ~/.local/state/holozen)")  # fmt: skip
    connection.add_arguments(parser)
    args: argparse.Namespace = parser.parse_args(argv)
    where, stop = connection.from_arguments(args), stop_event()
    try:
        with Servos(args.port) as servos:
            guard = Guard(servos)
            try:
                servos.make_wheels(WHEELS)
                with Bus("lekiwi", where, lasting=True, stop=stop) as bus:
                    base = Base(bus, args.robot, max_linear=MAX_LINEAR, max_angular=MAX_ANGULAR, state=args.state)
                    report(f"lekiwi: drives the servos at {args.port}")
                    run(base, servos, guard, stop)
            finally:
                servos.turn(rates_for(STOP))
    except (BusError, GuardError, ServoError) as error:
        report(f"lekiwi: {error}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
