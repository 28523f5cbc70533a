"""hb_bot as students keep and write it: a folder called anything, tags of ROS 1 and ROS 2, wheels
anywhere.
"""

import math
from pathlib import Path

REPO = Path(__file__).parents[1]
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
  <gazebo reference="{name}"><material>Gazebo/Black</material></gazebo>"""  # noqa: E501


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
    wheels = "".join(
        wheel(name, place, axis, package) for name, place in zip(names, places, strict=True)
    )
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


def workspace(
    home: Path, folder: str, text: str, package_xml: str | None = None, ends: str = "\n"
) -> Path:
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
