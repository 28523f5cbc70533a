"""What a robot obeys: the commands and services on its keys, and who of their senders drives."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from msgspec import Struct, field

from holozen.bus import Bus
from holozen.command.arbiter import Arbiter
from holozen.command.command_time import CommandTime
from holozen.command.freshness import Senders
from holozen.command.inputs import ForceInput, JointInput, ReportLimit, TwistInput
from holozen.command.motion import is_stop
from holozen.command.stop_services import RobotServices
from holozen.command.wait_set import Reader
from holozen.messages import CommandStatus, JointState, Twist, TwistStamped, Wrench
from holozen.suggest import listed
from holozen.transport.pubsub import Subscription
from holozen.wire import COMMAND_SILENCE, MAX_COMMAND_AGE, MAX_COMMAND_BYTES, key_for

from .actuators import Actuators
from .identity import Identity

NO_DRIVE = "no drive: cmd_vel moves no wheels of this robot; publish forces on {keys}"


class CommandRules(Struct):
    """What holds for the commands of all robots of a world.

    Attributes:
        senders: What is known of the sessions that command.
        linear: Faster commands are clamped to it, in m/s.
        angular: The same in rad/s.
        max_age: Commands that may be older are refused, except stops, in s.
        time: The clock on which commands age.
        reports: The limit of reports of refused commands.
    """

    senders: Senders
    linear: float
    angular: float
    max_age: float = MAX_COMMAND_AGE
    time: CommandTime = field(default_factory=CommandTime)
    reports: ReportLimit = field(default_factory=ReportLimit)


class Arbiters(NamedTuple):
    """Who drives each part of a robot. Stops, and the ends of stops, are for all of them together.

    Attributes:
        base: Of velocities, of wheels as joints, and of forces on the base of a robot.
        joints: Of the joints that are no wheels.
        disturbances: Of forces on a robot that drives on wheels: they only disturb it.
    """

    base: Arbiter
    joints: Arbiter
    disturbances: Arbiter

    @property
    def stopped_by(self) -> str | None:
        """Who set the software stop; None while it is not set."""
        return self.base.stopped_by

    def are_moving(self, now: float) -> bool:
        """Whether any motion is commanded at `now` (s)."""
        return any(not is_stop(arbiter.motion(now).value) for arbiter in self)

    def stop(self, by: str, now: float) -> None:
        """Set the software stop."""
        for arbiter in self:
            arbiter.stop(by, now)

    def begin(self, now: float, without_watchdog: bool = True) -> None:
        """Let only commands move the robot that are sent from `now` (s) on. If its watchdog is off,
        only if `without_watchdog`.
        """
        for arbiter in self:
            arbiter.begin(now, without_watchdog)

    def forget(self, source: str, of_members: bool) -> None:
        """Stop what this source drives: its process is gone."""
        for arbiter in self:
            arbiter.forget(source, of_members)

    def settle(self, now: float) -> None:
        """The robot is removed at `now` (s)."""
        for arbiter in self:
            arbiter.settle(now)

    def inherit(self, others: Arbiters, now: float) -> None:
        """Take over held sources and the software stop at `now` (s) from the robot that was in its
        place.
        """
        for arbiter, other in zip(self, others, strict=True):
            arbiter.inherit(other, now)


class Commands:
    """The commands and services on one robot's keys.

    Attributes:
        arbiters: Who drives each part of it.
        forces: Who drives by forces: the arbiter of the base where they push that, else that of
            disturbances.
        readers: The readers of all that moves or stops it.
        request_readers: Those of its other services, and of joint commands that no joint obeys:
            they are only refused.
    """

    def __init__(
        self,
        bus: Bus,
        identity: Identity,
        actuators: Actuators,
        rules: CommandRules,
        changed: Callable[[float], str],
    ) -> None:
        """`changed` is that of RobotServices."""
        self._rules = rules
        self._of_members = bus.member is not None
        drive, namespace = identity.model.drive, identity.namespace
        timeout = drive.command_timeout if drive else COMMAND_SILENCE
        self.arbiters = Arbiters(
            base=Arbiter(timeout, rules.time, namespace),
            joints=Arbiter(time=rules.time, robot=namespace),
            disturbances=Arbiter(time=rules.time, robot=namespace),
        )
        only_disturb = identity.drives and not actuators.base_is_pushed
        self.forces = self.arbiters.disturbances if only_disturb else self.arbiters.base

        refusal = "" if identity.drives else NO_DRIVE.format(keys=listed(identity.forces))
        self._twists = TwistInput(
            identity.command_key,
            self.arbiters.base,
            rules.senders,
            rules.linear,
            rules.angular,
            others=identity.command_aliases,
            refusal=refusal,
            limit=rules.reports,
        )
        obeyed = ((actuators.wheels, self.arbiters.base), (actuators.joints, self.arbiters.joints))
        groups = [(motors.names, arbiter) for motors, arbiter in obeyed if motors]
        stats = self._twists.stats
        joint_key = key_for("joint_command", namespace)
        joints = JointInput(joint_key, rules.senders, stats, groups, actuators.mover.names)
        pushes = ForceInput(tuple(identity.forces), self.forces, rules.senders, stats)
        self._freshness = (self._twists.freshness, joints.freshness, pushes.freshness)

        subscribe = partial(bus.subscribe, limit=MAX_COMMAND_BYTES, dealt=True)
        twist_keys = self._twists.keys if drive else ()
        on_twists: list[Subscription[Twist | TwistStamped]] = [
            subscribe(key, Twist, TwistStamped) for key in twist_keys
        ]
        on_pushes: list[Subscription[Wrench]] = [subscribe(key, Wrench) for key in identity.forces]
        on_joints: Subscription[JointState] = subscribe(joint_key, JointState)
        self._subscriptions: tuple[Subscription[Any], ...] = (*on_twists, *on_pushes, on_joints)
        self._services = RobotServices(bus, identity.command_key, self.arbiters, changed)
        joint_readers = [joints.reader(on_joints)]
        moving = [*map(self._twists.reader, on_twists), *map(pushes.reader, on_pushes)]
        obeyed_joints, refused_joints = (joint_readers, []) if groups else ([], joint_readers)
        self.readers: list[Reader] = [*moving, *obeyed_joints, *self._services.stop]
        self.request_readers: list[Reader] = [*refused_joints, *self._services.others]
        self.follow_rules()

    def follow_rules(self) -> None:
        """Judge by the present rules, from the next command on."""
        self._twists.linear, self._twists.angular = self._rules.linear, self._rules.angular
        for freshness in self._freshness:
            freshness.max_age = self._rules.max_age

    def report_news(self, on_news: Callable[[float], None]) -> None:
        """Call `on_news` at a time (s) when there is a source that no status has named yet."""
        self._twists.on_news = on_news

    def status(self, now: float) -> CommandStatus:
        """The source that drives, and what became of the commands so far."""
        status = self._twists.status(now)
        status.max_linear, status.max_angular = self._twists.linear, self._twists.angular
        return status

    def forget(self, source: str, session: str) -> None:
        """Stop if `source` drives: its process, with this `session`, is gone. Its last commands
        have to be read before.

        If another session uses the same name, that is a forgery, and changes nothing.
        """
        if all(freshness.is_session(source, session) for freshness in self._freshness):
            self.arbiters.forget(source, self._of_members)

    def close(self) -> None:
        """Close the keys. The arbiters are then for the next robot of that name to inherit."""
        self.arbiters.settle(time.monotonic())
        for subscription in self._subscriptions:
            subscription.close()
        self._services.close()
