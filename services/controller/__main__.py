"""The controller: drives a robot to the goals of next_goal."""

import argparse
import math
import sys
from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

from msgspec.structs import replace

from holozen import flags
from holozen.bus import Bus
from holozen.console import output, report
from holozen.messages import TriggerReply, TriggerRequest
from holozen.process import stop_event
from holozen.transport import connection
from holozen.transport.errors import BusError
from holozen.transport.parameters import Number, Parameters, warn_of_twin
from holozen.wire import key_for

from .follow import Follower
from .goto import Gains, Leg


class Param(NamedTuple):
    """A gain, as a flag and as a parameter that can be set while it drives. `field` is its name in
    Gains.
    """

    name: str
    field: str
    low: float
    high: float
    unit: str
    about: str

    @property
    def flag(self) -> str:
        """Its command-line flag."""
        return "--" + self.name.replace("_", "-")


PARAMS = (
    Param("max_speed", "max_speed", 0.01, 10, "m/s", "maximum speed"),
    Param("max_turn", "max_turn", 0.01, 20, "rad/s", "maximum turn rate"),
    Param("max_acceleration", "max_acceleration", 0.01, 100, "m/s^2", "maximum acceleration"),
    Param("gain", "linear", 0.1, 10, "1/s", "speed per metre of distance"),
    Param("turn_gain", "angular", 0.1, 10, "1/s", "turn rate per radian of error"),
    Param("tolerance", "tolerance", 0.001, 1, "m", "allowed distance to a goal"),
    Param("angle_tolerance", "angle_tolerance", 0.001, 1, "rad", "allowed heading error at a goal"),
)


def parser() -> argparse.ArgumentParser:
    default = Gains()
    parser = flags.Parser(
        prog="holozen controller",
        description="drive a robot to the goals of next_goal",
        epilog="example: holozen controller --laps 0",
    )
    add = parser.add_argument
    add(
        "robot",
        nargs="?",
        default="",
        type=flags.robot,
        help="the robot's name; default: the robot without a name",
    )
    add("--resume", action="store_true", help="let the controller drive again, and exit")
    add(
        "--held",
        action="store_true",
        help="drive only after `holozen controller --resume` or the teleop's r",
    )
    add(
        "--laps",
        type=flags.count(),
        default=1,
        help="number of laps around the goals; 0: for ever (default: 1)",
    )
    for param in PARAMS:
        add(
            param.flag,
            type=flags.number(param.low, param.high, param.unit),
            default=getattr(default, param.field),
            help=f"{param.about}, {param.unit} (default: %(default)g)",
        )
    flags.add_json(parser)
    connection.add_arguments(parser, role="autopilot")
    return parser


def main(argv: list[str] | None = None) -> int:
    args = parser().parse_args(argv)
    where = connection.from_arguments(args)
    try:
        return resume(args.robot, where) if args.resume else follow(args, where)
    except BusError as failure:
        report(f"controller: {failure}")
        return 1


def follow(args: argparse.Namespace, where: connection.Connection) -> int:
    """Drive `args.laps` laps (0: for ever), and print the legs of each."""
    stop, laps = stop_event(), 0
    with Bus("controller", where, lasting=True, stop=stop) as bus:
        follower = Follower(
            bus,
            args.robot,
            _gains(args),
            stop,
            lambda text: report(f"controller: {text}"),
            args.held,
        )
        Parameters(bus, key_for("controller", args.robot), lambda: declared(follower)).start()
        warn_of_twin(bus, key_for("controller", args.robot))
        try:
            while not stop.is_set() and (laps < args.laps or not args.laps):
                print_legs(follower.lap(), laps := laps + 1)
        finally:
            follower.halt()
            follower.close()
    return 0


def declared(follower: Follower) -> Iterator[Number]:
    """The follower's gains as parameters; changes apply from the next command on."""
    for param in PARAMS:
        yield Number(
            param.name,
            param.about,
            param.unit,
            param.low,
            param.high,
            partial(_get, follower, param.field),
            partial(_set, follower, param.field),
        )


def _get(follower: Follower, field: str) -> float:
    value: float = getattr(follower.gains, field)
    return value


def _set(follower: Follower, field: str, value: float) -> None:
    follower.gains = replace(follower.gains, **{field: value})


def resume(robot: str, where: connection.Connection) -> int:
    """Ask the sim to let overruled sources drive again."""
    with Bus("controller_resume", where) as bus:
        reply = bus.call(key_for("resume", robot), TriggerRequest(), TriggerReply)
    report(reply.message)
    return 0 if reply.success else 1


def print_legs(legs: list[Leg], lap: int) -> None:
    """Print a line for each leg: goal, time, and the largest distance from the straight line."""
    for number, leg in enumerate(legs):
        x, y, theta = leg.goal
        seconds = leg.ended - leg.began
        output(
            f"lap {lap} goal {number}: ({x:.2f}, {y:.2f}, {math.degrees(theta):.0f} deg) "
            f"in {seconds:.2f} s, path error {leg.path_error * 1000:.1f} mm"
        )


def _gains(args: argparse.Namespace) -> Gains:
    return Gains(**{param.field: getattr(args, param.name) for param in PARAMS})


if __name__ == "__main__":
    sys.exit(main())
