"""The robots that pages drive: their helms, and the commands and goals that are published for
them.
"""

import threading
import time
from collections.abc import Callable, Collection
from functools import cached_property
from typing import TypeVar

from holozen.bus import Bus, Publisher
from holozen.console import report
from holozen.limits import STOP, Planar
from holozen.messages import (
    CommandStatus,
    Header,
    Odometry,
    Point,
    Pose,
    PoseStamped,
    SceneEntity,
    Twist,
)
from holozen.odometry import RobotFeedback
from holozen.rotation import Transform
from holozen.wire import PRIORITY_OF, key_for

from .helm import LOST, RESET, STOPPED, Helm
from .instances import difference

T = TypeVar("T")

TICK = 0.02  # s
REPEAT = 0.05  # s after which a stop is repeated
PATIENCE = 2.0  # s to hear a controller before the first goal
NEAR = 0.2  # m, and in a quaternion; nearer odometry is taken for the true pose, at another moment
# m/s and rad/s; the least and the most that a page may choose
SPEEDS, TURNS = ((0.05, 2.0), (0.1, 3.0))


class Driver:
    """Drives one robot, given by the keys of its commands and its odometry."""

    def __init__(self, bus: Bus, command: str, odometry: str) -> None:
        self.namespace = command.rpartition("/")[0]
        self._bus, self.command = bus, command
        self._status = bus.latest(f"{command}_status", CommandStatus)
        self.odom = RobotFeedback(bus, odometry, self._status)
        self._beats = bus.echoes(command)
        self._helm, self._lock = Helm(), threading.Lock()
        self._echo = b""  # the beats that the last page that drove had heard
        self._sent_at: float | None = None  # s; of the last command
        self._fault = ""  # the last that was reported

    @cached_property
    def _commands(self) -> Publisher[Twist]:
        """The publisher of commands, declared with the first one: a page that only looks is no
        publisher.
        """
        commands = self._bus.publisher(self.command, Twist, PRIORITY_OF["view"])
        if commands.echoes:
            commands.echoes.settle(0.0)  # its thread drives other robots too
        return commands

    def beats(self) -> bytes:
        """The newest beats of those who obey its commands, for a page to echo; empty without
        any.
        """
        return self._beats.attached()

    @property
    def waiting(self) -> str:
        """The robots of which no beat was heard yet; commands are not sent so long."""
        return self._beats.awaited

    @property
    def page(self) -> int | None:
        """The page that drives it; None if none does."""
        return self._helm.page

    def use(self, act: Callable[[Helm, float], T]) -> T:
        """Call `act` with its helm and the present time (s), and return the result."""
        with self._lock:
            return act(self._helm, time.monotonic())

    def hold(self, page: int, press: int, motion: Planar, echo: bytes) -> None:
        """A page holds this velocity (m/s, rad/s), and had heard these beats of the robot: command
        it, if it counts.
        """
        with self._lock:
            now = time.monotonic()
            if self._helm.hold(page, press, motion, now):
                self._echo = echo
                self._put(motion, now)

    def let_go(self, page: int, press: int, echo: bytes) -> None:
        """A page has let go: stop, if it drove."""
        with self._lock:
            now = time.monotonic()
            if self._helm.let_go(page, press, now):
                self._echo = echo or self._echo
                self._put(STOP, now)

    def stop(self) -> None:
        """Let go of all that is held, and command zero at once, as far as this page has a
        publisher: unlike the service `stop`, that needs no answer.
        """
        with self._lock:
            now = time.monotonic()
            self._helm.stop(now, STOPPED)
            if "_commands" in vars(self):
                self._put(STOP, now)

    def _put(self, motion: Planar, now: float) -> None:
        # A stop goes with the page's last echo too: with a newer one, the page's next command would
        # come out of order.
        self._commands.put(Twist.planar(*motion), echoed=self._echo)
        self._sent_at = now

    def keep(self) -> bool:
        """Stop the robot if nobody is heard to hold it any more, and repeat a stop until it rests.
        Returns whether anything is held, or a stop is in progress.
        """
        with self._lock:
            now = time.monotonic()
            if self.odom.poll_removed() or self.odom.is_lost:
                self._helm.stop(now, LOST)
            if self.odom.poll_reset():
                self._helm.stop(now, RESET)
            self._helm.expire(now)
            since = self._helm.stopping_since(now)
            if since is None:
                return self._helm.motion is not None
            if self.odom.rests(since):
                self._helm.rest()
                return False
            last = self._sent_at
            if last is None or last < since or now - last >= REPEAT:
                self._put(STOP, now)
            return True

    def try_keep(self) -> bool:
        """As `keep`, but a fault of this robot is reported and lets go of it: others drive on."""
        try:
            return self.keep()
        except Exception as error:
            fault = f"{self.command} cannot be driven: {error}"
            if fault != self._fault:
                report(f"view: {fault}")
            self._fault = fault
            self.use(lambda helm, now: helm.stop(now, fault))
            return self.is_used()

    def is_used(self) -> bool:
        """Whether a page holds it, or a stop is in progress."""
        return self.use(
            lambda helm, now: helm.motion is not None or helm.stopping_since(now) is not None
        )

    def close(self) -> None:
        """Close its subscriptions and publishers."""
        made = (vars(self).get(name) for name in ("_commands", "_goals"))
        for end in (self.odom, self._status, self._beats, *filter(None, made)):
            end.close()

    def _current(self) -> Odometry | None:
        """Its odometry; None if that is stale."""
        odom, age = self.odom.read()
        return None if age > self.odom.stale_after else odom

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
        goals = self._bus.publisher(key_for("goal_pose", self.namespace), PoseStamped)
        if goals.echoes:
            # a click waits in a thread of its own; then it is known whether a controller subscribes
            goals.echoes.settle(PATIENCE)
        return goals

    def send_to(self, x: float, y: float, true_pose: Pose) -> str:
        """Send its controller to a point of the world (m); the robot keeps its heading. Returns a
        line with the outcome. `true_pose` is the robot's present pose in the world.
        """
        odom = self._current()
        if odom is None:
            return "it has no odometry now"
        if not self._goals.matched:
            command = " ".join(filter(None, ("holozen controller", self.namespace, "--laps 0")))
            return f"it has no controller; `{command}` starts one"
        if echoes := self._goals.echoes:
            echoes.settle(PATIENCE)  # one may have come since
            if not echoes.may_command():
                return "its controller was not heard yet; try it again in a moment"
        goal = in_odometry((x, y, true_pose.position.z), true_pose, odom.pose.pose)
        frame = odom.header.frame_id
        self._goals.put(
            PoseStamped(Header(frame_id=frame), Pose(Point(*goal), odom.pose.pose.orientation))
        )
        return f"goal {x:.2f} {y:.2f}" + (
            "; the controller may not drive yet" if self.status().held else ""
        )


class Drivers:
    """The drivers of all robots that are chosen in any page, and the thread that publishes their
    commands.
    """

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
        """Close all drivers that are not `chosen`, once they are at rest."""
        with self._lock:
            unused = [
                keys for keys, one in self._all.items() if one not in chosen and not one.is_used()
            ]
            dropped = [self._all.pop(keys) for keys in unused]
        for driver in dropped:
            driver.close()

    def close(self, page: int) -> None:
        """A page is gone: stop the robots that it drives."""
        with self._lock:
            for driver in self._all.values():
                driver.use(lambda helm, now: helm.close(page, now))

    def halt(self) -> None:
        """Stop the robots that are driven from here, until odom shows rest, for at most a
        second.
        """
        self._stop.set()
        self._thread.join()
        with self._lock:  # pages are still open
            drivers = list(self._all.values())
        for driver in drivers:
            driver.use(lambda helm, now: helm.end(now))
        while sum(driver.try_keep() for driver in drivers):  # calls them all, unlike any()
            time.sleep(TICK)

    def _run(self) -> None:
        while not self._stop.wait(TICK):
            with self._lock:
                drivers = list(self._all.values())
            for driver in drivers:
                driver.try_keep()


def in_odometry(
    point: tuple[float, float, float], true_pose: Pose, odometry: Pose
) -> tuple[float, float, float]:
    """A point of the world (m) in the frame of a robot's odometry, which may have begun elsewhere,
    and may drift.
    """
    true, measured = (
        Transform.of(pose.position, pose.orientation) for pose in (true_pose, odometry)
    )
    if difference(true, measured) < NEAR:
        return point
    return (measured @ true.inverse()).apply(point)
