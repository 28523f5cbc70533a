"""The pose service: answers next_goal and get_pose."""

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

from holozen.bus import Bus
from holozen.console import report
from holozen.flags import Parser, number
from holozen.messages import GetPoseReply, GetPoseRequest, NextGoalReply, NextGoalRequest, Odometry
from holozen.process import stop_event, wait_for_end
from holozen.transport import connection
from holozen.transport.errors import BusError, ServiceError
from holozen.transport.parameters import Choice, Number, Parameter, Parameters, warn_of_twin

from .shapes import SHAPES, Goal, GoalsError, read_goals
from .tracker import MAX_ODOM_BYTES, Tracker

SIZES = (0.01, 1000.0)  # m


def next_goal(goals: list[Goal], request: NextGoalRequest) -> NextGoalReply:
    """The goal with the requested number, counted from 0. Raises ServiceError if the list has no such goal."""
    number = request.request_goal
    if not 0 <= number < len(goals):
        raise ServiceError(f"goal {number}: the list holds goals 0 to {len(goals) - 1}")
    x, y, theta = goals[number]
    return NextGoalReply(x, y, theta, int(number == len(goals) - 1))


class Route:
    """The goals of a `file`, or else of a `shape` of `size` metres. Raises GoalsError for a file that is wrong."""

    def __init__(self, shape: str, size: float, file: Path | None = None) -> None:
        self._shape, self._size, self._file = shape, size, file
        self.goals = read_goals(file) if file else SHAPES[shape](size)

    def declared(self) -> Iterator[Parameter]:
        """Its parameters; goals from a file cannot be changed."""
        if self._file:
            file = str(self._file)
            yield Choice("goals", "the file of the goals", (), lambda: file)
            return
        yield Choice(
            "shape", "the shape of the goals, from the next request on", tuple(SHAPES), lambda: self._shape,
            lambda shape: self._draw(shape, self._size),
        )  # fmt: skip
        yield Number(
            "size", "side length (for infinity: half its length)", "m", *SIZES, lambda: self._size,
            lambda size: self._draw(self._shape, size),
        )  # fmt: skip

    def _draw(self, shape: str, size: float) -> None:
        self._shape, self._size, self.goals = shape, size, SHAPES[shape](size)


def parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="holozen pose-service",
        description="answer next_goal and get_pose",
        epilog="example: holozen pose-service --shape hexagon --size 2",
    )
    parser.add_argument("--shape", choices=SHAPES, default="square", help="the goals' shape (default: square)")
    parser.add_argument(
        "--size",
        type=number(*SIZES, "m"),
        default=1.0,
        help="side length of the shape in metres (for infinity: half its length; default: 1)",
    )
    parser.add_argument(
        "--goals", type=Path, metavar="FILE", help="read goals from a file instead, one x y theta per line"
    )
    connection.add_arguments(parser)
    return parser


def main(argv: list[str] | None = None) -> int:
    args = parser().parse_args(argv)
    stop = stop_event()
    try:
        route = Route(args.shape, args.size, args.goals)
        with Bus("pose_service", connection.from_arguments(args), lasting=True, stop=stop) as bus:
            tracker = Tracker(bus.subscribe("**/odom", Odometry, depth=256, limit=MAX_ODOM_BYTES))
            bus.serve("get_pose", GetPoseRequest, GetPoseReply, tracker.get_pose).start()
            bus.serve("next_goal", NextGoalRequest, NextGoalReply, lambda asked: next_goal(route.goals, asked)).start()
            Parameters(bus, "pose_service", route.declared).start()
            warn_of_twin(bus, "pose_service")
            report(f"pose_service: {len(route.goals)} goals from {args.goals or args.shape}")
            wait_for_end(stop)
    except (BusError, GoalsError) as error:
        report(f"pose_service: {error}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
