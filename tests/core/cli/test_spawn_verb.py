"""`holozen spawn`: the file is read here, and the sim gets a text, a name and a pose."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import trimesh

from holozen import entities
from holozen.bus import Bus
from holozen.messages import Point, Pose, Quaternion
from holozen.robot.errors import RobotError
from holozen.robot.files.elements import read_xml
from holozen.robot.files.loading import parse
from holozen.spawning import SpawnPose, spawn_file
from holozen.testing import Wire
from holozen.transport.errors import ServiceError

from .conftest import FakeSim

Run = Callable[..., tuple[int, str, str]]
REPO = Path(__file__).parents[3]
HB_BOT = REPO / "urdf" / "hb_bot.urdf.xacro"
BALL = '<collision><geometry><sphere radius="%s"/></geometry></collision>'
INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'

MASSIVE = (
    '<link name="w"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
)


def ball(folder: Path, radius: str = "0.5", name: str = "ball", more: str = "") -> Path:
    """A robot that is a ball, without a drive."""
    path = folder / "ball.urdf"
    path.write_text(
        f'<robot name="{name}"><link name="b&amp;c">{INERTIAL}{BALL % radius}</link>{more}</robot>'
    )
    return path


def pose(sim: FakeSim, name: str) -> Pose:
    return sim.entities[name].initial_pose.pose


def place(sim: FakeSim, name: str) -> tuple[float, float, float, float]:
    at = pose(sim, name)
    return at.position.x, at.position.y, at.position.z, at.orientation.yaw()


def test_a_robot_is_sent_under_its_name_and_put_on_the_ground(sim: FakeSim, run: Run) -> None:
    assert run("spawn", HB_BOT, "--name", "Fred") == (0, "Fred listens on Fred/cmd_vel\n", "")
    assert place(sim, "Fred") == pytest.approx((0, 0, -0.04, 0))
    text = sim.entities["Fred"].resource_string
    assert parse(text, Path("/elsewhere")).drive is not None and "${" not in text


def test_a_height_that_is_in_the_ground_is_a_warning(
    sim: FakeSim, run: Run, tmp_path: Path
) -> None:
    hops = (
        "holozen spawn: warning: at -z 0.1 it is 0.400 m deep in the ground, which pushes it "
        "out; without -z it "
    )
    assert run("spawn", ball(tmp_path), "-z", "0.1")[2] == f"{hops}stands on the ground\n"
    for number, z in enumerate(["0.499", "0.6"]):
        assert run("spawn", ball(tmp_path), "-z", z, "--name", f"ball{number}")[2] == ""
    still = ball(tmp_path, name="wall", more="<gazebo><static>true</static></gazebo>")
    assert run("spawn", still, "-z", "0")[2] == ""


@pytest.mark.parametrize(("namespace", "key"), [("/", "cmd_vel"), ("lab", "lab/cmd_vel")])
@pytest.mark.parametrize("flag", ["--namespace", "-robot_namespace"])
def test_its_keys_may_be_elsewhere(
    sim: FakeSim, run: Run, flag: str, namespace: str, key: str
) -> None:
    assert run("spawn", HB_BOT, "--name", "Fred", flag, namespace) == (
        0,
        f"Fred listens on {key}\n",
        "",
    )
    assert sim.entities["Fred"].entity_namespace == namespace


def test_without_a_name_it_has_that_of_its_file(sim: FakeSim, run: Run, tmp_path: Path) -> None:
    assert run("spawn", ball(tmp_path)) == (0, "ball stands at 0.000 0.000 0.500\n", "")
    assert list(sim.entities) == ["ball"]


def test_as_json_it_has_name_key_and_pose(sim: FakeSim, run: Run, tmp_path: Path) -> None:
    listening, standing = (
        run("spawn", file, "--json", "-x", "1")[1] for file in (HB_BOT, ball(tmp_path))
    )
    output = json.loads(listening)
    assert (output["name"], output["key"], output["hint"]) == ("hb_bot", "hb_bot/cmd_vel", "")
    assert (output["pose"]["position"]["x"], json.loads(standing)["key"]) == (1.0, "")
    assert listening.count("\n") == standing.count("\n") == 1


def test_it_goes_where_it_is_commanded(sim: FakeSim, run: Run, tmp_path: Path) -> None:
    code, out, _ = run("spawn", ball(tmp_path), "-x", "1", "-y", "-2", "-z", "-0.5", "-Y", "1.5")
    assert (code, out) == (0, "ball stands at 1.000 -2.000 -0.500\n")
    assert place(sim, "ball") == pytest.approx((1, -2, -0.5, 1.5))
    assert run("spawn", ball(tmp_path), "-x", "-1e-3", "-y", "-.5", "-z=-0", "--name", "b")[0] == 0
    assert place(sim, "b") == pytest.approx((-0.001, -0.5, 0, 0))


def test_an_object_of_an_sdf_file_goes_where_its_file_places_it(
    sim: FakeSim, run: Run, tmp_path: Path
) -> None:
    path = tmp_path / "crate.sdf"
    box = '<collision name="c"><geometry><box><size>1 1 1</size></box></geometry></collision>'
    link = f'<link name="a"><inertial><mass>1</mass></inertial>{box}</link>'
    path.write_text(
        f'<sdf version="1.6"><model name="crate"><pose>1 2 3 0 0 0.5</pose>{link}</model></sdf>'
    )
    assert run("spawn", path)[:2] == (0, "crate stands at 1.000 2.000 3.000\n")
    assert place(sim, "crate") == pytest.approx((1, 2, 3, 0.5))
    run("spawn", path, "-y", "0", "-z", "0.5", "--drive", "planar_move", "--name", "b")
    assert place(sim, "b") == pytest.approx((1, 0, 0.5, 0.5))
    assert parse(sim.entities["b"].resource_string, Path("/elsewhere")).drive is not None


def test_a_turned_robot_stands_on_what_is_then_its_lowest_point(
    sim: FakeSim, run: Run, tmp_path: Path
) -> None:
    path = tmp_path / "box.urdf"
    box = '<collision><geometry><box size="1 2 3"/></geometry></collision>'
    path.write_text(f'<robot name="box"><link name="a">{INERTIAL}{box}</link></robot>')
    for flags, height in (
        ((), 1.5),
        (("-R", math.pi / 2), 1.0),
        (("-P", math.pi / 2), 0.5),
        (("-Y", 1), 1.5),
    ):
        assert run("spawn", path, "--replace", *flags, "-x", 0)[0] == 0
        assert pose(sim, "box").position.z == pytest.approx(height)


@pytest.mark.parametrize(
    "words",
    [("-urdf", "-file", HB_BOT, "-model", "Fred"), ("-file", HB_BOT, "-entity", "Fred", "-x", "0")],
)
def test_the_words_of_spawn_model_and_spawn_entity_are_understood(
    sim: FakeSim, run: Run, words: tuple[str, ...]
) -> None:
    assert run("spawn", *words)[0] == 0
    assert list(sim.entities) == ["Fred"]


def test_values_of_xacro_args_may_stand_anywhere(sim: FakeSim, run: Run, tmp_path: Path) -> None:
    path = tmp_path / "ball.xacro"
    link = f'<link name="a">{INERTIAL}{BALL % "$(arg r)"}</link>'
    path.write_text(
        '<robot name="b" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="r" '
        f'default="1"/>{link}</robot>'
    )
    for words in (
        (path, "r:=2", "--name", "a"),
        ("r:=2", path, "--name", "b"),
        (path, "--name", "c", "r:=2"),
    ):
        assert run("spawn", *words)[0] == 0
    assert {pose(sim, name).position.z for name in "abc"} == {2}


def test_a_value_that_the_file_does_not_ask_for_is_a_warning(
    sim: FakeSim, run: Run, tmp_path: Path
) -> None:
    path = ball(tmp_path)
    code, _, err = run("spawn", path, "radius:=2")
    assert (code, list(sim.entities)) == (0, ["ball"])
    warning = f"{path}: there is no argument 'radius'; its arguments are: none"
    assert err == f"holozen spawn: warning: {warning}\n"


@pytest.mark.parametrize("gravity", ["true", "false"])
def test_a_body_without_collision_shape_falls_only_by_gravity(
    sim: FakeSim, run: Run, tmp_path: Path, gravity: str
) -> None:
    path = tmp_path / "ghost.urdf"
    tag = f'<gazebo reference="w"><gravity>{gravity}</gravity></gazebo>'
    path.write_text(f'<robot name="ghost">{MASSIVE}{tag}</robot>')
    assert ("falls through the ground" in run("spawn", path)[2]) == (gravity == "true")


def test_a_robot_without_a_drive_gets_one_when_asked(
    sim: FakeSim, run: Run, tmp_path: Path
) -> None:
    assert run("spawn", ball(tmp_path), "--drive", "planar_move") == (
        0,
        "ball listens on ball/cmd_vel\n",
        "",
    )
    drive = parse(sim.entities["ball"].resource_string, Path("/elsewhere")).drive
    assert drive is not None and drive.robot_base_frame == "b&c"


def test_a_robot_with_a_drive_keeps_it(sim: FakeSim, run: Run) -> None:
    code, out, err = run("spawn", HB_BOT, "--name", "Fred", "--drive", "planar_move")
    assert (code, out) == (0, "Fred listens on Fred/cmd_vel\n")
    assert (
        err == f"holozen spawn: warning: {HB_BOT}: has a drive of its own, which is used; --drive "
        "planar_move is not\n"
    )
    assert sim.entities["Fred"].resource_string.count("planar_move") == parse_count(HB_BOT)


def parse_count(path: Path) -> int:
    return path.read_text().count("planar_move")


def test_collision_meshes_travel_in_the_text(sim: FakeSim, run: Run, tmp_path: Path) -> None:
    trimesh.creation.box((1, 2, 3)).export(tmp_path / "box.stl")
    mesh = '<collision><geometry><mesh filename="package://p/box.stl"/></geometry></collision>'
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="r"><link name="a">{INERTIAL}{mesh}</link></robot>')
    assert run("spawn", path, "--package", f"p={tmp_path}") == (
        0,
        "r stands at 0.000 0.000 1.500\n",
        "",
    )
    tag = next(read_xml(sim.entities["r"].resource_string, "sent").below("mesh"))
    assert tag.attributes["filename"].startswith("data:model/stl;base64,")


LOST = (
    '<link name="l"><collision><geometry><mesh filename="gone.stl"/></geometry></collision></link>'
)
LOST += '<joint name="j" type="fixed"><parent link="b&amp;c"/><child link="l"/></joint>'


def test_warnings_are_reported_here_once_with_their_line_and_are_errors_in_strict(
    sim: FakeSim, run: Run, tmp_path: Path
) -> None:
    path = ball(tmp_path, more=LOST)
    code, _, err = run("spawn", path)
    assert code == 0
    assert err.startswith(
        f"holozen spawn: warning: {path}, line 1: <mesh> of <link name='l'> (collision) is "
        "replaced by a box"
    )
    assert err.count("\n") == err.count("gone.stl': ") + 1 == 1
    code, _, err = run("spawn", path, "--name", "b", "--strict")
    assert code == 1 and err.startswith(
        f"holozen spawn: {path}, line 1: <mesh> of <link name='l'> (collision): no such"
    )
    assert list(sim.entities) == ["ball"]


def test_a_wrong_file_is_reported_and_no_request_is_sent(
    sim: FakeSim, run: Run, tmp_path: Path
) -> None:
    (tmp_path / "broken.urdf").write_text("<robot>\n<link")
    sim.put("Fred")
    for name, expected in (
        ("gone.urdf", "No such file"),
        ("broken.urdf", "line 2: broken XML"),
        (".", "Is a directory"),
    ):
        code, out, err = run("spawn", tmp_path / name, "--name", "Fred", "--replace")
        assert (code, out, err.count("\n")) == (1, "", 1)
        assert err.startswith(f"holozen spawn: {tmp_path}") and expected in err
    assert sim.log == []


def test_an_illegal_name_is_refused(sim: FakeSim, run: Run, tmp_path: Path) -> None:
    code, _, err = run("spawn", HB_BOT, "--name", "a/b")
    assert code == 2 and "robot name 'a/b': use a letter" in err
    code, _, err = run("spawn", ball(tmp_path, name="my robot"))
    assert code == 1
    assert err.startswith(
        f"holozen spawn: {tmp_path}/ball.urdf: robot name 'my robot': use a letter"
    )
    assert err.endswith("; give one with --name\n")


@pytest.mark.parametrize(
    "words",
    [
        (),
        ("a.urdf", "b.urdf"),
        ("a:=1",),
        ("a.urdf", ":=1"),
        ("a.urdf", "-x", "far"),
        ("a.urdf", "-z", "nan"),
    ],
)
def test_words_without_meaning_are_wrong_usage(run: Run, words: tuple[str, ...]) -> None:
    code, out, err = run("spawn", *words)
    assert (code, out, err.count("\n")) == (2, "", 1) and err.startswith("holozen spawn: ")


def test_what_the_sim_refuses_is_reported_with_its_reason(
    sim: FakeSim, run: Run, tmp_path: Path
) -> None:
    sim.put("ball")
    expected = "there is an entity 'ball' already; --replace takes its place, --name gives another"
    assert run("spawn", ball(tmp_path)) == (1, "", f"holozen spawn: {expected}\n")


def test_a_robot_with_wheels_and_no_drive_is_reported_with_how_to_move_it(
    sim: FakeSim, run: Run, tmp_path: Path
) -> None:
    joint = '<joint name="j" type="continuous"><parent link="b&amp;c"/><child link="w"/></joint>'
    path = ball(tmp_path, more=MASSIVE + joint)
    assert "nothing drives it: spawn it with --drive planar_move" in run("spawn", path)[1]
    assert "listens on" in run("spawn", path, "--drive", "planar_move", "--replace")[1]


@pytest.mark.parametrize("flag", ["-R", "-P", "-Y"])
def test_angles_in_degrees_are_refused(run: Run, tmp_path: Path, flag: str) -> None:
    code, _, err = run("spawn", ball(tmp_path), flag, "90")
    assert (code, "use a number from -6.2832 to 6.2832 rad" in err) == (2, True)


def test_a_fleet_for_which_the_sim_has_no_room_is_refused_as_a_whole(
    sim: FakeSim, run: Run, tmp_path: Path
) -> None:
    sim.put("Fred")
    for count in (1000, 10_000_000):
        expected = (
            f"--count {count} is too many: a sim holds 1000 entities, and there are 1 in 1 "
            "sim; `holozen up --shards"
        )
        code, out, err = run("spawn", ball(tmp_path), "--count", count)
        assert (code, out, err.count("\n")) == (1, "", 1) and err.startswith(
            f"holozen spawn: {expected}"
        )
    assert sim.log == []


def test_after_ctrl_c_it_reports_how_much_of_a_fleet_there_is(
    sim: FakeSim, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spawn = entities.spawn

    def interrupted(bus: Bus, name: str, *rest: Any) -> tuple[str, list[str]]:
        if name == "bot3":
            raise KeyboardInterrupt
        return spawn(bus, name, *rest)

    monkeypatch.setattr(entities, "spawn", interrupted)
    expected = (
        "holozen spawn: spawned 3 of 9 (bot0 .. bot2); `holozen delete 'bot[0-9]*'` removes them\n"
    )
    assert run("spawn", ball(tmp_path), "--count", 9) == (130, "", expected)


def test_without_a_sim_it_explains_how_to_start_one(
    wire: Wire, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("holozen.entities.NOTICE", 0.2)
    why = f"no nodes found at {wire.endpoint}"
    expected = f"no sim answered within 0.2 s: {why}; start one in another terminal: holozen sim"
    assert run("spawn", ball(tmp_path)) == (1, "", f"holozen spawn: {expected}\n")
    assert (
        run("spawn", ball(tmp_path), "-timeout", "0.1")[2]
        == f"holozen spawn: {expected.replace('0.2', '0.1')}\n"
    )
    assert run("list") == (1, "", f"holozen list: {expected}\n")
    assert run("delete", "Fred", "Bob") == (1, "", f"holozen delete: {expected}\n")


def test_replaced_it_keeps_its_place(sim: FakeSim, run: Run, tmp_path: Path) -> None:
    sim.put("ball", 1, 2, 7, Quaternion(0, 0, math.sin(0.5), math.cos(0.5)))
    assert run("spawn", ball(tmp_path), "--replace")[0] == 0
    assert place(sim, "ball") == pytest.approx((1, 2, 7, 1))
    assert sim.log == ["spawn", "delete", "spawn"]


def test_replaced_by_a_larger_one_it_is_lifted_out_of_the_ground(
    sim: FakeSim, run: Run, tmp_path: Path
) -> None:
    sim.put("ball", 1, 2, 0.5)
    run("spawn", ball(tmp_path, "0.8"), "--replace")
    assert place(sim, "ball") == pytest.approx((1, 2, 0.8, 0))


def test_replaced_with_a_place_it_goes_there(sim: FakeSim, run: Run, tmp_path: Path) -> None:
    sim.put("ball", 1, 2, 7)
    run("spawn", ball(tmp_path), "--replace", "-x", "3")
    assert place(sim, "ball") == pytest.approx((3, 0, 0.5, 0))


def test_replace_without_an_old_one_is_a_plain_spawn(
    sim: FakeSim, run: Run, tmp_path: Path
) -> None:
    assert run("spawn", ball(tmp_path), "--replace")[0] == 0
    assert sim.log == ["spawn"]


def test_a_robot_that_the_sim_refuses_leaves_the_old_one_where_it_is(
    sim: FakeSim, run: Run, tmp_path: Path
) -> None:
    sim.put("ball")
    sim.refusal = "too heavy"
    assert run("spawn", ball(tmp_path), "--replace")[2] == "holozen spawn: too heavy\n"
    assert sim.log == ["spawn"] and list(sim.entities) == ["ball"]


def test_what_the_sim_replaced_is_printed_and_what_was_known_before_is_not(
    sim: FakeSim, run: Run, tmp_path: Path
) -> None:
    gone = (
        '<link name="m"><collision><geometry><mesh '
        'filename="gone.stl"/></geometry></collision></link>'
    )
    joint = '<joint name="j" type="fixed"><parent link="b&amp;c"/><child link="m"/></joint>'
    replaced = (
        "resource_string, line 9: <mesh> of <link name='{}'> (collision) is replaced by a "
        "box of 0.1 x 0.1 x 0.1 m: no"
    )
    sim.warnings = "\n".join([replaced.format("m"), replaced.format("n")])
    code, out, err = run("spawn", ball(tmp_path, more=gone + joint))
    assert (code, out) == (0, "ball stands at 0.000 0.000 0.500\n")
    first, second = err.splitlines()
    assert first.startswith(
        f"holozen spawn: warning: {tmp_path}/ball.urdf, line 1: <mesh> of <link name='m'> "
        "(collision) is"
    )
    assert second == f"holozen spawn: warning: the sim: {replaced.format('n')}"


def test_from_python_a_file_is_spawned_and_replaced(
    sim: FakeSim, wire: Wire, tmp_path: Path
) -> None:
    bus: Bus = wire.bus("watch")
    assert (
        str(spawn_file(bus, ball(tmp_path), "Fred", SpawnPose(x=1)))
        == "Fred stands at 1.000 0.000 0.500"
    )
    with pytest.raises(ServiceError, match="there is an entity 'Fred' already"):
        spawn_file(bus, ball(tmp_path), "Fred")
    assert (
        str(spawn_file(bus, ball(tmp_path, "0.6"), "Fred", replace=True))
        == "Fred stands at 1.000 0.000 0.600"
    )
    with pytest.raises(RobotError):
        spawn_file(bus, ball(tmp_path, "0"), "Fred", replace=True)
    assert pose(sim, "Fred").position == Point(1, 0, 0.6)
