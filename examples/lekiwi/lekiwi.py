"""LeKiwi's base on the wire, in place of the sim: three omni wheels on STS3215 servos.

    python examples/lekiwi/lekiwi.py /dev/ttyACM0

Without the robot: `python examples/lekiwi/simulated_servos.py` prints a port to use instead. See
    docs/real-robots.md.
"""

import argparse
import math
import sys
import threading
import time
from pathlib import Path

from feetech import ServoError, Servos

from holozen import flags
from holozen.bus import Bus, BusError
from holozen.command.base import Base
from holozen.command.guard import Guard, GuardError
from holozen.console import report
from holozen.kinematics import Wheel, planar_velocity, wheel_rate
from holozen.limits import STOP, Planar
from holozen.process import stop_event
from holozen.transport import connection

RATE = 50.0  # Hz
RADIUS, ARM = 0.05, 0.125  # m; the radius of a wheel, and its distance from the centre
# servo -> its wheel's rolling direction, in degrees from forward: left, back, right
ROLLS = {7: 150, 8: -90, 9: 30}
MAX_LINEAR, MAX_ANGULAR = 0.2, 1.0  # m/s, rad/s
# rad/s of a wheel, 3000 steps/s; beyond, all turn slower, so that the robot keeps its direction
MAX_RATE = 4.6
MAX_LOST = 5  # missing answers in a row; beyond, the process ends


def wheel(degrees: float) -> Wheel:
    """The wheel that rolls in a direction (degrees from forward) when the base turns left."""
    roll = math.radians(degrees)
    return Wheel(
        "", ARM * math.sin(roll), -ARM * math.cos(roll), -math.sin(roll), math.cos(roll), RADIUS
    )


WHEELS = {servo: wheel(degrees) for servo, degrees in ROLLS.items()}


def rates_for(velocity: Planar) -> dict[int, float]:
    """The rate (rad/s) of each servo for a body-frame velocity, none above MAX_RATE."""
    rates = {servo: wheel_rate(velocity, wheel) for servo, wheel in WHEELS.items()}
    scale = min(1.0, MAX_RATE / max(MAX_RATE, *map(abs, rates.values())))
    return {servo: rate * scale for servo, rate in rates.items()}


def run(base: Base, servos: Servos, stop: threading.Event) -> None:
    """Drive as commanded until `stop` is set. Raises BusError, GuardError and ServoError."""
    due, lost = time.monotonic(), 0
    while not stop.wait(max(0.0, due - time.monotonic())):
        due = max(due + 1 / RATE, time.monotonic())
        servos.turn(rates_for(base.velocity()))
        try:
            base.publish(
                planar_velocity([servos.rate(servo) for servo in WHEELS], [*WHEELS.values()])
            )
            lost = 0
        except ServoError:
            lost += 1  # without odom a controller stops
            if lost > MAX_LOST:
                raise


def main(argv: list[str] | None = None) -> int:
    parser = flags.Parser(
        prog="lekiwi.py",
        description="Drive LeKiwi's base by cmd_vel.",
        epilog="example: python examples/lekiwi/lekiwi.py /dev/ttyACM0 Kiwi",
    )
    parser.add_argument("port", help="the serial port of the servos")
    parser.add_argument(
        "robot", nargs="?", default="", type=flags.robot, help="the robot's name; default: none"
    )
    parser.add_argument(
        "--state",
        type=Path,
        metavar="DIR",
        help="keep software stops in files there (default: HOLOZEN_STATE, else "
        "~/.local/state/holozen)",
    )
    connection.add_arguments(parser)
    args: argparse.Namespace = parser.parse_args(argv)
    where, stop = connection.from_arguments(args), stop_event()
    try:
        with Servos(args.port) as servos:
            guard = Guard(lambda: servos.turn(rates_for(STOP)))
            try:
                servos.make_wheels(WHEELS)
                with Bus("lekiwi", where, lasting=True, stop=stop) as bus:
                    base = Base(
                        bus,
                        args.robot,
                        max_linear=MAX_LINEAR,
                        max_angular=MAX_ANGULAR,
                        state=args.state,
                        guard=guard,
                    )
                    report(f"lekiwi: drives the servos at {args.port}")
                    run(base, servos, stop)
            finally:
                servos.turn(rates_for(STOP))
    except (BusError, GuardError, ServoError) as error:
        report(f"lekiwi: {error}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
