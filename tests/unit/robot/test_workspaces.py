"""hb_bot as students keep and write it: a folder called anything, tags of ROS 1 and ROS 2, wheels anywhere."""

import math
from pathlib import Path

import pytest

from holozen.robot.drives import Drive
from holozen.robot.model import load
from tests.students import MIXED, ROS_1, ROS_2, hb_bot, workspace

DRIVE = Drive(odometry_rate=50, robot_base_frame="footprint_link")


@pytest.mark.parametrize(
    ("folder", "package", "named"),
    [
        ("holo", "holo", False),
        ("eyrc_hb", "holo", True),
        ("my workspace/src/hb_task_1b", "hb_task_1b", True),
        ("Übung-3", "hb_task_1b", False),
    ],
)
@pytest.mark.parametrize("plugin", [ROS_1, ROS_2, MIXED], ids=["ROS 1", "ROS 2", "mixed"])
def test_a_workspace_called_anything_loads_without_a_word(
    home: Path, folder: str, package: str, named: bool, plugin: str
) -> None:
    path = workspace(home, folder, hb_bot(package, plugin), package if named else None)
    model = load(path)
    assert (model.warnings, model.drive, len(model.links)) == ((), DRIVE, 5)
    assert {shape.path for link in model.links.values() for shape in link.visuals} == {
        path.parents[1] / "meshes" / "base.dae",
        path.parents[1] / "meshes" / "wheel.stl",
    }


@pytest.mark.parametrize(
    ("turn", "axis", "names"),
    [
        (0.0, "0 -1  0", ("w1", "w2", "w3")),
        (1.0, "0 0 1", ("right_wheel", "Left-Wheel", "wheel 3")),
        (-2.5, "1 0 0", ("a", "b", "c")),
        (math.pi, "0 1 0", ("left", "front", "right")),
    ],
)
def test_wheels_may_stand_anywhere_turn_either_way_and_have_any_name(
    home: Path, turn: float, axis: str, names: tuple[str, str, str]
) -> None:
    model = load(workspace(home, "ws", hb_bot(names=names, turn=turn, axis=axis)))
    assert (model.warnings, model.drive) == ((), DRIVE)
    assert {f"{name}_joint" for name in names} <= set(model.joints)
    assert all(model.links[name].visuals[0].color == (0, 0, 0, 1) for name in names)


@pytest.mark.parametrize("ends", ["\r\n", "\n"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_a_file_saved_on_windows_loads_as_well(home: Path, ends: str, mark: str) -> None:
    assert load(workspace(home, "ws", mark + hb_bot(), ends=ends)).warnings == ()


@pytest.mark.parametrize(
    ("mistake", "told"),
    [
        (
            {"frame": "chasis"},
            "<plugin name='object_controller'> names the base frame 'chasis', which is no link; "
            "'footprint_link' is used",
        ),
        (
            {"extra": '<gazebo reference="chasis"><mu1>1</mu1></gazebo>'},
            "<gazebo> of <robot name='hb_bot'> reference='chasis' names no link and no joint; "
            "the nearest is 'chassis'; it is left out; "
            "the links there are: chassis, footprint_link, front, left, right",
        ),
        (
            {"extra": '<gazebo reference="chassis"><material>Gazebo/Organe</material></gazebo>'},
            "<material> of <robot name='hb_bot'> names the colour 'Gazebo/Organe', which Gazebo does not know; "
            "the nearest is 'Gazebo/Orange'",
        ),
        (
            {"extra": '<gazebo><plugin name="c" filename="libgazebo_ros_control.so"/></gazebo>'},
            "<plugin name='c'> (libgazebo_ros_control.so) is not run here; "
            "joint_states is published anyway, and joints obey joint_command",
        ),
        (
            {"extra": '<gazebo reference="chassis"><sensor type="camera" name="eye"/></gazebo>'},
            "<sensor name='eye'> (camera) is not simulated yet",
        ),
        (
            {"extra": '<transmission name="t"><joint name="font_joint"/></transmission>'},
            "<transmission name='t'> names the joint 'font_joint', which is not there; the nearest is 'front_joint'; "
            "it is left out",
        ),
        (
            {
                "extra": '<link name="caster"/><joint name="c" type="continuous"><parent link="chassis"/>'
                '<child link="caster"/></joint>'
            },
            "<link name='caster'> has no mass, so it is left out, as in Gazebo, with the joint 'c'; "
            "give it an <inertial>",
        ),
    ],
)
def test_a_mistake_that_people_make_is_told_in_one_line_and_the_robot_drives(
    home: Path, mistake: dict[str, str], told: str
) -> None:
    path = workspace(home, "ws", hb_bot(**mistake))  # type: ignore[arg-type]
    model = load(path)
    assert model.drive == DRIVE
    (warning,) = model.warnings
    place, _, problem = warning.partition(": ")
    assert place.startswith(f"{path} (as `holozen xacro` prints it), line ")
    assert problem == told


def test_a_second_plugin_of_the_lesson_is_told(home: Path) -> None:
    model = load(workspace(home, "ws", hb_bot(plugin=ROS_1 + ROS_2)))
    assert model.drive == DRIVE
    (warning,) = model.warnings
    assert warning.endswith("<plugin name='object_controller'> is a second drive; only the first one drives")
