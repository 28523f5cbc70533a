"""The controller: drives a robot to the goals that next_goal hands out."""

import argparse
import math
import sys

from holozen import connection, flags
from holozen.bus import Bus
from holozen.errors import BusError
from holozen.messages import TriggerReply, TriggerRequest
from holozen.parameters import Parameters
from holozen.process import stop_event
from holozen.tell import say
from holozen.wire import key_for

from .follow import Follower
from .goto import Gains, Leg
from .knobs import KNOBS, declared


def parser() -> argparse.ArgumentParser:
    default = Gains()
    parser = flags.Parser(
        prog="holozen controller",
        description="Drive a robot to the goals of next_goal.",
        epilog="example: holozen controller --laps 0",
    )
    parser.add_argument("robot", nargs="?", default="", type=flags.robot, help="its name; none: the one at the root")
    parser.add_argument("--resume", action="store_true", help="let the controller drive again, and end")
    parser.add_argument("--laps", type=flags.count(), default=1, help="times round the list; 0: for ever (default: 1)")
    for knob in KNOBS:
        parser.add_argument(knob.flag, type=flags.number(knob.low, knob.high, knob.unit),
            default=getattr(default, knob.field), help=f"{knob.about}, {knob.unit} (default: %(default)g)")  # fmt: skip
    connection.add_arguments(parser)
    return parser


def main(argv: list[str] | None = None) -> int:
    args = parser().parse_args(argv)
    where = connection.from_arguments(args)
    try:
        return resume(args.robot, where) if args.resume else follow(args, where)
    except BusError as failure:
        say(f"controller: {failure}")
        return 1


def follow(args: argparse.Namespace, where: connection.Connection) -> int:
    """Drive `args.laps` laps, and say after each how well."""
    stop, laps = stop_event(), 0
    with Bus("controller", where, lasting=True, stop=stop) as bus:
        follower = Follower(bus, args.robot, _gains(args), stop, lambda text: say(f"controller: {text}"))
        serve_parameters(bus, args.robot, follower)
        try:
            while not stop.is_set() and (laps < args.laps or not args.laps):
                report(follower.lap(), laps := laps + 1)
        finally:
            follower.halt()
    return 0


def serve_parameters(bus: Bus, robot: str, follower: Follower) -> None:
    """Let others read and set its gains and limits; they hold from the next command on."""

    def write(gains: Gains) -> None:
        follower.gains = gains

    Parameters(bus, key_for("controller", robot), lambda: declared(lambda: follower.gains, write)).start()


def resume(robot: str, where: connection.Connection) -> int:
    """Tell the sim that overruled sources may drive again."""
    with Bus("controller_resume", where, patience=3.0) as bus:
        reply = bus.call(key_for("resume", robot), TriggerRequest(), TriggerReply)
    say(reply.message)
    return 0 if reply.success else 1


def report(legs: list[Leg], lap: int) -> None:
    """Print one line a leg: goal, time, worst distance from the straight line."""
    for number, leg in enumerate(legs):
        x, y, theta = leg.goal
        seconds = leg.ended - leg.began
        print(
            f"lap {lap} goal {number}: ({x:.2f}, {y:.2f}, {math.degrees(theta):.0f} deg) "
            f"in {seconds:.2f} s, path error {leg.path_error * 1000:.1f} mm",
            flush=True,
        )


def _gains(args: argparse.Namespace) -> Gains:
    return Gains(**{knob.field: getattr(args, knob.name) for knob in KNOBS})


if __name__ == "__main__":
    sys.exit(main())
