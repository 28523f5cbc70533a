"""hb_bot as students keep and write it: a folder called anything, tags of ROS 1 and ROS 2, wheels anywhere."""

import math
from pathlib import Path

import pytest

from holozen.robot.drives import Drive
from holozen.robot.model import load

REPO = Path(__file__).parents[3]
PLACES = ((0.0, 0.68), (-0.58, -0.36), (0.58, -0.36))

ROS_1 = """
    <plugin name="object_controller" filename="libgazebo_ros_planar_move.so">
      <commandTopic>cmd_vel</commandTopic>
      <odometryTopic>odom</odometryTopic>
      <odometryFrame>odom</odometryFrame>
      <odometryRate>50.0</odometryRate>
      <robotBaseFrame>{frame}</robotBaseFrame>
    </plugin>"""
ROS_2 = """
    <plugin name="object_controller" filename="libgazebo_ros_planar_move.so">
      <ros>
        <namespace>/</namespace>
        <remapping>cmd_vel:=/cmd_vel</remapping>
        <remapping>odom:=odom</remapping>
      </ros>
      <update_rate>100</update_rate>
      <publish_rate>50</publish_rate>
      <publish_odom>true</publish_odom>
      <publish_odom_tf>true</publish_odom_tf>
      <odometry_frame>odom</odometry_frame>
      <robot_base_frame>{frame}</robot_base_frame>
    </plugin>"""
MIXED = """
    <plugin name="object_controller" filename="libgazebo_ros_planar_move.so">
      <ros><remapping>/cmd_vel:=cmd_vel</remapping></ros>
      <commandTopic>cmd_vel</commandTopic>
      <odometry_frame>odom</odometry_frame>
      <odometryRate> 50 </odometryRate>
      <robotBaseFrame>{frame}</robotBaseFrame>
    </plugin>"""

INERTIAL = """
    <inertial>
      <origin xyz="0 0  0"/>
      <mass value ="{mass}"/>
      <inertia ixx="{moment}" iyy= "{moment}" izz = "{moment}" ixy="0" ixz="0" iyz="0"/>
    </inertial>"""


def mesh(file: str, package: str) -> str:
    return f'<mesh filename="file://$(find {package})/meshes/{file}" scale="0.01  0.01 0.01"/>'


def wheel(name: str, place: tuple[float, float], axis: str, package: str) -> str:
    x, y = place
    return f"""
  <link name ="{name}">{INERTIAL.format(mass=0.06, moment=1.8e-4)}
    <visual><geometry>{mesh("wheel.stl", package)}</geometry></visual>
    <collision><origin rpy="1.5708 0 0"/><geometry><cylinder length="0.13"  radius="0.14"/></geometry></collision>
  </link>
  <joint name="{name}_joint" type="continuous">
    <origin xyz="{x} {y} 0.18"  rpy="0 0 ${{atan2({-x}, {y})}}"/>
    <parent link="chassis"/><child link="{name}"/>
    <axis xyz="{axis}"/><limit effort="5" velocity ="5"/>
  </joint>
  <gazebo reference="{name}"><material>Gazebo/Black</material></gazebo>"""


def hb_bot(
    package: str = "holo",
    plugin: str = ROS_1,
    frame: str = "footprint_link",
    names: tuple[str, str, str] = ("front", "left", "right"),
    turn: float = 0.0,
    axis: str = "0 1 0",
    extra: str = "",
) -> str:
    """The lesson's robot, its wheels turned by `turn` (rad) about the middle."""
    cosine, sine = math.cos(turn), math.sin(turn)
    places = [(round(cosine * x - sine * y, 6), round(sine * x + cosine * y, 6)) for x, y in PLACES]
    wheels = "".join(wheel(name, place, axis, package) for name, place in zip(names, places, strict=True))
    return f"""<?xml version="1.0"?>
<robot name ="hb_bot" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <!-- chasis -->
  <link name="footprint_link"/>
  <joint name="footprint_joint" type="fixed">
    <parent link="footprint_link"/>
    <child link="chassis"/>
  </joint>
  <link name="chassis">{INERTIAL.format(mass=0.28, moment=0.011)}
    <visual><geometry>{mesh("base.dae", package)}</geometry></visual>
    <collision><geometry><cylinder radius="0.6" length="0.22"/></geometry></collision>
  </link>{wheels}
  {extra}
  <gazebo>{plugin.format(frame=frame)}
  </gazebo>
</robot>
"""


def workspace(home: Path, folder: str, text: str, package_xml: str | None = None, ends: str = "\n") -> Path:
    """A package's folder with the lesson's meshes and the robot's file, whose path is returned."""
    root = home / folder
    (root / "urdf").mkdir(parents=True)
    (root / "meshes").mkdir()
    for name in ("base.dae", "wheel.stl"):
        (root / "meshes" / name).symlink_to(REPO / "meshes" / name)
    if package_xml:
        (root / "package.xml").write_text(f"<package><name>{package_xml}</name></package>")
    path = root / "urdf" / "hb_bot.urdf.xacro"
    path.write_bytes(text.replace("\n", ends).encode())
    return path


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
