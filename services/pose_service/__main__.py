"""The pose service: hands out goals and tells where robots are."""

import argparse
import sys
from pathlib import Path

from holozen import connection
from holozen.bus import Bus
from holozen.errors import BusError
from holozen.flags import Parser, number
from holozen.messages import GetPoseReply, GetPoseRequest, NextGoalReply, NextGoalRequest, Odometry
from holozen.parameters import Parameters
from holozen.process import stop_event, wait_for_end
from holozen.tell import say

from .route import SIZES, Route
from .shapes import SHAPES, GoalsError
from .tracker import Tracker


def parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="holozen pose-service",
        description="Answer next_goal and get_pose.",
        epilog="example: holozen pose-service --shape hexagon --size 2",
    )
    parser.add_argument("--shape", choices=SHAPES, default="square", help="the goals' shape (default: square)")
    parser.add_argument(
        "--size", type=number(*SIZES, "m"), default=1.0, help="its side (infinity: half its length) in m"
    )
    parser.add_argument("--goals", type=Path, metavar="FILE", help="goals from a file instead: x y theta a line")
    connection.add_arguments(parser)
    return parser


def main(argv: list[str] | None = None) -> int:
    args = parser().parse_args(argv)
    stop = stop_event()
    try:
        route = Route(args.shape, args.size, args.goals)
        with Bus("pose_service", connection.from_arguments(args), lasting=True, stop=stop) as bus:
            tracker = Tracker(bus.subscribe("**/odom", Odometry, depth=256))
            bus.serve("get_pose", GetPoseRequest, GetPoseReply, tracker.get_pose).start()
            bus.serve("next_goal", NextGoalRequest, NextGoalReply, route.next_goal).start()
            Parameters(bus, "pose_service", route.declared).start()
            say(f"pose_service: {len(route.goals)} goals from {args.goals or args.shape}")
            wait_for_end(stop)
    except (BusError, GoalsError) as error:
        say(f"pose_service: {error}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
