"""The robots that pages drive: their pads, and the commands and goals that are published for them."""

import math
import threading
import time
from collections.abc import Callable, Collection
from functools import cached_property
from typing import TypeVar

from holozen.bus import Bus, Publisher
from holozen.limits import Planar
from holozen.messages import CommandStatus, Header, Odometry, Point, Pose, PoseStamped, SceneEntity, Twist
from holozen.odometry import RobotFeedback
from holozen.rotation import Transform
from holozen.wire import PRIORITY_OF, key_for

from .instances import difference
from .pad import LOST, RESET, Pad

T = TypeVar("T")

TICK = 0.02  # s
REPEAT = 0.05  # s after which a command is repeated
NEAR = 0.2  # m, and in a quaternion; nearer odometry is taken for the true pose, at another moment
SPEED, TURN = 0.5, 1.0  # m/s and rad/s at first, as in teleop_twist_keyboard


class Driver:
    """Drives one robot, given by the keys of its commands and its odometry."""

    def __init__(self, bus: Bus, command: str, odometry: str) -> None:
        self.namespace = command.rpartition("/")[0]
        self._bus, self._command = bus, command
        self._odom = RobotFeedback(bus, odometry)
        self._status = bus.latest(f"{command}_status", CommandStatus)
        self._pad, self._lock = Pad(), threading.Lock()
        self._speeds = (SPEED, TURN)
        self._sent: Planar | None = None
        self._sent_at = -math.inf

    @cached_property
    def _commands(self) -> Publisher[Twist]:
        """The publisher of commands, declared with the first one: a page that only looks is no publisher."""
        return self._bus.publisher(self._command, Twist, PRIORITY_OF["view"])

    def use(self, act: Callable[[Pad, float], T]) -> T:
        """Call `act` with its pad and the present time (s), and return the result."""
        with self._lock:
            return act(self._pad, time.monotonic())

    def hold(self, page: int, button: str, speeds: tuple[float, float]) -> str:
        """A page reports a held button, and its speeds (m/s, rad/s). Returns why that does not count, or ""."""
        with self._lock:
            why = self._pad.hold(page, button, time.monotonic())
            if not why:
                self._speeds = speeds
            return why

    def publish(self) -> bool:
        """Publish what is due. Returns whether the pad is in use."""
        with self._lock:
            now = time.monotonic()
            if self._odom.was_removed() or self._odom.is_lost:
                self._pad.stop(now, LOST)
            if self._odom.was_reset():
                self._pad.stop(now, RESET)
            since = self._pad.stopping_since(now)
            motion = self._pad.command(now, since is not None and self._odom.rests(since))
            if motion is not None and (motion != self._sent or now - self._sent_at >= REPEAT):
                x, y, turn = motion
                speed, rate = self._speeds
                self._commands.put(Twist.planar(speed * x, speed * y, rate * turn))
                self._sent_at = now
            self._sent = motion
            return motion is not None

    def is_used(self) -> bool:
        """Whether a button of its pad is held, or a stop is in progress."""
        return self.use(lambda pad, now: pad.command(now, False)) is not None

    def close(self) -> None:
        """Close its subscriptions and publishers."""
        made = (vars(self).get(name) for name in ("_commands", "_goals"))
        for end in (self._odom, self._status, *filter(None, made)):
            end.close()

    def _current(self) -> Odometry | None:
        """Its odometry; None if that is stale."""
        odom, age = self._odom.read()
        return None if age > self._odom.stale_after else odom

    def status(self) -> CommandStatus:
        """The sim's last command status; empty if it is outdated."""
        status, age = self._status.read()
        return status if status and age < 1.0 else CommandStatus()

    def measured(self) -> Planar | None:
        """Its measured velocity in m/s and rad/s, in the body frame; None if not known."""
        odom = self._current()
        if odom is None:
            return None
        twist = odom.twist.twist
        return twist.linear.x, twist.linear.y, twist.angular.z

    @cached_property
    def _goals(self) -> Publisher[PoseStamped]:
        return self._bus.publisher(key_for("goal_pose", self.namespace), PoseStamped)

    def send_to(self, x: float, y: float, true_pose: Pose) -> str:
        """Send its controller to a point of the world (m); the robot keeps its heading. Returns a line with the
        outcome. `true_pose` is the robot's present pose in the world.
        """
        odom = self._current()
        if odom is None:
            return "it has no odometry now"
        if not self._goals.matched:
            command = " ".join(filter(None, ("holozen controller", self.namespace, "--laps 0")))
            return f"it has no controller; start one: {command}"
        goal = in_odometry((x, y, true_pose.position.z), true_pose, odom.pose.pose)
        frame = odom.header.frame_id
        self._goals.put(PoseStamped(Header(frame_id=frame), Pose(Point(*goal), odom.pose.pose.orientation)))
        return f"goal {x:.2f} {y:.2f}" + ("; the controller waits for Resume" if self.status().held else "")


class Drivers:
    """The drivers of all robots that are chosen in any page, and the thread that publishes their commands."""

    def __init__(self, bus: Bus) -> None:
        self._bus, self._stop = bus, threading.Event()
        self._all: dict[tuple[str, str], Driver] = {}
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def of(self, entity: SceneEntity) -> Driver:
        """The driver of a robot that takes commands."""
        keys = entity.command, entity.odometry or key_for("odom", entity.command.rpartition("/")[0])
        with self._lock:
            if keys not in self._all:
                self._all[keys] = Driver(self._bus, *keys)
            return self._all[keys]

    def keep(self, chosen: Collection[Driver | None]) -> None:
        """Close all drivers that are not `chosen`, once their pads are at rest."""
        with self._lock:
            unused = [keys for keys, one in self._all.items() if one not in chosen and not one.is_used()]
            dropped = [self._all.pop(keys) for keys in unused]
        for driver in dropped:
            driver.close()

    def close(self, page: int) -> None:
        """A page is gone: stop the robots that it drives."""
        with self._lock:
            for driver in self._all.values():
                driver.use(lambda pad, now: pad.close(page, now))

    def halt(self) -> None:
        """Stop the robots that are driven from here, until odom shows rest, for at most a second."""
        self._stop.set()
        self._thread.join()
        with self._lock:  # pages are still open
            drivers = list(self._all.values())
        for driver in drivers:
            driver.use(lambda pad, now: pad.end(now))
        while sum(driver.publish() for driver in drivers):  # calls them all, unlike any()
            time.sleep(TICK)

    def _run(self) -> None:
        while not self._stop.wait(TICK):
            with self._lock:
                drivers = list(self._all.values())
            for driver in drivers:
                driver.publish()


def in_odometry(point: tuple[float, float, float], true_pose: Pose, odometry: Pose) -> tuple[float, float, float]:
    """A point of the world (m) in the frame of a robot's odometry, which may have begun elsewhere, and may drift."""
    true, measured = (Transform.of(pose.position, pose.orientation) for pose in (true_pose, odometry))
    if difference(true, measured) < NEAR:
        return point
    return (measured @ true.inverse()).apply(point)
