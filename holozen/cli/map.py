"""`holozen map`: where the robots are, in the terminal."""

import argparse
import json
import threading
import time
from collections import deque
from collections.abc import Iterator

from holozen import connection
from holozen.bus import Bus
from holozen.errors import ServiceError
from holozen.flags import Parser, number
from holozen.floorplan import Plane, Point, Robot, draw
from holozen.process import stop_event
from holozen.tell import printable, say

TRAIL = 2000  # points
STEP = 0.02  # m between two points of a trail
ASK_EVERY = 2.0  # s between two questions to the sim and the pose service
MOST_GOALS = 100
NEAR, FAR = 0.15, 1e9  # m
PATIENCE = 1.0  # s for a service to answer
TICK = 0.02  # s


def parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="holozen map",
        description="Draw the robots, their ways and their goals in the terminal, until Ctrl-C. East is x, north is y. "
        "Robots stand where their odom says: with encoders, that is seen from where they started.",
        epilog="example: holozen map --once",
    )
    parser.add_argument("--once", action="store_true", help="print one picture and end")
    parser.add_argument("-w", "--wait", type=number(0.1, 3600, "s"), default=1.0, metavar="S",
        help="with --once or --json: watch for S seconds first (default: 1)")  # fmt: skip
    parser.add_argument("--ascii", action="store_true", help="without braille")
    parser.add_argument("--json", action="store_true", help="what a picture would show, as one JSON object")
    connection.add_arguments(parser)
    return parser


def main(argv: list[str]) -> int:
    args = parser().parse_args(argv)
    stop = stop_event()
    with Bus("map", connection.from_arguments(args), patience=3.0, stop=stop) as bus:
        watcher = Watcher(bus)
        try:
            return _watch(watcher, args, stop)
        finally:
            bus.close()
            watcher.join()


def _watch(watcher: "Watcher", args: argparse.Namespace, stop: threading.Event) -> int:
    from holozen.cli.screen import Screen

    single = args.once or args.json
    due = time.monotonic() + (args.wait if single else 0.0)
    with Screen(single, args.ascii) as screen:
        while not stop.wait(TICK):
            watcher.take()
            if (now := time.monotonic()) < due:
                continue
            due = now + screen.every
            plane = watcher.plane()
            if args.json:
                print(json.dumps(_told(plane)), flush=True)
            elif screen.terminal or plane.robots or plane.objects:
                screen.show([printable(line) for line in draw(plane, screen.size, screen.ascii)])
            if single:
                break
    if not (watcher.poses or watcher.objects):
        say("holozen map: no robot is there; `holozen up` starts one")
        return 1
    return 0


def _told(plane: Plane) -> dict[str, object]:
    robots = [{"name": one.name, "x": one.x, "y": one.y, "yaw": one.yaw} for one in plane.robots]
    return {"robots": robots, "goals": plane.goals, "objects": plane.objects}


class Watcher:
    """Follows the odom of all robots, and asks the services now and then, in a thread of its own."""

    def __init__(self, bus: Bus) -> None:
        from holozen.messages import Odometry

        self.poses: dict[str, tuple[float, float, float]] = {}  # x, y, yaw by a robot's name
        self.goals: list[Point] = []
        self.objects: dict[str, Point] = {}
        self._graph = bus.graph()
        self._bus, self._odom = bus, bus.subscribe("**/odom", Odometry, depth=1024)
        self._trails: dict[str, deque[Point]] = {}
        self._moved, self._ended = threading.Event(), threading.Event()
        self._asking = threading.Thread(target=self._ask, daemon=True)
        self._asking.start()

    def take(self) -> None:
        """Take in the odom that came."""
        while (received := self._odom.try_recv()) is not None:
            if received.message is not None:
                name = received.sample.key.removesuffix("odom").removesuffix("/")
                at = received.message.pose.pose
                self._move(name, at.position.x, at.position.y, at.orientation.yaw())

    def plane(self) -> Plane:
        """What is known now."""
        robots = [
            Robot(name, x, y, yaw, [*self._trails[name], (x, y)]) for name, (x, y, yaw) in sorted(self.poses.items())
        ]
        others = {name: at for name, at in self.objects.items() if name not in self.poses}
        return Plane(robots, self.goals, others, ", ".join(map(_place, robots)))

    def join(self) -> None:
        """Wait for the thread that asks, once the bus is closed: none may be inside Zenoh at the end."""
        self._ended.set()
        self._asking.join(ASK_EVERY + PATIENCE)

    def _move(self, name: str, x: float, y: float, yaw: float) -> None:
        trail = self._trails.setdefault(name, deque(maxlen=TRAIL))
        if not trail or abs(trail[-1][0] - x) + abs(trail[-1][1] - y) > STEP:
            trail.append((x, y))
        self.poses[name] = x, y, yaw
        self._moved.set()

    def _ask(self) -> None:
        self._moved.wait(PATIENCE)  # objects are told from the robot at the root by where that is
        while not self._ended.is_set():
            try:
                self.goals = self._ask_goals()
                self.objects = self._ask_objects()
            except ServiceError:
                pass  # nobody serves it, now
            except Exception:  # the bus was closed
                return
            self._ended.wait(ASK_EVERY)

    def _ask_goals(self) -> list[Point]:
        """All goals of all services called next_goal."""
        served = {one.key for one in self._graph.endpoints() if one.kind == "srv"}
        keys = [key for key in sorted(served) if key.rpartition("/")[2] == "next_goal"]
        return [goal for key in keys for goal in self._goals_of(key)]

    def _goals_of(self, key: str) -> Iterator[Point]:
        from holozen.messages import NextGoalReply, NextGoalRequest

        for index in range(MOST_GOALS):
            reply = self._bus.call(key, NextGoalRequest(index), NextGoalReply, PATIENCE)
            yield reply.x_goal, reply.y_goal
            if reply.end_of_list:
                return

    def _ask_objects(self) -> dict[str, Point]:
        from holozen import entities

        found = {}
        for name in entities.names(self._bus):
            at = entities.pose(self._bus, name).position
            # The robot at the root has a name in the sim, but none on its keys; it stands where its odom says.
            x, y, _ = self.poses.get("", (FAR, FAR, 0.0))
            if abs(at.x - x) + abs(at.y - y) > NEAR:
                found[name] = at.x, at.y
        return found


def _place(robot: Robot) -> str:
    return f"{robot.name or 'robot'} x {robot.x:.2f} y {robot.y:.2f}"
