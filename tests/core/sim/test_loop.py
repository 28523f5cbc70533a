"""The loop with a real engine and a real bus: commands in, odometry out, at the pace that was asked
for.
"""

import json
import re
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import pytest
import zenoh
from msgspec.structs import replace

from holozen.command.wait_set import DISTRUST
from holozen.limits import STOP
from holozen.messages import (
    Clock,
    CommandStatus,
    JointState,
    Odometry,
    SimulationStatus,
    TFMessage,
    TriggerReply,
    TriggerRequest,
    Twist,
)
from holozen.messages.codec import encode
from holozen.robot.files.loading import load
from holozen.robot.model import Drive
from holozen.testing import Wire, wait_for
from holozen.transport.errors import ServiceError
from holozen.transport.pubsub import Publisher, Subscription
from holozen.wire import MAX_COMMAND_BYTES, PRIORITY_OF
from services.sim import loop as loop_module
from services.sim.entities import Entities
from services.sim.loop import POLL, Loop
from services.sim.physics.engine import UPRIGHT
from services.sim.physics.world import World

MODEL = load(Path(__file__).parents[3] / "urdf" / "hb_bot.urdf.xacro")
assert MODEL.drive is not None
DRIVE = MODEL.drive
FORWARD = (0.5, 0.0, 0.0)


class Sim:
    """One hb_bot called Fred, at the origin of a world with ground."""

    def __init__(self, wire: Wire, world: World, rtf: float = 0.0, drive: Drive = DRIVE) -> None:
        self.world, self.bus = world, wire.bus("sim")
        self.entities = Entities(self.bus, world, (5.0, 10.0))
        self.entities.add("Fred", replace(MODEL, drive=drive), ((0, 0, 0), UPRIGHT))
        (self.robot,) = self.entities.robots
        self.arbiter = self.robot.commands.arbiters.base
        self.loop = Loop(self.bus, world, self.entities, rtf)

    def run(self, steps: int) -> None:
        self.loop.run(threading.Event(), steps)

    @contextmanager
    def running(self) -> Iterator[None]:
        """The loop in a thread of its own."""
        stop = threading.Event()
        with ThreadPoolExecutor() as pool:
            done = pool.submit(self.loop.run, stop)
            try:
                yield
            finally:
                stop.set()
        done.result()

    def all(self, subscription: Subscription[Odometry]) -> list[Odometry]:
        return [
            received.message for received in iter(subscription.try_recv, None) if received.message
        ]


@pytest.fixture
def sim(wire: Wire, ground: World) -> Sim:
    return Sim(wire, ground)


def test_a_run_ends_after_its_steps_or_when_it_is_stopped(sim: Sim) -> None:
    sim.run(100)
    sim.run(20)
    assert sim.world.steps == 120
    stopped = threading.Event()
    stopped.set()
    sim.loop.run(stopped)
    assert sim.world.steps == 120


def test_odometry_comes_at_its_rate_of_sim_time_with_the_frames_of_the_robot(sim: Sim) -> None:
    odom = sim.bus.subscribe("Fred/odom", Odometry, depth=1000)
    sim.run(480)
    reported = sim.all(odom)
    assert len(reported) == 2 * DRIVE.odometry_rate + 1
    stamps = [message.header.stamp.seconds() for message in reported]
    assert stamps[-1] == pytest.approx(2.0)
    assert all(later - earlier <= 1 / 50 + 1 / 240 + 1e-9 for earlier, later in pairwise(stamps))
    assert (reported[0].header.frame_id, reported[0].child_frame_id) == (
        "Fred/odom",
        "Fred/footprint_link",
    )
    assert reported[-1].pose.pose.position.z == pytest.approx(-0.04, abs=1e-3)


def test_a_command_moves_the_robot_and_its_joints_and_shows_in_the_status(sim: Sim) -> None:
    odom = sim.bus.subscribe("Fred/odom", Odometry, depth=1000)
    joints = sim.bus.subscribe("Fred/joint_states", JointState, depth=1000)
    sim.arbiter.velocity_timeout = None
    sim.arbiter.offer("me", 0, FORWARD, time.monotonic())
    sim.run(480)
    last = sim.all(odom)[-1]
    assert last.pose.pose.position.x == pytest.approx(1.0, abs=1e-3)
    assert last.twist.twist.linear.x == pytest.approx(0.5, abs=1e-6)
    (*_, wheels) = [received.message for received in iter(joints.try_recv, None)]
    assert wheels is not None
    angles = dict(zip(wheels.name, wheels.position, strict=True))
    assert angles["front_wheel_joint"] == pytest.approx(1.0 / 0.14, abs=0.05)
    assert wheels.velocity[0] == pytest.approx(0.5 / 0.14)


def test_transforms_and_clock_are_published(sim: Sim) -> None:
    tf = sim.bus.subscribe("Fred/tf", TFMessage, depth=1000)
    clock = sim.bus.subscribe("clock", Clock, depth=1000)
    sim.run(240)
    transforms = [
        t
        for received in iter(tf.try_recv, None)
        if received.message
        for t in received.message.transforms
    ]
    children = {t.child_frame_id for t in transforms}
    assert {"Fred/footprint_link", "Fred/base_link", "Fred/front_wheel_link"} <= children
    ticks = [received.message for received in iter(clock.try_recv, None) if received.message]
    assert len(ticks) == 51
    assert ticks[-1].clock.seconds() == pytest.approx(1.0)


def test_odom_and_its_transform_can_be_switched_off(wire: Wire, ground: World) -> None:
    sim = Sim(wire, ground, drive=Drive(publish_odom=False, publish_odom_tf=False))
    odom = sim.bus.subscribe("Fred/odom", Odometry, depth=1000)
    tf = sim.bus.subscribe("Fred/tf", TFMessage, depth=1000)
    sim.run(240)
    assert sim.all(odom) == []
    frames = {
        t.header.frame_id
        for r in iter(tf.try_recv, None)
        if r.message
        for t in r.message.transforms
    }
    assert "Fred/odom" not in frames


def test_a_command_from_another_process_drives_and_its_silence_stops(
    wire: Wire, ground: World
) -> None:
    sim = Sim(wire, ground, rtf=1.0)
    me = wire.bus("me")
    odom = me.latest("Fred/odom", Odometry)
    commands: Publisher[Twist] = me.publisher("Fred/cmd_vel", Twist)

    def speed() -> float:
        message = odom.read()[0]
        return message.twist.twist.linear.x if message else 0.0

    sent: list[float] = []

    def drives() -> bool:
        sent.append(time.monotonic())
        commands.put(Twist.planar(0.5))
        return speed() == pytest.approx(0.5, abs=1e-3)

    with sim.running():
        wait_for(drives)
        wait_for(lambda: speed() == pytest.approx(0, abs=1e-3))
    # m, at most, until the last command: a single one may be too old
    spent = 0.5 * (sent[-1] - sent[0])
    # half a second from its sending, and late steps; less where a busy machine held up the sim
    assert 0.0 < sim.robot.body.pose()[0][0] < 0.5 + spent


def test_what_is_wrong_never_reaches_the_engine_and_is_counted(wire: Wire, ground: World) -> None:
    sim, me = Sim(wire, ground, rtf=1.0), wire.bus("me")
    status = me.latest("Fred/cmd_vel_status", CommandStatus)
    commands: Publisher[Twist] = me.publisher("Fred/cmd_vel", Twist)
    bad = {
        b"[]": "malformed",
        b"\xff": "malformed",
        b'{"linaer": {}}': "malformed",
        b'{"linear":{"x":1e999}}': "malformed",
        b" " * (MAX_COMMAND_BYTES + 1): "oversized",
    }

    def refused(kind: str) -> int:
        reported = status.read()[0]
        return reported.refused.get(kind, 0) if reported else 0

    with sim.running():
        wait_for(lambda: commands.matched)
        for payload, kind in bad.items():
            before = refused(kind)
            me.session.put(
                "Fred/cmd_vel", payload, congestion_control=zenoh.CongestionControl.BLOCK
            )
            wait_for(partial(lambda kind, before: refused(kind) > before, kind, before))
    assert sim.robot.body.pose()[0][:2] == pytest.approx((0, 0), abs=1e-4)


def test_the_priority_is_read_off_the_sample(wire: Wire, ground: World) -> None:
    sim, me = Sim(wire, ground, rtf=1.0), wire.bus("me")
    status = me.latest("Fred/cmd_vel_status", CommandStatus)
    commands: Publisher[Twist] = me.publisher("Fred/cmd_vel", Twist, PRIORITY_OF["controller"])
    with sim.running():

        def obeyed() -> CommandStatus | None:
            commands.put(Twist.planar(0.1))  # a single one may be too old where the machine is busy
            reported = status.read()[0]
            return reported if reported and reported.obeyed else None

        reported = wait_for(obeyed)
    assert reported is not None
    assert (reported.obeyed, reported.priority, reported.held) == (me.source, "DATA_LOW", False)


def test_resume_is_a_service_between_the_steps(wire: Wire, ground: World) -> None:
    sim, me = Sim(wire, ground, rtf=1.0), wire.bus("me")
    with sim.running():
        assert me.call("Fred/resume", TriggerRequest(), TriggerReply).success
        sim.arbiter.velocity_timeout = None
        sim.arbiter.offer("teleop@1", 1, FORWARD, time.monotonic())
        with pytest.raises(ServiceError, match=r"^teleop@1 drives; stop it first$"):
            me.call("Fred/resume", TriggerRequest(), TriggerReply)
    assert sim.arbiter.resumed == 1


def test_stop_and_release_are_services_and_published_at_once(wire: Wire, ground: World) -> None:
    sim, me = Sim(wire, ground, rtf=1.0), wire.bus("me")
    status = me.subscribe("Fred/cmd_vel_status", CommandStatus)
    with sim.running():
        for verb, setter in (
            ("stop", me.source),
            ("stop", me.source),
            ("release", ""),
            ("release", ""),
        ):
            assert me.call(f"Fred/{verb}", TriggerRequest(), TriggerReply).success
            assert (
                sim.arbiter.stopped_by
                == sim.robot.commands.arbiters.joints.stopped_by
                == (setter or None)
            )
            reported = [
                received.message for received in iter(status.try_recv, None) if received.message
            ]
            if reported:  # a change is published before it is confirmed, the rest when it is due
                assert reported[-1].stopped == setter
            (answer,) = [reply.ok for reply in me.session.get("Fred/cmd_vel_status")]
            assert json.loads(bytes(answer.payload))["stopped"] == setter


def test_of_a_stop_and_a_release_that_wait_together_the_stop_wins(wire: Wire, sim: Sim) -> None:
    me = wire.bus("me")
    sim.bus.session.declare_queryable("here", lambda query: query.reply("here", b""))
    wait_for(lambda: list(me.session.get("here")))
    asked = [me.ask_all(f"Fred/{verb}", 60.0) for verb in ("stop", "release", "stop", "release")]
    assert list(me.session.get("here")), "what was asked before this waits at the sim now"
    sim.run(1)
    assert all(len(list(answers)) == 1 for answers in asked)
    assert sim.arbiter.stopped_by == me.source


def test_a_node_that_leaves_stops_the_robot_that_it_drove_and_no_other(
    clock: list[float], sim: Sim
) -> None:
    """Time stands still here, so it is no watchdog that stops it."""
    for name, source in (("Fred", "teleop@abcdef"), ("Ann", "other@abcdef")):
        if name == "Ann":
            sim.entities.add("Ann", replace(MODEL, drive=DRIVE), ((3, 0, 0), UPRIGHT))
        sim.entities.robots[-1].commands.arbiters.base.offer(source, 1, FORWARD, clock[0])
    fred, ann = sim.entities.robots
    token = sim.bus.session.liveliness().declare_token("@holozen/abcdef0123/teleop/node")
    sim.run(10)
    assert fred.commands.arbiters.base.motion(clock[0]).value == FORWARD
    token.undeclare()

    def stands() -> bool:
        sim.run(1)
        return fred.commands.arbiters.base.motion(clock[0]).value == STOP

    wait_for(stands)
    assert ann.commands.arbiters.base.motion(clock[0]).value == FORWARD


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The loop's monotonic clock, which a test moves on by hand. Ask for it before the sim."""
    now = [time.monotonic() + 100.0]  # after all that the sim has begun
    monkeypatch.setattr(
        loop_module, "time", SimpleNamespace(monotonic=lambda: now[0], time=time.time)
    )
    return now


def test_commands_that_waited_through_a_stall_are_refused(clock: list[float], sim: Sim) -> None:
    """The sim stalled and goes on: commands without a stamp may be as old as the stall."""
    status = sim.bus.subscribe("Fred/cmd_vel_status", CommandStatus)
    for pause, refused in (
        (0.05, False),
        (0.45, False),
        (0.6, True),
        (DISTRUST / 2, True),
        (DISTRUST, False),
    ):
        clock[0] += pause
        sim.bus.session.put("Fred/cmd_vel", encode(Twist.planar(pause)))
        sim.run(1)
        driver = sim.arbiter.driver(clock[0])
        assert (driver is None or driver.motion != (pause, 0, 0)) == refused, pause
    clock[0] += 1
    sim.run(1)
    reported = [received.message for received in iter(status.try_recv, None) if received.message]
    assert reported[-1].refused == {"old": 2}


def test_a_new_source_is_in_a_status_at_once(clock: list[float], sim: Sim) -> None:
    """A publisher of one command waits for that. Too little time passes here for a status to be
    due.
    """
    status = sim.bus.subscribe("Fred/cmd_vel_status", CommandStatus)
    sim.run(1)
    assert [received.message for received in iter(status.try_recv, None)], (
        "the first is due at once"
    )
    for name, is_new in (("one", True), ("one", False), ("two", True), ("one", False)):
        sim.bus.session.put("Fred/cmd_vel", encode(Twist()), attachment=f"{name}@abc")
        clock[0] += POLL
        sim.run(1)
        reported = [
            received.message for received in iter(status.try_recv, None) if received.message
        ]
        assert [f"{name}@abc" in [each.source for each in one.sources] for one in reported] == [
            True
        ] * is_new


def test_a_stop_that_waited_through_a_stall_is_obeyed(clock: list[float], sim: Sim) -> None:
    commands: Publisher[Twist] = sim.bus.publisher("Fred/cmd_vel", Twist)
    sim.arbiter.velocity_timeout = None
    sim.arbiter.offer(sim.bus.source, 4, FORWARD, clock[0])
    clock[0] += 60
    commands.put(Twist())
    sim.run(1)
    assert sim.arbiter.motion(clock[0]).value == STOP


def test_a_flood_of_commands_at_one_robot_pushes_out_no_stop_of_another(
    clock: list[float], sim: Sim
) -> None:
    sim.entities.add("Ann", MODEL, ((3, 0, 0), UPRIGHT))
    flood: Publisher[Twist] = sim.bus.publisher("Ann/cmd_vel", Twist)
    commands: Publisher[Twist] = sim.bus.publisher("Fred/cmd_vel", Twist)
    sim.arbiter.velocity_timeout = None
    sim.arbiter.offer(sim.bus.source, 4, FORWARD, clock[0])
    commands.put(Twist())
    for _ in range(5000):
        flood.put(Twist.planar(0.5))
    sim.run(1)
    assert sim.arbiter.motion(clock[0]).value == STOP


def test_a_drive_brakes_a_robot_that_glided_and_is_set_in_motion(sim: Sim) -> None:
    sim.run(240)
    assert sim.robot.body.glides
    sim.entities.put("Fred", ((0, 0, -0.04), UPRIGHT), (2.0, 0, 0), (0, 0, 0))
    sim.run(60)
    assert sim.robot.body.pose()[0][0] < 0.1


def test_the_first_and_the_100th_robot_stand_when_their_drivers_fall_silent_and_when_they_are_stopped(  # noqa: E501
    clock: list[float], sim: Sim, wire: Wire
) -> None:
    for number in range(1, 100):
        sim.entities.add(
            f"bot{number}", MODEL, ((2.0 * (number % 18), 2.0 * (number // 18), -0.04), UPRIGHT)
        )
    sim.run(120)
    first, last = sim.entities.robots[0], sim.entities.robots[-1]
    assert last.body.glides

    def speeds() -> list[float]:
        sim.run(1)
        return [robot.body.twist()[0][0] for robot in sim.entities.robots]

    assert not any(speeds())
    for robot in (first, last):
        robot.commands.arbiters.base.offer("me", 4, FORWARD, clock[0])
    driving = speeds()
    assert (driving[0], driving[-1]) == pytest.approx((0.5, 0.5), abs=1e-3) and not any(
        driving[1:-1]
    )
    clock[0] += 0.499
    driving = speeds()
    assert (driving[0], driving[-1]) == pytest.approx((0.5, 0.5), abs=1e-3)
    clock[0] += 0.002
    assert not any(speeds())
    me = wire.bus("me")
    for robot, name in ((first, "Fred"), (last, "bot99")):
        robot.commands.arbiters.base.set_velocity_timeout(None, clock[0])
        robot.commands.arbiters.base.offer("me", 4, FORWARD, clock[0])
        assert sum(map(bool, speeds())) == 1
        with ThreadPoolExecutor() as pool:
            stopped = pool.submit(me.call, f"{name}/stop", TriggerRequest(), TriggerReply, 60.0)
            while not stopped.done():
                clock[0] += 0.005
                sim.run(1)
        assert stopped.result().success
        assert not any(speeds())


def test_a_changed_timeout_applies_to_the_current_driver(clock: list[float], sim: Sim) -> None:
    sim.run(240)
    sim.arbiter.offer("me", 4, FORWARD, clock[0])
    sim.run(1)
    sim.arbiter.set_velocity_timeout(0.1, clock[0])
    clock[0] += 0.11
    sim.run(1)
    assert sim.robot.body.twist()[0] == (0, 0, 0)


def test_a_paused_sim_reads_the_request_after_another_at_once_and_rests_when_none_comes(
    sim: Sim,
) -> None:
    waits: list[float] = []

    class Stop(threading.Event):
        def wait(self, timeout: float | None = None) -> bool:
            waits.append(timeout or 0.0)
            if timeout == POLL and len(waits) > 10:
                self.set()
            return super().wait(timeout)

    asked = iter([False, True])
    sim.loop.answers.append(lambda: next(asked, False))
    sim.loop.simulation.pause(time.monotonic())
    sim.loop.run(Stop())
    assert min(waits) < POLL


def test_a_stall_is_an_overrun_in_the_status(
    clock: list[float],
    wire: Wire,
    ground: World,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    sim = Sim(wire, ground, rtf=1.0)
    status = sim.bus.subscribe("simulation_status", SimulationStatus)
    looks = 0

    def look() -> float:
        nonlocal looks
        looks += 1
        return clock[0]

    def reported() -> SimulationStatus | None:
        nonlocal looks
        if looks:  # a loop that is held up would find a second stall
            looks = 0
            clock[0] += 0.004
        new = [received.message for received in iter(status.try_recv, None)]
        return new[-1] if new and new[-1] and new[-1].overruns else None

    monkeypatch.setattr(loop_module, "time", SimpleNamespace(monotonic=look, time=time.time))
    with sim.running():
        wait_for(lambda: ground.steps)
        before = ground.steps
        clock[0] += 1.0
        newest = wait_for(reported)
    assert newest
    assert newest.overruns == 1 and newest.lost == pytest.approx(1.0, abs=0.2)
    assert newest.steps - before < 0.2 * 240, "no burst followed"
    assert newest.real_time_factor < 0.3
    assert re.fullmatch(
        r"sim: 1 overrun, \d\.\d s lost; running at 0\.\d\dx real time\n", capsys.readouterr().err
    )
