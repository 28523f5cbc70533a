"""The pose service: answers next_goal and get_pose."""

import argparse
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

from holozen.bus import Bus
from holozen.console import report
from holozen.flags import Parser, add_json, number
from holozen.messages import GetPoseReply, GetPoseRequest, NextGoalReply, NextGoalRequest, Odometry
from holozen.process import stop_event, wait_for_end
from holozen.transport import connection
from holozen.transport.errors import BusError, ServiceError
from holozen.transport.parameters import Choice, Number, Parameter, Parameters, warn_of_twin
from holozen.transport.pubsub import Arrivals, Subscription
from holozen.transport.samples import until_closed
from holozen.wire import ODOM_SILENCE, key_for, robot_name

from .shapes import SHAPES, Goal, GoalsError, read_goals

SIZES = (0.01, 1000.0)  # m
MAX_ROBOTS = 1000  # whose names come over the wire; beyond, the one with the oldest odom is dropped
MAX_NAMES = 50  # in one reply
MAX_ODOM_BYTES = 65_536  # larger payloads are not read


def next_goal(goals: list[Goal], request: NextGoalRequest) -> NextGoalReply:
    """The goal with the requested number, counted from 0. Raises ServiceError if the list has no
    such goal.
    """
    number = request.request_goal
    if not 0 <= number < len(goals):
        raise ServiceError(f"goal {number}: the list holds goals 0 to {len(goals) - 1}")
    x, y, theta = goals[number]
    return NextGoalReply(x, y, theta, int(number == len(goals) - 1))


class Route:
    """The goals of a `file`, or else of a `shape` of `size` metres. Raises GoalsError for a file
    that is wrong.
    """

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
            "shape",
            "the shape of the goals, from the next request on",
            tuple(SHAPES),
            lambda: self._shape,
            lambda shape: self._draw(shape, self._size),
        )
        yield Number(
            "size",
            "side length (for infinity: half its length)",
            "m",
            *SIZES,
            lambda: self._size,
            lambda size: self._draw(self._shape, size),
        )

    def _draw(self, shape: str, size: float) -> None:
        self._shape, self._size, self.goals = shape, size, SHAPES[shape](size)


class Tracker:
    """Keeps the last odom of all robots, with the time it arrived, and answers get_pose."""

    def __init__(self, odoms: Subscription[Odometry]) -> None:
        self._odoms = odoms
        self._last: dict[str, Arrivals[Odometry]] = {}  # by key, the one with the oldest odom first
        self._lock = threading.Lock()
        threading.Thread(target=self._receive, daemon=True).start()

    def get_pose(self, request: GetPoseRequest) -> GetPoseReply:
        """The last odom of a robot. Raises ServiceError for an invalid name, without odom, and if
        it is stale.
        """
        try:
            key = key_for("odom", robot_name(request.name) if request.name else "")
        except ValueError as error:
            raise ServiceError(str(error)) from None
        with self._lock:
            arrivals = self._last.get(key)
            if arrivals is None or arrivals.newest is None:
                raise ServiceError(
                    f"no {key} was received; robots with odom: {self._names() or 'none'}"
                )
            age = arrivals.age(time.monotonic())
            if age > arrivals.patience(ODOM_SILENCE):
                raise ServiceError(
                    f"{key} is stale: the last one came {age:.1f} s ago; is the sim running?"
                )
            return GetPoseReply(arrivals.newest, age)

    def _names(self) -> str:
        """The names of the robots with the most recent odom."""
        recent = list(self._last)[-MAX_NAMES:]
        return ", ".join(
            sorted(key.removesuffix("odom").rstrip("/") or "'' (at the root)" for key in recent)
        )

    def _receive(self) -> None:
        for received in until_closed(self._odoms.recv):
            if received.message is not None and received.key.count("/") < 2:
                self._record(received.key, received.message)

    def _record(self, key: str, odom: Odometry) -> None:
        with self._lock:
            arrivals = self._last.pop(key, None) or Arrivals()
            arrivals.record(odom, time.monotonic())
            self._last[key] = arrivals
            if len(self._last) > MAX_ROBOTS:
                del self._last[next(iter(self._last))]


def parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="holozen pose-service",
        description="answer next_goal and get_pose",
        epilog="example: holozen pose-service --shape hexagon --size 2",
    )
    add = parser.add_argument
    add("--shape", choices=SHAPES, default="square", help="the goals' shape (default: square)")
    add(
        "--size",
        type=number(*SIZES, "m"),
        default=1.0,
        help="side length of the shape in metres (for infinity: half its length; default: 1)",
    )
    add(
        "--goals",
        type=Path,
        metavar="FILE",
        help="read goals from a file instead, one x y theta per line",
    )
    add_json(parser)
    connection.add_arguments(parser, role="autopilot")
    return parser


def main(argv: list[str] | None = None) -> int:
    args = parser().parse_args(argv)
    stop = stop_event()
    try:
        route = Route(args.shape, args.size, args.goals)
        with Bus("pose_service", connection.from_arguments(args), lasting=True, stop=stop) as bus:
            tracker = Tracker(bus.subscribe("**/odom", Odometry, depth=256, limit=MAX_ODOM_BYTES))
            bus.serve("get_pose", GetPoseRequest, GetPoseReply, tracker.get_pose).start()
            bus.serve(
                "next_goal",
                NextGoalRequest,
                NextGoalReply,
                lambda asked: next_goal(route.goals, asked),
            ).start()
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
