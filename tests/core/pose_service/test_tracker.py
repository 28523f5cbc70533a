"""The tracker returns the last odom of a robot, or why it has none."""

import re
from functools import partial

import pytest

from holozen.bus import Bus
from holozen.messages import GetPoseReply, GetPoseRequest, Odometry
from holozen.messages.codec import encode
from holozen.testing import Wire, wait_for
from holozen.transport.errors import ServiceError
from holozen.transport.pubsub import Publisher
from holozen.wire import TOPICS
from services.pose_service import __main__ as pose_service
from services.pose_service.__main__ import MAX_NAMES, Tracker

SILENCE = next(row.silence for row in TOPICS if row.key == "odom")


class Robots:
    """A tracker, and robots that publish odom to it."""

    def __init__(self, wire: Wire) -> None:
        self.sim, listener = wire.bus("sim"), wire.bus("pose_service")
        self.tracker = Tracker(listener.subscribe("**/odom", Odometry, depth=256))
        self._wait: dict[str, Publisher[Odometry]] = {}

    def publish(self, key: str, x: float = 0.0) -> None:
        """Publish one odom of the robot with this key."""
        odom = Odometry()
        odom.pose.pose.position.x = x
        if key not in self._wait:
            self._wait[key] = self.sim.publisher(key, Odometry)
            wait_for(lambda: self._wait[key].matched)
        self._wait[key].put(odom)

    def refusal(self, name: str) -> str:
        with pytest.raises(ServiceError) as error:
            self.tracker.get_pose(GetPoseRequest(name))
        return str(error.value)

    def heard(self, name: str, x: float) -> GetPoseReply | None:
        """The reply, if it is fresh and comes from the odom with this x."""
        try:
            reply = self.tracker.get_pose(GetPoseRequest(name))
        except ServiceError:
            return None
        return reply if reply.odom.pose.pose.position.x == x else None


@pytest.fixture
def robots(wire: Wire) -> Robots:
    return Robots(wire)


def reply_once_heard(robots: Robots, name: str, x: float) -> GetPoseReply | None:
    """Publish a robot's odom until the tracker has it."""
    key = f"{name}/odom" if name else "odom"

    def heard() -> GetPoseReply | None:
        robots.publish(key, x)
        return robots.heard(name, x)

    return wait_for(heard)


def test_the_last_odom_of_each_robot_is_reported_with_its_age(robots: Robots) -> None:
    for name, x in (("", 1.0), ("Fred", 2.0), ("Fred", 3.0), ("", 1.5)):
        reply = reply_once_heard(robots, name, x)
        assert reply is not None
        assert 0 <= reply.age <= SILENCE


def test_a_robot_that_was_never_heard_is_named_with_those_that_were(robots: Robots) -> None:
    assert robots.refusal("") == "no odom was received; robots with odom: none"
    reply_once_heard(robots, "", 1.0)
    reply_once_heard(robots, "Ann", 1.0)
    assert (
        robots.refusal("Fred")
        == "no Fred/odom was received; robots with odom: '' (at the root), Ann"
    )


def test_a_name_that_no_robot_may_have_is_refused(robots: Robots) -> None:
    for name in ("*", "a/b", "**", "9", "x" * 65):
        assert robots.refusal(name).startswith(f"robot name {name!r}: use a letter")


def test_odom_that_is_too_old_is_refused_with_its_age(robots: Robots) -> None:
    reply_once_heard(robots, "Fred", 1.0)
    wait_for(lambda: not robots.heard("Fred", 1.0))
    message = re.fullmatch(
        r"Fred/odom is stale: the last one came (.*) s ago; is the sim running\?",
        robots.refusal("Fred"),
    )
    assert message is not None
    assert float(message[1]) >= SILENCE


def test_what_is_no_odom_of_a_robot_is_left_out(robots: Robots) -> None:
    robots.publish("a/b/odom")
    robots.sim.session.put("Ann/odom", b"nonsense")
    reply_once_heard(robots, "Fred", 1.0)  # which came after the others
    assert robots.refusal("Ann") == "no Ann/odom was received; robots with odom: Fred"


def test_of_too_many_robots_the_one_that_has_been_silent_for_longest_is_forgotten(
    robots: Robots, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pose_service, "MAX_ROBOTS", 60)
    odom = encode(Odometry())

    def reply(name: str) -> GetPoseReply | None:
        robots.sim.session.put(f"{name}/odom", odom)
        return robots.heard(name, 0.0)

    names = ["Silent", "Steady", *(f"R{number}" for number in range(58)), "Steady", "Last"]
    for name in names:
        wait_for(partial(reply, name))
    assert robots.heard("Steady", 0.0) or "stale" in robots.refusal("Steady")
    refusal = robots.refusal("Silent")
    assert refusal.startswith("no Silent/odom was received; robots with odom: Last, R")
    assert refusal.count(",") == MAX_NAMES - 1


def test_the_thread_ends_with_the_bus(wire: Wire) -> None:
    bus: Bus = wire.bus("pose_service")
    listening = Tracker(bus.subscribe("**/odom", Odometry))
    bus.close()
    with pytest.raises(ServiceError, match="no odom was received"):
        listening.get_pose(GetPoseRequest())
