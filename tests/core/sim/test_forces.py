"""A force plugin's wrench: Newton's laws at the centre of mass of its link, along the axes of its
frame.
"""

import math
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from holozen.command.arbiter import Arbiter
from holozen.command.inputs import CommandStats, ForceInput, JointInput, TwistInput
from holozen.command.motion import AppliedForce, is_stop
from holozen.command.wait_set import Moment
from holozen.messages import JointState, Twist, TwistStamped, Vector3, Wrench
from holozen.robot.files.loading import parse
from holozen.robot.model import Force, Planar, Pushed
from holozen.robot.rotation import matrix_of
from holozen.rotation import from_rpy
from holozen.transport.pubsub import Received
from services.sim.physics.jointed import Forces, Motors
from services.sim.physics.movers import mover_for
from services.sim.physics.planar import PlanarMover
from services.sim.physics.world import World
from tests.core.command.fakes import FakeSenders, received, stamp

TOP_FILE = Path("top.urdf")
HAND = (0.3, -0.2, 0.5)  # the frame of the link that is fixed to the base
INERTIA = '<inertia ixx="0.1" iyy="0.2" izz="0.3" ixy="0" ixz="0" iyz="0"/>'
TOP = f"""<robot name="top"><link name="base"><inertial><mass value="2"/>{INERTIA}</inertial></link>
<joint name="holds" type="fixed"><origin xyz="0 1 0" rpy="{HAND[0]} {HAND[1]} {HAND[2]}"/>
<parent link="base"/><child link="hand"/></joint><link name="hand"/>"""
WHEEL = f"""<joint name="axle" type="continuous"><origin xyz="0 1 0"/><parent link="base"/><child link="wheel"/>
<axis xyz="0 1 0"/></joint><link name="wheel"><inertial><mass value="1"/>{INERTIA}</inertial></link>"""  # noqa: E501
TILT = (0.4, -0.7, 1.1)  # of the base in the world


def plugin(tags: str) -> str:
    return f'<gazebo><plugin name="p" filename="libgazebo_ros_force.so">{tags}</plugin></gazebo>'


def forces(tags: str, more: str = "") -> tuple[Force, ...]:
    return parse(f"{TOP}{more}{plugin(tags)}</robot>", TOP_FILE).forces


@pytest.mark.parametrize(("frame", "link"), [*product(("world", "link"), ("base", "hand"))])
def test_a_wrench_moves_a_free_body_by_newton_and_euler(
    space: World, frame: str, link: str
) -> None:
    model = parse(
        f"{TOP}{plugin(f'<link_name>{link}</link_name><force_frame>{frame}</force_frame>')}</robot>",
        TOP_FILE,
    )
    body = space.add_jointed(model, (0, 0, 0), from_rpy(*TILT))
    force, torque = np.array([1.0, 2.0, -3.0]), np.array([-0.5, 0.2, 0.4])
    Forces(body, {"k": list(model.forces)}, model, None).apply(
        [AppliedForce("k", (*force, *torque), 0.0)]
    )
    space.step()
    base = matrix_of(TILT)
    axes = (
        np.eye(3) if frame == "world" else base @ (matrix_of(HAND) if link == "hand" else np.eye(3))
    )
    arm = base @ np.array([0.0, 1.0, 0.0]) if link == "hand" else np.zeros(3)
    pushed, turned = axes @ force, axes @ torque + np.cross(arm, axes @ force)
    linear, angular = body.twist()
    dt = space.spec.step
    assert linear == pytest.approx(pushed / 2 * dt, abs=1e-9)
    assert angular == pytest.approx(
        base @ np.diag([10, 5, 10 / 3]) @ base.T @ turned * dt, abs=1e-9
    )


def test_a_torque_on_a_wheel_turns_it_against_its_base(space: World) -> None:
    model = parse(f"{TOP}{WHEEL}{plugin('<link_name>wheel</link_name>')}</robot>", TOP_FILE)
    body = space.add_jointed(model, (0, 0, 0))
    Forces(body, {"k": list(model.forces)}, model, None).apply(
        [AppliedForce("k", (0, 0, 0, 0, 1.0, 0), 0.0)]
    )
    space.step()
    _, (rate,), _ = body.states()
    assert rate == pytest.approx(1 / 0.2 * space.spec.step, rel=1e-3)
    assert body.twist()[1] == pytest.approx((0, 0, 0), abs=1e-6)


def test_without_a_source_its_wheels_brake_and_with_one_they_turn_freely(space: World) -> None:
    model = parse(f"{TOP}{WHEEL}{plugin('<link_name>wheel</link_name>')}</robot>", TOP_FILE)
    body = space.add_jointed(model, (0, 0, 0))
    motors = Motors(body, frozenset(body.names))
    drive = Forces(body, {"k": list(model.forces)}, model, motors)

    def rate(pushes: list[AppliedForce] | None, steps: int = 60) -> float:
        for _ in range(steps):
            drive.apply(pushes)
            motors.apply(None)
            space.step()
        return body.states()[1][0]

    assert rate([AppliedForce("k", (0, 0, 0, 0, 0.2, 0), 0.0)]) == pytest.approx(0.25, rel=1e-2)
    assert rate([]) == pytest.approx(0.25, rel=1e-2), "zero is no brake"
    assert rate(None) == pytest.approx(0, abs=1e-6)
    assert rate([AppliedForce("k", (0, 0, 0, 0, 0.2, 0), 0.0)]) == pytest.approx(0.25, rel=1e-2)


@pytest.mark.parametrize(
    ("tags", "topic", "in_link"),
    [
        ("<bodyName>hand</bodyName><topicName>push</topicName>", "push", False),
        (
            "<bodyName>hand</bodyName><robotNamespace>/a</robotNamespace>",
            "a/gazebo_ros_force",
            False,
        ),
        (
            "<ros><namespace>/a/b</namespace><remapping>gazebo_ros_force:=push</remapping></ros>"
            "<link_name>hand</link_name><force_frame>link</force_frame>",
            "a/b/push",
            True,
        ),
    ],
    ids=["ROS 1", "its namespace", "ROS 2"],
)
def test_the_tags_of_both_ros_give_link_topic_and_frame(
    tags: str, topic: str, in_link: bool
) -> None:
    model = parse(f"{TOP}{plugin(tags)}</robot>", TOP_FILE)
    assert model.forces == (Force("hand", topic, in_link),)
    assert model.drive and model.drive.mechanism == Pushed() and model.warnings == ()
    assert model.drive.odometry_topic == f"{topic.rpartition('/')[0]}/odom".strip("/")


def test_a_force_that_cannot_push_is_reported() -> None:
    model = parse(f"{TOP}{plugin('<link_name>hnad</link_name>')}{plugin('')}</robot>", TOP_FILE)
    assert model.forces == () and model.drive is None
    first, second = model.warnings
    assert (
        "names the link 'hnad', which does not exist (did you mean 'hand'?); this force pushes "
        "nothing" in first
    )
    assert (
        "<link_name> of <plugin name='p'> is missing; this force pushes nothing; links: base, hand"
        in second
    )


PLANAR = '<gazebo><plugin name="d" filename="libgazebo_ros_planar_move.so"/></gazebo>'
FOOT = """<joint name="stands" type="{kind}"><origin xyz="0 {y} 0"/><parent link="base"/><child link="foot{y}"/>
<axis xyz="0 1 0"/></joint>
<link name="foot{y}"><inertial><mass value="1e-4"/>
<inertia ixx="1e-6" iyy="1e-6" izz="1e-6" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><sphere radius="0.1"/></geometry></collision></link>
<gazebo reference="foot{y}"><mu1>0.5</mu1><mu2>0.5</mu2></gazebo>"""  # noqa: E501


def feet(kind: str) -> str:
    return "".join(FOOT.format(kind=kind, y=y).replace("stands", f"stands{y}") for y in (-0.5, 0.5))


@pytest.mark.engines
def test_forces_push_a_planar_base_between_the_updates_of_its_drive(ground: World) -> None:
    """2 kg on two feet, or two wheels, with a friction of 0.5: 9.8 N. The drive stops it 20 times a
    second.
    """
    dt, period = ground.spec.step, round(0.05 / ground.spec.step)
    skids, rolls = (
        parse(f"{TOP}{PLANAR}{feet(kind)}{plugin('<link_name>base</link_name>')}</robot>", TOP_FILE)
        for kind in ("fixed", "continuous")
    )
    assert not skids.warnings and skids.drive and isinstance(skids.drive.mechanism, Planar)
    for model, x, y, ax, ay in (
        (skids, 9.0, 0.0, 0.0, 0.0),
        (skids, 13.8, 0.0, 2.0, 0.0),
        (skids, 0.0, 13.8, 0.0, 2.0),
        (rolls, 4.0, 0.0, 2.0, 0.0),
        (rolls, 0.0, 13.8, 0.0, 2.0),
    ):
        mover = mover_for(ground, model, (0, 0, 0.1))
        assert isinstance(mover, PlanarMover)
        mover.let_push(model, {"k": list(model.forces)})
        for _ in range(3):
            for step in range(1, period + 1):
                mover.push([AppliedForce("k", (x, y, 0, 0, 0, 0), 0.0)], dt)
                ground.step()
                expected = (ax * step * dt, ay * step * dt, 0.0)
                assert mover.body.velocity(dt) == pytest.approx(expected, abs=2e-3), (x, y, step)
        mover.body.remove()


@pytest.mark.engines
def test_a_turning_push_and_a_twist_after_it(ground: World) -> None:
    model = parse(
        f"{TOP}{PLANAR}{feet('fixed')}{plugin('<link_name>base</link_name>')}</robot>", TOP_FILE
    )
    mover, dt = mover_for(ground, model, (0, 0, 0.1)), ground.spec.step
    assert isinstance(mover, PlanarMover)
    mover.let_push(model, {"k": list(model.forces)})
    for step in range(1, 6):
        mover.push([AppliedForce("k", (0, 0, 0, 0, 0, 6.0), 0.0)], dt)
        ground.step()
        held = 0.5 * 9.8 * 2 * 0.5  # the feet slide 0.5 m from the middle
        assert mover.body.velocity(dt)[2] == pytest.approx((6.0 - held) / 0.3 * step * dt, rel=0.02)
    for _ in range(5):
        mover.move((0.3, 0.0, 0.5), dt)
        ground.step()
    assert mover.body.velocity(dt) == pytest.approx((0.3, 0.0, 0.5), abs=1e-3)


class Topics:
    """Two force topics of a robot, and their arbiter."""

    def __init__(self) -> None:
        self.arbiter, self.stats = Arbiter(0.5), CommandStats(lambda _: None)
        self._input = ForceInput(("left", "right"), self.arbiter, FakeSenders(), self.stats)

    def take(
        self, key: str, x: float, now: float, source: str = "me@1", priority: str = "DATA"
    ) -> None:
        message = Wrench(Vector3(x))
        self._input.take([received(message, source, priority, key)], Moment(now, now, ()))

    def pushes(self, now: float) -> dict[str, float] | None:
        pushes = self.arbiter.pushes(now)
        return None if pushes is None else {push.key: push.wrench[0] for push in pushes}


@pytest.fixture
def topics() -> Topics:
    return Topics()


def test_one_source_pushes_on_all_topics_and_each_ends_with_its_own_silence(topics: Topics) -> None:
    topics.take("right", 2.0, 10.0)
    topics.take("left", 1.0, 10.3)
    assert topics.pushes(10.4) == {"left": 1.0, "right": 2.0}
    assert topics.pushes(10.6) == {"left": 1.0}
    assert topics.pushes(10.9) is None


def test_a_person_takes_all_topics_from_a_script(topics: Topics) -> None:
    topics.take("left", 1.0, 10.0)
    topics.take("right", 2.0, 10.1, "person@2", "INTERACTIVE_HIGH")
    topics.take("left", 1.0, 10.2)
    assert topics.pushes(10.3) == {"right": 2.0}
    assert "overruled" in topics.stats.last_refusal


def test_a_zero_from_an_equal_stops_all_topics(topics: Topics) -> None:
    topics.take("left", 1.0, 10.0)
    topics.take("right", 0.0, 10.1, "other@2")
    topics.take("left", 1.0, 10.2)
    assert topics.pushes(10.3) == {"right": 0.0}


@pytest.mark.parametrize("bad", [math.nan, math.inf, 1e5])
def test_what_is_no_plausible_force_is_refused(topics: Topics, bad: float) -> None:
    topics.take("left", 1.0, 10.0)
    topics.take("left", bad, 10.1)
    assert topics.pushes(10.2) == {"left": 1.0}
    assert sum(topics.stats.refused.values()) == 1 and "force.x is" in topics.stats.last_refusal


def test_a_zero_on_one_topic_is_no_stop_while_its_source_pushes_on_another(topics: Topics) -> None:
    """An ordinary turn has one thruster at zero. That lets go of no stopped robot, and stops no
    equal.
    """
    topics.arbiter.stop("ann@1", 10.0)
    for now in (10.1, 10.3, 10.5):
        topics.take("right", 2.0, now)
        topics.take("left", 0.0, now)
    topics.arbiter.release(10.5)
    topics.take("right", 2.0, 10.7)
    assert topics.pushes(10.7) is None and "let go first" in topics.stats.last_refusal
    topics.take("right", 0.0, 10.8)
    topics.take("right", 2.0, 10.9)
    assert topics.pushes(10.9) == {"right": 2.0}, "all of its topics were at zero"
    topics.take("right", 1.0, 11.0, "other@2")
    topics.take("left", 0.0, 11.1, "other@2")
    assert topics.pushes(11.1) == {"right": 2.0}


def test_what_a_slow_link_brings_moves_no_joint_and_no_body_until_its_sender_has_answered() -> None:
    for message in (JointState(name=["w"], velocity=[5.0]), Wrench(Vector3(1.0))):
        senders, arbiter, stats = FakeSenders(), Arbiter(0.5), CommandStats(lambda _: None)
        joints = JointInput("key", senders, stats, [(frozenset("w"), arbiter)], ["w"])
        read: Any = (
            joints
            if isinstance(message, JointState)
            else ForceInput(("key",), arbiter, senders, stats)
        )
        # the second echoes a beat from after the first arrived
        for number, is_answer in ((1, False), (2, True)):
            now = 10.0 + 0.3 * number
            read.take(
                [received(message, stamp(number, now - 0.2), key="key")], Moment(now, now, ())
            )
            assert (not is_stop(arbiter.motion(now).value), stats.refused) == (
                is_answer,
                {"late": 1},
            )


def test_a_zero_for_one_joint_is_no_stop_while_its_source_moves_another() -> None:
    arbiter, stats = Arbiter(0.5), CommandStats(lambda _: None)
    joints = JointInput(
        "joint_command", FakeSenders(), stats, [(frozenset(("l", "r")), arbiter)], ["l", "r"]
    )

    def take(now: float, **speeds: float) -> None:
        message = JointState(name=[*speeds], velocity=[*speeds.values()])
        joints.take([received(message, "me@1", key="joint_command")], Moment(now, now, ()))

    arbiter.stop("ann@1", 10.0)
    for now in (10.1, 10.3, 10.5):
        take(now, r=5.0)
        take(now, l=0.0)
    arbiter.release(10.5)
    take(10.7, r=5.0)
    assert is_stop(arbiter.motion(10.7).value) and "let go first" in stats.last_refusal
    take(10.8, l=0.0, r=0.0)
    take(10.9, r=5.0)
    assert not is_stop(arbiter.motion(10.9).value)
    take(11.0, l=0.0)
    assert is_stop(arbiter.motion(11.0).value), "of its driver, any zero stops"


def test_a_zero_velocity_stops_the_robot_but_its_source_has_not_let_go_while_it_moves_the_wheels_joints() -> (  # noqa: E501
    None
):
    arbiter, stats = Arbiter(0.5), CommandStats(lambda _: None)
    joints = JointInput("joint_command", FakeSenders(), stats, [(frozenset("w"), arbiter)], ["w"])
    velocities = TwistInput("cmd_vel", arbiter, FakeSenders(), 1.0, 1.0, lambda _: None)
    turns = received(JointState(name=["w"], velocity=[5.0]), "me@1", key="joint_command")
    zero: Received[Twist | TwistStamped] = received(Twist(), "me@1", key="cmd_vel")
    arbiter.stop("ann@1", 10.0)
    joints.take([turns], Moment(10.1, 10.1, ()))
    arbiter.release(10.2)
    velocities.take([zero], Moment(10.3, 10.3, ()))
    joints.take([turns], Moment(10.4, 10.4, ()))
    assert is_stop(arbiter.motion(10.4).value) and "let go first" in stats.last_refusal
    joints.take(
        [received(JointState(name=["w"], velocity=[0.0]), "me@1", key="joint_command")],
        Moment(10.5, 10.5, ()),
    )
    joints.take([turns], Moment(10.6, 10.6, ()))
    velocities.take([zero], Moment(10.7, 10.7, ()))
    assert is_stop(arbiter.motion(10.7).value), "of its driver, any zero stops"
    velocities.take([received(Twist.planar(1.0), "bob@2", key="cmd_vel")], Moment(20.0, 20.0, ()))
    joints.take([turns], Moment(20.1, 20.1, ()))
    assert arbiter.motion(20.1).value == (1.0, 0.0, 0.0) and "overruled" in stats.last_refusal
    velocities.take([zero], Moment(20.2, 20.2, ()))
    assert is_stop(arbiter.motion(20.2).value), "an equal may stop it"


def test_what_its_source_moves_counts_for_the_robot_that_takes_its_place_too() -> None:
    stats, heir = CommandStats(lambda _: None), Arbiter(0.5)

    def take(arbiter: Arbiter, now: float, **speeds: float) -> None:
        names = frozenset(("l", "r"))
        joints = JointInput("joint_command", FakeSenders(), stats, [(names, arbiter)], [*names])
        message = JointState(name=[*speeds], velocity=[*speeds.values()])
        joints.take([received(message, "me@1", key="joint_command")], Moment(now, now, ()))

    arbiter = Arbiter(0.5)
    arbiter.stop("ann@1", 10.0)
    take(arbiter, 10.1, r=5.0)
    arbiter.release(10.2)
    take(arbiter, 10.3, r=5.0)
    arbiter.settle(10.4)
    heir.inherit(arbiter, 20.0)
    take(heir, 20.1, l=0.0)
    take(heir, 20.2, r=5.0)
    assert is_stop(heir.motion(20.2).value) and "let go first" in stats.last_refusal
    heir.settle(30.0)  # long after that
    last = Arbiter(0.5)
    last.inherit(heir, 40.0)
    take(last, 40.1, l=0.0)
    assert stats.refused["part"] == 1, "it moves nothing now"


def test_a_joint_command_for_several_arbiters_counts_once() -> None:
    stats, groups = (
        CommandStats(lambda _: None),
        [(frozenset((name,)), Arbiter(0.5)) for name in ("wheel", "arm")],
    )
    joints = JointInput("joint_command", FakeSenders(), stats, groups, ["wheel", "arm"])
    message = JointState(name=["wheel", "arm"], velocity=[1.0, 1.0])
    joints.take([received(message, "me@1", key="joint_command")], Moment(10.0, 10.0, ()))
    assert (
        all(not is_stop(arbiter.motion(10.0).value) for _, arbiter in groups)
        and stats.accepted == 1
    )


def test_a_software_stop_ends_all_forces_until_the_source_has_let_go(topics: Topics) -> None:
    topics.take("left", 1.0, 10.0)
    topics.arbiter.stop("me", 10.1)
    topics.take("left", 1.0, 10.2)
    assert topics.pushes(10.2) is None and topics.stats.last_refusal.startswith("me@1: stopped")
    topics.arbiter.release(10.2)
    topics.take("left", 1.0, 10.3)
    assert topics.pushes(10.3) is None
    assert topics.stats.last_refusal.startswith("me@1: let go first")
    topics.take("left", 0.0, 10.4)
    topics.take("left", 1.0, 10.5)
    assert topics.pushes(10.5) == {"left": 1.0}
