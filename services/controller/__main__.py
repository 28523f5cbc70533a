"""The controller: drives a robot to the goals that next_goal hands out."""

import argparse
import math
import sys

from holozen import connection, flags
from holozen.bus import Bus, BusError
from holozen.messages import TriggerReply, TriggerRequest
from holozen.process import stop_event
from holozen.tell import say
from holozen.wire import key_for

from .follow import Follower
from .goto import Gains, Leg


def parser() -> argparse.ArgumentParser:
    default = Gains()
    parser = argparse.ArgumentParser(prog="holozen controller", description="Drive a robot to the goals of next_goal.")
    parser.add_argument("robot", nargs="?", default="", type=flags.robot, help="its name; none: the one at the root")
    parser.add_argument("--resume", action="store_true", help="let the controller drive again, and end")
    parser.add_argument("--laps", type=flags.count(), default=1, help="times round the list; 0: for ever (default: 1)")
    add = parser.add_argument
    add("--max-speed", type=flags.number(0.01, 10, "m/s"), default=default.max_speed, help="m/s (default: 0.5)")
    add("--max-turn", type=flags.number(0.01, 20, "rad/s"), default=default.max_turn, help="rad/s (default: 1)")
    add("--max-acceleration", type=flags.number(0.01, 100, "m/s^2"), default=default.max_acceleration, help="m/s^2")
    add("--gain", type=flags.number(0.1, 10, "1/s"), default=default.linear, help="of the distance, 1/s")
    add("--turn-gain", type=flags.number(0.1, 10, "1/s"), default=default.angular, help="of the angle, 1/s")
    add("--tolerance", type=flags.number(0.001, 1, "m"), default=default.tolerance, help="m (default: 0.01)")
    add("--angle-tolerance", type=flags.number(0.001, 1, "rad"), default=default.angle_tolerance, help="rad")
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
        try:
            while not stop.is_set() and (laps < args.laps or not args.laps):
                report(follower.lap(), laps := laps + 1)
        finally:
            follower.halt()
    return 0


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
    return Gains(
        linear=args.gain,
        angular=args.turn_gain,
        max_speed=args.max_speed,
        max_turn=args.max_turn,
        max_acceleration=args.max_acceleration,
        tolerance=args.tolerance,
        angle_tolerance=args.angle_tolerance,
    )


if __name__ == "__main__":
    sys.exit(main())
