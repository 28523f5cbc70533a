"""Robots from their files into the world: side by side, each with a name, or one line with the
reason.
"""

import argparse
from contextlib import closing
from pathlib import Path

import pytest

from holozen.bus import Bus
from holozen.robot.errors import RobotError
from holozen.robot.model import Balancing, WorldSpec
from holozen.testing import Wire, wait_for
from services.sim.entities import Entities
from services.sim.entity import Entity
from services.sim.physics.world import World
from services.sim.spawn import GAP, spawn_all

HB_BOT = Path(__file__).parents[3] / "urdf" / "hb_bot.urdf.xacro"
DRIVE = '<gazebo><plugin name="p" filename="libgazebo_ros_planar_move.so">{}</plugin></gazebo>'
INERTIA = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
LINK = '<link name="a">{}<inertial><mass value="1"/>' + INERTIA + "</inertial></link>"
BALL = '<collision><geometry><sphere radius="1"/></geometry></collision>'
MESH = '<collision><geometry><mesh filename="nothing.stl"/></geometry></collision>'

KEYS = {
    "cmd_vel",
    "odom",
    "tf",
    "joint_states",
    "joint_command",
    "cmd_vel_status",
    "resume",
    "stop",
    "release",
}


@pytest.fixture
def bus(wire: Wire) -> Bus:
    return wire.bus("sim")


def wanted(*robots: tuple[Path, str], drive: str = "") -> argparse.Namespace:
    return argparse.Namespace(robot=list(robots), package=[], drive=drive, allow_env=[])


def file(folder: Path, body: str) -> Path:
    path = folder / "robot.urdf"
    path.write_text(f'<robot name="r">{body}</robot>')
    return path


def spawn(bus: Bus, world: World, args: argparse.Namespace) -> list[Entity]:
    entities = Entities(bus, world, (5.0, 10.0))
    spawn_all(entities, args)
    return list(entities)


def keys(bus: Bus) -> set[str]:
    graph = bus.graph()
    wait_for(lambda: any(endpoint.key.endswith("_status") for endpoint in graph.endpoints()))
    return {endpoint.key for endpoint in graph.endpoints()}


def test_without_a_file_hb_bot_stands_at_the_root_of_the_keys(bus: Bus, ground: World) -> None:
    entities = Entities(bus, ground, (5.0, 10.0))
    assert spawn_all(entities, wanted()) == ["hb_bot listens on cmd_vel"]
    (entity,) = entities
    assert entity.name == "hb_bot"
    assert entity.body.pose()[0] == pytest.approx((0, 0, -0.04), abs=1e-6)
    assert keys(bus) == KEYS


def test_named_robots_have_keys_of_their_own_and_stand_side_by_side(
    bus: Bus, ground: World
) -> None:
    entities = spawn(bus, ground, wanted((HB_BOT, "Fred"), (HB_BOT, "Ann"), (HB_BOT, "")))
    places = [entity.body.pose()[0] for entity in entities]
    assert {round(x, 6) for x, _, _ in places} == {0.0}
    (_, first, _), (_, second, _), (_, third, _) = places
    assert first == pytest.approx(0, abs=1e-6)
    assert second - first == pytest.approx(third - second)
    assert second - first > 2 * 0.68 + GAP
    assert {key for key in keys(bus) if "odom" in key} == {"Fred/odom", "Ann/odom", "odom"}


def test_the_plugins_tags_name_the_topics(
    bus: Bus, ground: World, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tags = "<commandTopic>go</commandTopic><odometryTopic>where</odometryTopic>"
    spawn(bus, ground, wanted((file(tmp_path, LINK.format(BALL) + DRIVE.format(tags)), "Fred")))
    assert {"Fred/go", "Fred/where", "Fred/go_status"} <= keys(bus)
    message = capsys.readouterr().err
    use = (
        "the teleop and the controller use 'cmd_vel'; `holozen teleop --cmd-vel Fred/go` drives it"
    )
    assert f"sim: warning: {tmp_path}/robot.urdf: topic 'go': {use}\n" in message
    assert (
        f"sim: warning: {tmp_path}/robot.urdf: topic 'where': the teleop and the controller use "
        "'odom'\n" in message
    )


def test_a_namespace_in_the_file_is_as_good_as_a_name(
    bus: Bus, ground: World, tmp_path: Path
) -> None:
    tags = "<commandTopic>Ann/cmd_vel</commandTopic><odometryTopic>Ann/odom</odometryTopic>"
    spawn(bus, ground, wanted((file(tmp_path, LINK.format(BALL) + DRIVE.format(tags)), "")))
    assert keys(bus) == {f"Ann/{key}" for key in KEYS}


def test_a_second_sim_of_the_same_robot_is_refused(wire: Wire, bus: Bus, ground: World) -> None:
    first = wire.bus("first_sim")
    spawn(first, ground, wanted((HB_BOT, "Fred")))
    reported = (
        rf": Fred/odom is published by first_sim \({first.id[:6]}\) already; end that one, "
        r"or use another name"
    )
    with closing(World(WorldSpec())) as second:
        entities = Entities(bus, second, (5.0, 10.0))
        wait_for(lambda: entities.others.publish("Fred/odom"), what="the first sim to be known")
        with pytest.raises(RobotError, match=reported):
            spawn_all(entities, wanted((HB_BOT, "Fred")))
        assert len(spawn_all(entities, wanted((HB_BOT, "Ann")))) == 1


@pytest.mark.parametrize(
    ("robots", "expected"),
    [
        (["Fred", "Fred"], "2 robots are called 'Fred'; give each a name: --robot FILE=NAME"),
        (["", "Ann", ""], "2 robots have no name; give each a name: --robot FILE=NAME"),
    ],
)
def test_two_robots_of_one_name_are_refused(
    bus: Bus, ground: World, robots: list[str], expected: str
) -> None:
    with pytest.raises(RobotError) as error:
        spawn(bus, ground, wanted(*((HB_BOT, name) for name in robots)))
    assert str(error.value) == expected


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        (
            LINK.format(BALL),
            "no plugin drives it; add one, or move the whole body: --drive planar_move",
        ),
        (
            LINK.format("") + DRIVE,
            "no collision shape to stand on; give a link a <box>, <cylinder>, <sphere> or <mesh>",
        ),
    ],
    ids=["no drive", "no collision"],
)
def test_a_robot_that_cannot_be_simulated_is_refused_with_its_file(
    bus: Bus, ground: World, tmp_path: Path, body: str, expected: str
) -> None:
    path = file(tmp_path, body)
    with pytest.raises(RobotError) as error:
        spawn(bus, ground, wanted((path, "")))
    assert str(error.value) == f"{path}: {expected}"


def test_a_missing_collision_mesh_is_reported_and_a_box_carries_the_robot(
    bus: Bus, ground: World, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = file(tmp_path, LINK.format(MESH) + DRIVE)
    (entity,) = spawn(bus, ground, wanted((path, "")))
    assert "nothing.stl" in capsys.readouterr().err
    for _ in range(240):
        ground.step()
    assert entity.body.pose()[0][2] > 0.01


def test_a_robots_file_reads_an_environment_variable_only_if_it_is_allowed(
    bus: Bus, ground: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TOKEN", "secret")
    path = file(tmp_path, LINK.format(BALL) + DRIVE).rename(tmp_path / "robot.xacro")
    path.write_text(path.read_text().replace('name="r"', 'name="$(env TOKEN)"'))
    args = wanted((path, ""))
    with pytest.raises(RobotError, match="--allow-env TOKEN"):
        spawn(bus, ground, args)
    args.allow_env = ["TOKEN"]
    assert spawn(bus, ground, args)[0].name == "secret"


def test_a_robot_without_a_drive_gets_a_planar_drive_on_request(
    bus: Bus, ground: World, tmp_path: Path
) -> None:
    (entity,) = spawn(
        bus, ground, wanted((file(tmp_path, LINK.format(BALL)), "Fred"), drive="planar_move")
    )
    assert entity.model.drive is not None
    assert "Fred/cmd_vel" in keys(bus)


def test_a_robot_with_another_drive_keeps_it_which_is_reported(
    bus: Bus, ground: World, capsys: pytest.CaptureFixture[str]
) -> None:
    (entity,) = spawn(
        bus, ground, wanted((HB_BOT.with_name("wheely_boi.xacro"), "Fred"), drive="omni")
    )
    assert entity.model.drive and isinstance(entity.model.drive.mechanism, Balancing)
    assert "has a drive of its own, which is used; --drive omni is not" in capsys.readouterr().err
