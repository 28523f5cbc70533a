"""`holozen plot` and `map`: draw fields of live messages, and robots seen from above, in the
terminal.
"""

from __future__ import annotations

import argparse
import json
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from functools import partial

from holozen.bus import Bus
from holozen.cli.hints import suggest_key
from holozen.cli.verb import Verb, by_name, open_bus
from holozen.console import Failure, Screen, printable, report
from holozen.field_lines import Field, Lines
from holozen.fields import path
from holozen.flags import add_packages, number
from holozen.output import SampleReader
from holozen.plotting import Plane, Point, Robot, draw, panels
from holozen.process import stop_event
from holozen.transport.errors import ServiceError

TICK = 0.02  # s between two polls
TRAIL = 2000  # points
STEP = 0.02  # m between two points of a trail
ASK_EVERY = 2.0  # s between two requests to the sim and the pose service
MAX_GOALS = 100
MAX_PLACES = 12  # robots whose places are written out
PATIENCE = 1.0  # s for a service to answer


def plot(args: argparse.Namespace) -> int:
    """Draw the fields of `args`, or print them as JSON, until interrupted."""
    stop = stop_event()
    with open_bus(args, stop=stop) as bus:
        lines = Lines(bus, args.fields, SampleReader(packages=args.package))
        keys = [key for _, key, _ in args.fields]
        hint = "" if args.once else suggest_key(bus, keys)
        waiting = f"waiting for {', '.join(dict.fromkeys(keys))}{hint}" if hint else ""
        if hint:
            report(f"holozen {args.verb}: {waiting}")
        try:
            _print_rows(lines, args, stop) if args.json else _draw(lines, args, stop, waiting)
        except LookupError as error:
            raise Failure(error.args[0]) from None
        if lines.bad:
            report(f"holozen {args.verb}: {lines.bad} messages could not be read")
        if any(lines.points.values()):
            return 0
        hint = suggest_key(bus, keys) or "; `holozen topic list` shows the topics"
        raise Failure(f"no messages on {', '.join(dict.fromkeys(keys))}{hint}")


def _print_rows(lines: Lines, args: argparse.Namespace, stop: threading.Event) -> None:
    end = time.monotonic() + args.window if args.once else float("inf")
    while time.monotonic() < end and not stop.wait(TICK):
        for row in lines.take():
            print(json.dumps({"time": round(time.time(), 4)} | row), flush=True)


def _draw(lines: Lines, args: argparse.Namespace, stop: threading.Event, waiting: str) -> None:
    """Draw until interrupted. `waiting` is shown until there is a first point: the screen hides
    earlier lines.
    """
    picture: list[str] = []
    with Screen(args.once, args.ascii) as screen:
        for now in _due(screen, lines.take, args.window if args.once else 0.0, stop):
            picture = [
                printable(line)
                for line in panels(lines.points, now, args.window, screen.size, screen.ascii)
            ]
            if args.once:
                break
            if waiting and not any(lines.points.values()):
                picture[0] = printable(waiting)[: screen.size[0]]
            screen.show(picture)
    if args.once:
        print("\n".join(line.rstrip() for line in picture), flush=True)


def _due(
    screen: Screen, take: Callable[[], object], first: float, stop: threading.Event
) -> Iterator[float]:
    """The times at which to draw, the first after `first` seconds, until `stop` is set. `take` is
    called in between.
    """
    due = time.monotonic() + first
    while not stop.wait(TICK):
        take()
        if (now := time.monotonic()) >= due:
            due = now + screen.every
            yield now


def draw_map(args: argparse.Namespace) -> int:
    """Draw the robots, or print them as JSON, until interrupted."""
    stop = stop_event()
    with open_bus(args, stop=stop) as bus:
        watcher = Watcher(bus)
        try:
            return _watch(watcher, args, stop)
        finally:
            bus.close()
            watcher.join()


def _watch(watcher: Watcher, args: argparse.Namespace, stop: threading.Event) -> int:
    single = args.once or args.json
    with Screen(single, args.ascii) as screen:
        for _ in _due(screen, watcher.take, args.wait if single else 0.0, stop):
            plane = watcher.plane()
            if args.json:
                print(json.dumps(_plane_as_json(plane)), flush=True)
            elif screen.terminal or plane.robots or plane.objects:
                screen.show([printable(line) for line in draw(plane, screen.size, screen.ascii)])
            if single:
                break
    if not (watcher.poses or watcher.objects):
        raise Failure("no robots found; `holozen up` starts one")
    return 0


def _plane_as_json(plane: Plane) -> dict[str, object]:
    robots = [
        {"name": robot.name, "x": robot.x, "y": robot.y, "yaw": robot.yaw} for robot in plane.robots
    ]
    seen = [[round(x, 3), round(y, 3)] for x, y in plane.seen]
    return {"robots": robots, "goals": plane.goals, "objects": plane.objects, "seen": seen}


class Watcher:
    """Follows the odometry of all robots and the scans of their lidars, and asks for goals and
    objects in a thread.
    """

    def __init__(self, bus: Bus) -> None:
        from holozen.messages import CommandStatus, Odometry  # while the session opens
        from holozen.scanners import Scanners

        self.poses: dict[str, tuple[float, float, float]] = {}  # x, y, yaw by a robot's name
        self.goals: list[Point] = []
        self.objects: dict[str, Point] = {}
        self._graph, self._scanners = bus.graph(), Scanners(bus)
        self._ends = self._graph.settled(bus.connected)
        self._bus, self._odom = bus, bus.subscribe("**/odom", Odometry, depth=1024)
        self._trails: dict[str, deque[Point]] = {}
        # knows the name of the robot at the root
        self._status = bus.latest("cmd_vel_status", CommandStatus)
        self._ended = threading.Event()
        self._asking = threading.Thread(target=self._ask, daemon=True)
        self._asking.start()

    def take(self) -> None:
        """Take in the odometry and scans that wait."""
        self._ends = self._graph.endpoints()
        self._scanners.update(self._graph)
        while (received := self._odom.try_recv()) is not None:
            if received.message is not None:
                name = received.key.removesuffix("odom").removesuffix("/")
                self._move(name, *received.message.pose.pose.planar())

    def plane(self) -> Plane:
        """The current state to draw."""
        status = self._status.read()[0]
        root = status.name if status else ""
        robots = [
            Robot(name or root, x, y, yaw, [*self._trails[name], (x, y)])
            for name, (x, y, yaw) in sorted(self.poses.items())
        ]
        others = {
            name: at for name, at in self.objects.items() if name not in self.poses and name != root
        }
        first = ", ".join(map(_place, robots[:MAX_PLACES]))
        more = f" and {len(robots) - MAX_PLACES} more" if len(robots) > MAX_PLACES else ""
        return Plane(robots, self.goals, others, first + more, self._scanners.points)

    def join(self) -> None:
        """Wait for the polling thread once the bus is closed: no thread may be inside Zenoh at
        exit.
        """
        self._ended.set()
        self._asking.join(ASK_EVERY + PATIENCE)

    def _move(self, name: str, x: float, y: float, yaw: float) -> None:
        trail = self._trails.setdefault(name, deque(maxlen=TRAIL))
        if not trail or abs(trail[-1][0] - x) + abs(trail[-1][1] - y) > STEP:
            trail.append((x, y))
        self.poses[name] = x, y, yaw

    def _ask(self) -> None:
        while not self._ended.is_set():
            try:
                self.goals = self._ask_goals()
                self.objects = self._ask_objects()
            except ServiceError:
                pass  # there is no server at the moment
            except Exception:  # the bus was closed
                return
            self._ended.wait(ASK_EVERY)

    def _ask_goals(self) -> list[Point]:
        """All goals of all next_goal services."""
        served = {end.key for end in self._ends if end.kind == "srv"}
        keys = [key for key in sorted(served) if key.rpartition("/")[2] == "next_goal"]
        return [goal for key in keys for goal in self._goals_of(key)]

    def _goals_of(self, key: str) -> Iterator[Point]:
        from holozen.messages import NextGoalReply, NextGoalRequest

        for index in range(MAX_GOALS):
            reply = self._bus.call(key, NextGoalRequest(index), NextGoalReply, PATIENCE)
            yield reply.x_goal, reply.y_goal
            if reply.end_of_list:
                return

    def _ask_objects(self) -> dict[str, Point]:
        from holozen.messages import GetSceneReply, GetSceneRequest

        scenes = self._bus.call_all("get_scene", GetSceneRequest(), GetSceneReply, PATIENCE)
        entities = [entity for scene in scenes for entity in scene.entities]
        return {
            entity.name: (entity.pose.position.x, entity.pose.position.y) for entity in entities
        }


def _place(robot: Robot) -> str:
    return f"{robot.name or 'robot'} x {robot.x:.2f} y {robot.y:.2f}"


def _plot_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add(
        "fields",
        nargs="+",
        type=chosen_field,
        metavar="KEY.FIELD",
        help="such as joint_states.position[0]",
    )
    seconds = number(0.1, 3600, "s")
    add(
        "-w",
        "--window",
        type=seconds,
        default=10.0,
        metavar="S",
        help="seconds shown (default: 10)",
    )
    add(
        "--once",
        action="store_true",
        help="watch for one window, print one picture (or its numbers) and end",
    )
    add_packages(parser)
    add("--ascii", action="store_true", help="without braille")


def chosen_field(text: str) -> Field:
    """The field that KEY.FIELD names. Raises ArgumentTypeError, with what was probably meant."""
    start = text.rpartition("/")[2]
    name, _, rest = start.partition(".")
    key = text[: len(text) - len(start)] + name
    if not (name and rest):
        raise argparse.ArgumentTypeError(f"{text!r}: write KEY.FIELD, such as {_example(text)}")
    try:
        return text, key.removeprefix("/"), path(rest)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


_FIELDS = {
    "odom": "twist.twist.linear.x",
    "cmd_vel": "linear.x",
    "joint_states": "position[0]",
    "imu": "angular_velocity.z",
    "scan": "ranges[0]",
}
"""A field to plot of each key."""


def _example(text: str) -> str:
    """A field of the key that `text` may mean: of `a/odom/twist` one of `a/odom`."""
    parts = text.strip("/").split("/")
    for count in range(len(parts), 0, -1):
        if field := _FIELDS.get(parts[count - 1]):
            return f"{'/'.join(parts[:count])}.{field}"
    return f"odom.{_FIELDS['odom']}"


def _map_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--once", action="store_true", help="print one picture and end")
    add(
        "-w",
        "--wait",
        type=number(0.1, 3600, "s"),
        default=1.0,
        metavar="S",
        help="with --once or --json: watch for S seconds first (default: 1)",
    )
    add("--ascii", action="store_true", help="without braille")


_PLOT = partial(
    Verb,
    about="draw fields of live messages in the terminal, until Ctrl-C",
    example="odom.twist.twist.linear.x cmd_vel.linear.x",
    arguments=_plot_arguments,
    run=plot,
    json="print the numbers as they arrive as JSON, one object per line",
)
ABOUT_MAP = (
    "draw the robots, their paths, their goals and what their lidars see in the terminal, "
    "until Ctrl-C"
)
NOTES_MAP = (
    "East is x, north is y. Positions are those of odom: with encoders, relative to where "
    "a robot started."
)
VERBS = by_name(
    _PLOT("plot"),
    _PLOT("topic plot"),
    Verb(
        "map",
        ABOUT_MAP,
        "--once",
        _map_arguments,
        draw_map,
        "print what a picture would show as JSON, one object per line",
        NOTES_MAP,
    ),
)
