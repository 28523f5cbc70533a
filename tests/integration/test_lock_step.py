"""A sim whose time passes in steps: what it does in them, to the last bit, is the same whenever it
is done.
"""

import hashlib
import math
import re
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from msgspec import structs

from holozen import entities
from holozen.bus import Bus
from holozen.data import find
from holozen.engines import is_installed
from holozen.flags import ENGINES
from holozen.messages import (
    Clock,
    CommandStatus,
    GetSceneReply,
    GetSceneRequest,
    JointState,
    Message,
    Odometry,
    Point,
    Pose,
    RobotDescriptionReply,
    RobotDescriptionRequest,
    SimulationStatus,
    Time,
    TriggerReply,
    TriggerRequest,
    Twist,
)
from holozen.messages import simulation_interfaces as si
from holozen.messages.simulation_interfaces import ResetSimulationRequest as Scope
from holozen.messages.simulation_interfaces import SimulationState as State
from holozen.testing import LockStep, Wire, wait_for
from holozen.transport.errors import ServiceError
from holozen.transport.pubsub import Subscription

from .conftest import Verb

Sim = Callable[..., LockStep]
LIBRARIES = {"pybullet": "/pybullet.", "mujoco": "/libmujoco."}  # files of the engines
WORLD = ("--world", str(find("worlds", "arena.world")))
BALL = math.hypot(-2.0, -1.8)  # m from the origin
BALL_URDF = """<robot name="ball"><link name="ball"><inertial><mass value="0.1"/>
<inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><sphere radius="0.05"/></geometry></collision></link></robot>"""
ROBOTS = tuple(
    word
    for file, name in (
        ("hb_bot.urdf.xacro", "Planar"),
        ("rover.urdf.xacro", "Skid"),
        ("wheely_boi.xacro", "Balance"),
    )
    for word in ("--robot", f"{find('urdf', file)}={name}")
)


@pytest.fixture(scope="module")
def only_sim(town: Wire) -> LockStep:
    return LockStep(town)


@pytest.fixture
def sim(only_sim: LockStep) -> LockStep:
    """The file's sim, paused, with hb_bot at its start."""
    set_state(only_sim, State.STATE_PAUSED)
    only_sim.status = status_of(only_sim)  # others may have reset it
    only_sim.reset()
    return only_sim


def hash_of_poses(bus: Bus) -> str:
    """Of all entities, to the last bit: a float is written so that it is read back as it was."""
    poses = [(name, repr(entities.pose(bus, name))) for name in entities.names(bus)]
    return hashlib.sha256(repr(poses).encode()).hexdigest()


def drive(sim: LockStep) -> str:
    """A drive into a ball and on, that ends by silence; the hash of what came of it."""
    for x, y, turn, steps in (
        (-1.5, -1.35, 0.0, 120),
        (-1.5, -1.35, 0.0, 115),
        (-1.0, 0.5, 0.3, 107),
        (-0.5, 0, -2, 160),
    ):
        sim.drive(x, y, turn)
        sim.step(steps)
    assert abs(sim.odom.twist.twist.linear.x) < 1e-3, "its command was 0.5 s old"
    assert math.hypot(*place(sim.bus, "ball")) > BALL + 0.5, "it was hit"
    return hash_of_poses(sim.bus)


def test_the_same_commands_at_the_same_steps_move_all_to_the_same_bits(
    lock_step: Sim, trials: Callable[[int, int], int]
) -> None:
    """tests/core/sim tries each engine."""
    flags = (*WORLD, *ROBOTS)
    sim = lock_step(*flags, robot="Planar")
    hashes = {drive(sim)}
    for _ in range(trials(1, 100)):
        sim.reset()
        hashes.add(drive(sim))
    with Wire() as other:
        hashes.add(drive(LockStep(other, *flags, robot="Planar")))
    assert len(hashes) == 1


@pytest.mark.parametrize("engine", [one for one in ENGINES if is_installed(one)])
def test_a_sim_loads_the_engine_that_is_asked_for_and_no_other(wire: Wire, engine: str) -> None:
    sim = wire.start("sim", "--engine", engine, is_new=True)
    sim.wait_for_line("listens on")
    loaded = Path(f"/proc/{sim.pid}/maps").read_text()
    assert [name for name, file in LIBRARIES.items() if file in loaded] == [engine]


def test_a_reply_follows_all_messages_of_its_steps_and_the_state_after_the_last(
    sim: LockStep,
) -> None:
    odom = sim.bus.subscribe("odom", Odometry, depth=1000)
    clock = sim.bus.subscribe("clock", Clock, depth=1000)
    wanted: dict[str, Subscription[Any]] = {"odom": odom, "clock": clock}
    time = 0.0
    for steps, expected in ((240, 50), (7, 2), (1, 1)):
        sim.bus.call("step_simulation", si.StepSimulationRequest(steps), si.StepSimulationReply)
        for key, messages in ((key, all_of(subscription)) for key, subscription in wanted.items()):
            new = {stamp for stamp in map(stamp_of, messages) if stamp > time + 1e-6}
            assert len(new) in (expected, expected + 1), (
                f"{key} comes at its rate, and with the last step"
            )
            assert stamp_of(messages[-1]) == max(new) == pytest.approx(time + steps / 240)
        time += steps / 240


def test_while_it_is_paused_odom_goes_on_and_nothing_moves_then_or_later(sim: LockStep) -> None:
    start = sim.step(120)
    sim.drive(x=0.4)
    odom = sim.bus.subscribe("odom", Odometry, depth=1000)
    waiting = [received_after(odom) for _ in range(10)]  # at 20 Hz: half a second
    assert all(reported.header.stamp == start.header.stamp for reported in waiting)
    assert all(reported.pose.pose.position == start.pose.pose.position for reported in waiting)
    set_state(sim, State.STATE_PLAYING)
    played = [received_after(odom, start.header.stamp) for _ in range(10)]
    assert max(abs(reported.twist.twist.linear.x) for reported in played) < 1e-3, (
        "the command is one of before"
    )
    commands = sim.bus.publisher("cmd_vel", Twist)

    def moves() -> bool:
        commands.put(Twist.planar(x=0.4))
        return received_after(odom).twist.twist.linear.x > 0.39

    wait_for(moves)


def test_stops_hold_while_it_is_paused_and_survive_a_reset(sim: LockStep) -> None:
    sim.drive(x=0.4)
    moved = sim.step(60)
    sim.bus.call("stop", TriggerRequest(), TriggerReply)
    with pytest.raises(AssertionError, match="the command was refused: stopped: by lock_step@"):
        sim.drive(x=0.4)
    assert abs(sim.step(2).twist.twist.linear.x) < 1e-3
    assert sim.reset().header.stamp == Time()
    assert sim.odom.pose.pose.position.x == 0 != moved.pose.pose.position.x
    with pytest.raises(AssertionError, match="the command was refused: stopped: by lock_step@"):
        sim.drive(x=0.4)
    sim.bus.call("release", TriggerRequest(), TriggerReply)
    with pytest.raises(AssertionError, match="the command was refused: let go first"):
        sim.drive(x=0.4)
    sim.drive()
    sim.drive(x=0.4)
    assert sim.step(60).twist.twist.linear.x == pytest.approx(0.4, abs=1e-3)


def test_a_reset_moves_nothing_and_its_readers_see_the_next_epoch(sim: LockStep) -> None:
    odom = sim.bus.subscribe("odom", Odometry, depth=1000)
    sim.drive(x=0.4)
    sim.step(60)
    before = sim.status
    assert before.steps == 60
    first = sim.reset()
    assert (sim.status.epoch, sim.status.steps, sim.status.time) == (before.epoch + 1, 0, 0.0)
    assert stamp_of(all_of(odom)[-1]) == 0
    assert sim.step(60).pose.pose.position.x == pytest.approx(first.pose.pose.position.x, abs=1e-4)
    sim.drive(x=0.4)
    assert sim.step(60).pose.pose.position.x == pytest.approx(0.1, abs=1e-3), (
        "its odom is due as before"
    )


def test_a_controller_drives_its_lap_in_steps_through_a_pause_and_a_reset(
    lock_step: Sim, wire: Wire
) -> None:
    sim = lock_step()
    odom = sim.bus.subscribe("odom", Odometry, depth=1000)
    commands = sim.bus.subscribe("cmd_vel", Twist, depth=1000)
    wire.start("pose-service", "--size", "0.3").wait_for_line("goals")
    controller = wire.start("controller")
    for turn in range(1000):
        if turn == 10:
            all_of(odom)
            assert len({stamp_of(received_after(odom)) for _ in range(10)}) == 1, (
                "half a second without a step"
            )
        if turn == 20:
            sim.reset()
        all_of(commands)  # so that the next one comes of this step
        sim.step(12)  # as long as between two commands
        wait_for(lambda: commands.try_recv() or controller.returncode is not None)
        if controller.returncode is not None:
            break
    assert controller.returncode == 0
    legs = re.findall(r"lap 1 goal \d: .* deg\) in (.*) s, path error (.*) mm", controller.out)
    assert len(legs) == 4
    # 0.3 m at 0.5 m/s, and 90 degrees at 1 rad/s at the same time; the first with what was driven
    # before the reset.
    assert all(1.5 < float(seconds) < 5 and float(error) < 50 for seconds, error in legs), (
        controller.out
    )
    assert "lap 1 goal 3: (0.00, 0.00, 0 deg)" in controller.out
    assert sim.odom.pose.pose.planar() == pytest.approx((0, 0, 0), abs=0.04)


def test_a_scope_resets_the_time_the_poses_or_what_was_spawned(lock_step: Sim) -> None:
    sim = lock_step("--robot", f"{find('urdf', 'hb_bot.urdf.xacro')}=Fred", robot="Fred")
    bus, at = sim.bus, Pose(Point(y=3.0))
    entities.spawn(bus, "Ball", BALL_URDF, at)
    sim.drive(x=0.4)
    sim.step(120)
    assert place(bus, "Fred")[0] > 0.19
    sim.reset(Scope.SCOPE_TIME)
    assert sim.status.time == 0 and place(bus, "Fred")[0] > 0.19
    sim.step(12)
    sim.reset(Scope.SCOPE_STATE)
    assert sim.status.steps == 12 and place(bus, "Fred") == (0, 0) and place(bus, "Ball") == (0, 3)
    sim.reset(Scope.SCOPE_SPAWNED)
    assert entities.names(bus) == ["Fred"] and sim.status.steps == 12
    entities.delete(bus, "Fred")
    entities.spawn(bus, "Fred", BALL_URDF, at)
    sim.reset(Scope.SCOPE_DEFAULT)
    assert place(bus, "Fred") == (0, 0) and sim.status.steps == 0
    sim.drive(x=0.4)
    assert sim.step(60).twist.twist.linear.x == pytest.approx(0.4, abs=1e-3)


def test_what_cannot_be_done_is_refused_with_its_result(lock_step: Sim) -> None:
    sim = lock_step()
    for steps in (0, 10_000_001):
        assert refused(sim, "step_simulation", si.StepSimulationRequest(steps)) == (
            si.Result.OPERATION_FAILED,
            f"steps is {steps}; use 1 to 10000000",
        )
    assert (
        refused(sim, "reset_simulation", si.ResetSimulationRequest(9))[0]
        == si.Result.FEATURE_UNSUPPORTED
    )
    assert (
        refused(sim, "set_simulation_state", si.SetSimulationStateRequest(State(9)))[0]
        == si.Result.FEATURE_UNSUPPORTED
    )
    assert set_state(sim, State.STATE_PAUSED) == si.SetSimulationStateReply.ALREADY_IN_TARGET_STATE
    assert set_state(sim, State.STATE_STOPPED) == si.Result.OK
    problem = "the sim is stopped; pause it to step: `holozen sim pause`"
    assert refused(sim, "step_simulation", si.StepSimulationRequest()) == (
        si.Result.INCORRECT_STATE,
        problem,
    )
    assert get_state(sim) == State.STATE_STOPPED
    assert set_state(sim, State.STATE_PAUSED) == si.Result.OK
    with ThreadPoolExecutor() as pool:
        long = pool.submit(refused, sim, "step_simulation", si.StepSimulationRequest(10_000_000))
        wait_for(lambda: stamp_of(received_after(sim.bus.subscribe("odom", Odometry))) > 0)
        assert set_state(sim, State.STATE_PAUSED) == si.Result.OK
        assert re.fullmatch(r"it was paused, \d+ steps before the last one", long.result()[1])
    assert set_state(sim, State.STATE_QUITTING) == si.Result.OK
    assert sim.process.wait() == 0


def test_the_command_line_pauses_plays_steps_and_resets(
    sim: LockStep, town: Wire, verb: Verb
) -> None:
    words = (
        "pause",
        "step 24",
        "reset --scope time",
        "step 12 --json",
        "reset --json",
        "play",
        "play --json",
    )
    reported = [verb(town, "sim", *word.split()) for word in words]
    assert [done.returncode for done in reported] == [0] * len(words)
    assert [done.stdout for done in reported] == [
        "paused\n",
        "made 24 steps\n",
        "reset: time\n",
        '{"steps": 12}\n',
        '{"scope": ["all"]}\n',
        "playing\n",
        '{"state": "playing"}\n',
    ]
    assert reported[0].stderr == "holozen sim pause: the sim is paused already\n"
    assert get_state(sim) == State.STATE_PLAYING


def test_a_robot_that_is_not_in_the_sim_is_named(
    lock_step: Sim, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("holozen.testing.lock_step.PATIENCE", 1.0)
    with pytest.raises(AssertionError, match="'Fred listens on' from "):
        lock_step(robot="Fred")


def test_steps_end_with_ctrl_c_and_with_their_timeout(
    verb: Verb, sim: LockStep, town: Wire
) -> None:
    interrupted = town.start("sim", "step", "10000000")
    wait_for(lambda: steps_of(sim))
    beside = verb(town, "sim", "step")
    assert (beside.returncode, beside.stderr) == (1, "holozen sim: other steps are being made\n")
    assert interrupted.returncode is None, "whose steps go on"
    assert interrupted.interrupt() == 130
    assert re.fullmatch(
        r"holozen sim step: interrupted: the goal was cancelled, \d+ steps before the last one\n",
        interrupted.err,
    )
    stands(sim)
    late = verb(town, "sim", "step", "10000000", "--timeout", "0.5")
    while "no step was made" in late.stderr:  # a busy machine took longer to begin
        late = verb(town, "sim", "step", "10000000", "--timeout", "0.5")
    assert late.returncode == 1
    assert re.fullmatch(
        r"holozen sim: not done within 0.5 s, and ended: the goal was cancelled, \d+ steps before "
        r"the last one; "
        r"--timeout gives them longer\n",
        late.stderr,
    )
    stands(sim)


def stands(sim: LockStep) -> None:
    """No step is made but those that are asked for now."""
    before = steps_of(sim)
    reply = sim.bus.call("step_simulation", si.StepSimulationRequest(7), si.StepSimulationReply)
    assert reply.result.result == si.Result.OK
    assert steps_of(sim) == before + 7


def steps_of(sim: LockStep) -> int:
    """How many steps there were, by what the sim published last."""
    return status_of(sim).steps


def status_of(sim: LockStep) -> SimulationStatus:
    return sim.bus.call("simulation_status", TriggerRequest(), SimulationStatus)


def set_state(sim: LockStep, state: int) -> int:
    request = si.SetSimulationStateRequest(State(state))
    return sim.bus.call("set_simulation_state", request, si.SetSimulationStateReply).result.result


def get_state(sim: LockStep) -> int:
    return sim.bus.call(
        "get_simulation_state", si.GetSimulationStateRequest(), si.GetSimulationStateReply
    ).state.state


def refused(sim: LockStep, key: str, request: Message) -> tuple[int, str]:
    """The result and the reason."""
    with pytest.raises(ServiceError) as error:
        sim.bus.call(key, request, si.StepSimulationReply, 60.0)
    fields: dict[str, Any] = error.value.fields
    assert fields["result"]["error_message"] == str(error.value)
    return fields["result"]["result"], str(error.value)


def place(bus: Bus, name: str) -> tuple[float, float]:
    position = entities.pose(bus, name).position
    return round(position.x, 6), round(position.y, 6)


def all_of(subscription: Subscription[Any]) -> list[Any]:
    return [received.message for received in iter(subscription.try_recv, None)]


def stamp_of(message: Odometry | Clock) -> float:
    return (message.clock if isinstance(message, Clock) else message.header.stamp).seconds()


def received_after(odom: Subscription[Odometry], stamp: Time | None = None) -> Odometry:
    """The next odom, of a later time if `stamp` is given."""
    while True:
        message = odom.recv().message
        if message and (stamp is None or message.header.stamp != stamp):
            return message


def test_the_scene_has_the_joints_as_joint_states_has_them(lock_step: Sim) -> None:
    """The wheels of a robot that glides turn although its odom is not read."""
    hb_bot = find("urdf", "hb_bot.urdf.xacro")
    sim = lock_step("--robot", f"{hb_bot}=Read", "--robot", f"{hb_bot}=Unread", robot="Read")
    commands, status = (
        sim.bus.publisher("Unread/cmd_vel", Twist),
        sim.bus.latest("Unread/cmd_vel_status", CommandStatus),
    )

    def is_accepted() -> bool:
        commands.put(Twist.planar(x=0.3))
        last, _ = status.read()
        return last is not None and last.accepted > 0

    wait_for(is_accepted, what="the robot to accept a command")
    sim.step(60)
    entities = sim.bus.call("get_scene", GetSceneRequest(), GetSceneReply).entities
    robot = next(entity for entity in entities if entity.name == "Unread")
    assert max(map(abs, robot.joints)) > 0.5
    without = sim.bus.call(
        "get_scene", GetSceneRequest(without_joints=True), GetSceneReply
    ).entities
    assert without == [structs.replace(entity, joints=[]) for entity in entities]
    names = sim.bus.call(
        "robot_description", RobotDescriptionRequest(robot.name), RobotDescriptionReply
    ).joints
    states = sim.bus.latest("Unread/joint_states", JointState)
    wait_for(lambda: states.count, what="joint_states")
    last, _ = states.read()
    assert last is not None
    assert dict(zip(names, robot.joints, strict=True)) == pytest.approx(
        dict(zip(last.name, last.position, strict=True))
    )
