"""A robot in the world: what it is, what it obeys, and what it publishes."""

import time
from collections.abc import Callable

from holozen.bus import Bus
from holozen.command.motion import AppliedForces, JointMotion
from holozen.limits import STOP
from holozen.messages import CommandStatus

from .actuators import Actuators
from .commands import CommandRules, Commands
from .identity import Identity
from .io.sensor_topics import Surroundings
from .link_states import LinkStates
from .obstacles import monitor_for
from .physics.body import Body
from .physics.movers import Mover
from .telemetry import Telemetry


class Robot:
    """A robot with a drive, with joints, or with both.

    Attributes:
        identity: What it is called, and its model.
        actuators: What it is: a body, and what moves that.
        commands: What it obeys.
        telemetry: What it publishes.
        monitor: What slows it down near obstacles; None if it sees none.
        woken: Called when an event may have changed how it moves.
    """

    def __init__(
        self,
        bus: Bus,
        identity: Identity,
        mover: Mover,
        rules: CommandRules,
        around: Surroundings,
        phase: float,
        keep_stop: Callable[[], str],
    ) -> None:
        """`phase` is that of its telemetry. `keep_stop` is called at each stop and release, and
        returns why that is not kept, or "".
        """
        self.identity = identity
        self._rules, self._keep_stop = rules, keep_stop
        self.woken: Callable[[], None] = lambda: None
        self.actuators = Actuators(identity, mover)
        self.commands = Commands(bus, identity, self.actuators, rules, self._confirm_stop)
        self.monitor = monitor_for(identity)
        self.telemetry = Telemetry(bus, identity, self.actuators, around, phase, self.monitor)
        self.commands.report_news(self.publish_wanted_status)
        self.commands.arbiters.base.changed = self._wake
        self.body.woken = self._wake

    @property
    def body(self) -> Body:
        """Its body."""
        return self.actuators.body

    def link_states(self) -> LinkStates:
        """The states of its links."""
        return self.actuators.link_states()

    def _wake(self) -> None:
        self.woken()

    def _confirm_stop(self, now: float) -> str:
        """Make a stop or a release at `now` (s) known. Returns why it is not kept, or ""."""
        self._rules.senders.beat_now()
        self.publish_status(now)
        return self._keep_stop()

    def rebuild(self, mover: Mover) -> None:
        """Go on with a new body, which stands. Keys, held sources and the software stop remain."""
        self.actuators.install(mover)
        self.body.woken = self._wake
        self.telemetry.start()
        self._wake()

    def reset(self) -> None:
        """The world was reset: only new commands move it, and what it publishes is due at once."""
        self.commands.arbiters.begin(time.monotonic())
        if self.monitor:
            self.monitor.forget()
        self.telemetry.reset()

    def slow_down_at(self, seconds: float) -> None:
        """Slow down that long (s) before a collision from now on; 0: no longer."""
        if self.monitor:
            self.monitor.set_time(seconds)
            self._wake()

    def move(self, now: float, dt: float) -> float:
        """Apply the commands at `now` (s) to the next step of `dt` seconds. Returns until when (s)
        it goes on so by itself, if it glides and nothing happens.
        """
        actuators, arbiters = self.actuators, self.commands.arbiters
        until = self._move_base(now, dt) if self.identity.drives else now
        if actuators.has_forces:
            actuators.push_links(self.commands.forces.pushes(now))
        if actuators.joints:
            joints = arbiters.joints.motion(now).value
            actuators.move_joints(joints if isinstance(joints, JointMotion) else None)
        actuators.mimic()
        return until

    def _move_base(self, now: float, dt: float) -> float:
        base = self.commands.arbiters.base
        motion, until = base.motion(now)
        if self.monitor and self.monitor.seconds:
            until = now  # what is near may limit it otherwise at any step
            limited = self.monitor.limit(motion if isinstance(motion, tuple) else STOP, dt)
            motion = limited if isinstance(motion, tuple) else motion
        if isinstance(motion, JointMotion):
            self.actuators.turn_wheels(motion, dt)
            return now
        if isinstance(motion, AppliedForces):
            self.actuators.push_base(base.pushes(now) or [], dt)
            return now
        return until if self.actuators.drive(motion, dt) else now

    def status(self, now: float) -> CommandStatus:
        """The status of its commands at `now` (s)."""
        status = self.commands.status(now)
        if self.monitor:
            status.time_before_collision = self.monitor.seconds
            status.limited = self.monitor.reason
        return status

    def publish_status(self, now: float) -> None:
        """Publish the status of its commands at `now` (s)."""
        self.telemetry.publish_status(self.status(now))

    def publish_wanted_status(self, now: float) -> None:
        """Publish it if anyone wants it."""
        if self.telemetry.poll_status_wanted():
            self.publish_status(now)

    def close(self) -> None:
        """Close its keys. Its arbiters are then for the next robot of that name to inherit."""
        self.commands.close()
        self.telemetry.close()
