"""The pose service: hands out goals and tells where robots are."""

import argparse
import sys
from pathlib import Path

from holozen import connection
from holozen.bus import Bus, BusError, ServiceError
from holozen.flags import number
from holozen.messages import GetPoseReply, GetPoseRequest, NextGoalReply, NextGoalRequest, Odometry
from holozen.process import stop_event, wait_for_end
from holozen.tell import say

from .shapes import SHAPES, Goal, GoalsError, read_goals
from .tracker import Tracker


def next_goal(goals: list[Goal], request: NextGoalRequest) -> NextGoalReply:
    """The goal with the number asked for, counted from 0. Raises ServiceError past either end of the list."""
    number = request.request_goal
    if not 0 <= number < len(goals):
        raise ServiceError(f"goal {number}: the list holds goals 0 to {len(goals) - 1}")
    x, y, theta = goals[number]
    return NextGoalReply(x, y, theta, int(number == len(goals) - 1))


def parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="holozen pose-service", description="Answer next_goal and get_pose.")
    parser.add_argument("--shape", choices=SHAPES, default="square", help="the goals' shape (default: square)")
    parser.add_argument(
        "--size", type=number(0.01, 1000, "m"), default=1.0, help="its side (infinity: half its length) in m"
    )
    parser.add_argument("--goals", type=Path, metavar="FILE", help="goals from a file instead: x y theta a line")
    connection.add_arguments(parser)
    return parser


def main(argv: list[str] | None = None) -> int:
    args = parser().parse_args(argv)
    stop = stop_event()
    try:
        goals = read_goals(args.goals) if args.goals else SHAPES[args.shape](args.size)
        with Bus("pose_service", connection.from_arguments(args), lasting=True, stop=stop) as bus:
            tracker = Tracker(bus.subscribe("**/odom", Odometry, depth=256))
            bus.serve("get_pose", GetPoseRequest, GetPoseReply, tracker.get_pose).start()
            bus.serve("next_goal", NextGoalRequest, NextGoalReply, lambda request: next_goal(goals, request)).start()
            say(f"pose_service: {len(goals)} goals from {args.goals or args.shape}")
            wait_for_end(stop)
    except (BusError, GoalsError) as error:
        say(f"pose_service: {error}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
