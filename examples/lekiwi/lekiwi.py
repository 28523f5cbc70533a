"""LeKiwi's base on the wire, in place of the sim: three omni wheels on STS3215 servos.

    python examples/lekiwi/lekiwi.py /dev/ttyACM0

Without the robot: `python examples/lekiwi/simulated_servos.py` prints a port to use instead. See docs/real-robots.md.
"""

import argparse
import math
import os
import select
import signal
import sys
import threading
import time

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
RADIUS, ARM = 0.05, 0.125  # m; of a wheel, and from the centre to each
ROLLS = {7: 150, 8: -90, 9: 30}  # degrees from forward to where each servo's wheel rolls: left, back, right
MAX_LINEAR, MAX_ANGULAR = 0.2, 1.0  # m/s, rad/s
MAX_RATE = 4.6  # rad/s of a wheel, 3000 steps/s; beyond, all turn slower, so that the robot keeps its direction
SILENCE = 0.3  # s without a pass of the loop after which the guard stops the wheels
MOST_LOST = 5  # answers in a row; beyond, the robot has to be looked at


def wheel(degrees: float) -> Wheel:
    """The wheel that rolls in that direction when the base turns left."""
    roll = math.radians(degrees)
    return Wheel("", ARM * math.sin(roll), -ARM * math.cos(roll), -math.sin(roll), math.cos(roll), RADIUS)


WHEELS = {servo: wheel(degrees) for servo, degrees in ROLLS.items()}


def rates_for(velocity: Planar) -> dict[int, float]:
    """The rate (rad/s) of each servo for a body-frame velocity, none above MAX_RATE."""
    rates = {servo: wheel_rate(velocity, wheel) for servo, wheel in WHEELS.items()}
    scale = min(1.0, MAX_RATE / max(MAX_RATE, *map(abs, rates.values())))
    return {servo: rate * scale for servo, rate in rates.items()}


def guard(servos: Servos) -> int:
    """Start a process that stops the wheels when this one is gone or hangs: servos turn on for ever by themselves.

    Returns the pipe to which each pass of the loop has to write a byte.
    """
    heard, beat = os.pipe()
    if os.fork():
        os.close(heard)
        return beat
    os.close(beat)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # it outlasts the one that it guards
    is_alive = True
    while is_alive:
        is_heard = bool(select.select([heard], [], [], SILENCE)[0])
        is_alive = not is_heard or bool(os.read(heard, 4096))
        if not is_heard or not is_alive:
            try:
                servos.turn(rates_for(STOP))
            except ServoError:  # the port is gone
                break
    os._exit(0)


def run(base: Base, servos: Servos, beat: int, stop: threading.Event) -> None:
    """Drive as commanded until `stop` is set. Raises ServoError."""
    due, lost = time.monotonic(), 0
    while not stop.wait(max(0.0, due - time.monotonic())):
        due = max(due + 1 / RATE, time.monotonic())
        os.write(beat, b".")
        servos.turn(rates_for(base.velocity()))
        try:
            base.publish(planar_velocity([servos.rate(servo) for servo in WHEELS], [*WHEELS.values()]))
            lost = 0
        except ServoError:
            lost += 1  # no odom: whoever drives by it stops
            if lost > MOST_LOST:
                raise


def main(argv: list[str] | None = None) -> int:
    parser = flags.Parser(prog="lekiwi.py", description="Drive LeKiwi's base by cmd_vel.",
        epilog="example: python examples/lekiwi/lekiwi.py /dev/ttyACM0 Kiwi")  # fmt: skip
    parser.add_argument("port", help="the serial port of the servos")
    parser.add_argument("robot", nargs="?", default="", type=flags.robot, help="the robot's name; default: none")
    connection.add_arguments(parser)
    args: argparse.Namespace = parser.parse_args(argv)
    where, stop = connection.from_arguments(args), stop_event()
    try:
        with Servos(args.port) as servos:
            beat = guard(servos)  # before there are threads, which a fork would leave behind
            try:
                servos.make_wheels(WHEELS)
                with Bus("lekiwi", where, lasting=True, stop=stop) as bus:
                    base = Base(bus, args.robot, max_linear=MAX_LINEAR, max_angular=MAX_ANGULAR)
                    report(f"lekiwi: drives the servos at {args.port}")
                    run(base, servos, beat, stop)
            finally:
                servos.turn(rates_for(STOP))
    except (BusError, ServoError) as error:
        report(f"lekiwi: {error}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
