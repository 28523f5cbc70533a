"""For each rule, a wrong example and the right one."""

from typing import NamedTuple


class Example(NamedTuple):
    """Two versions of a part of a robot file: the rule finds something in `wrong`, and nothing in
    `right`.
    """

    wrong: str
    right: str


_MASS = '<mass value="2"/>'
_MOMENTS = '<inertia ixx="0.009" ixy="0" ixz="0" iyy="0.017" iyz="0" izz="0.024"/>'
_INERTIAL = f"<inertial>{_MASS}{_MOMENTS}</inertial>"
_LEFT = (
    '<parent link="base"/><child link="left_wheel"/><origin xyz="0.05 0.12 0"/><axis xyz="0 1 0"/>'
)
_SHAPE = '<origin rpy="1.5708 0 0"/><geometry><cylinder radius="0.05" length="0.03"/></geometry>'
_LIMIT = '<limit lower="-1" upper="1" effort="5" velocity="2"/>'
_AXIS = '<axis xyz="0 1 0"/>'
_DRIVE = '<plugin name="drive" filename="libgazebo_ros_diff_drive.so">'
_BODY = '<origin xyz="0 0 0.02"/><geometry><box size="0.3 0.2 0.1"/></geometry>'
_JOINTS = "<leftJoint>left_joint</leftJoint><rightJoint>right_joint</rightJoint>"
_BLUE = '<material name="blue"><color rgba="0 0 1 1"/></material>\n'
_MARK = '<visual><geometry><sphere radius="0.01"/></geometry><material name="blue"/></visual>'
_TIP = '<xacro:macro name="{}" params="name"><link name="${{name}}"/></xacro:macro>\n'
_BOX = (
    '<link name="box"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" '
    'iyz="0"/></inertial>'
    "\n  <{0}><geometry>"
    '<box size="1 1 1"/></geometry></{0}></link>'
)
_TIP_BOX = '<link name="tip"><visual><geometry><box size="{}"/></geometry></visual></link>'
_MESH = '<mesh filename="{}" scale="{}"/>'
_ONE = "1 1 1"

EXAMPLES = {
    "file": Example('<link name="arm"', '<link name="arm">'),
    "load": Example('<sphere radius="-0.015"/>', '<sphere radius="0.015"/>'),
    "load-note": Example("<robotBaseFrame>/robot/footprint<", "<robotBaseFrame>footprint<"),
    "xml": Example('<!-- a -- b --><link name="arm">', '<!-- a, b --><link name="arm">'),
    "tag": Example(
        '<colision><origin xyz="0 0 0.1"/><geometry><box size="0.02 0.02 '
        '0.2"/></geometry></colision>',
        '<collision><origin xyz="0 0 0.1"/><geometry><box size="0.02 0.02 '
        '0.2"/></geometry></collision>',
    ),
    "attribute": Example(_MOMENTS.replace("iyz", "ivz"), _MOMENTS),
    "place": Example(f'{_INERTIAL}<mass value="2"/>', _INERTIAL),
    "ignored": Example('<joint_properties damping="1"/>', '<dynamics damping="1"/>'),
    "joint-type": Example(
        '<joint name="arm_joint" type="revolut">', '<joint name="arm_joint" type="revolute">'
    ),
    "number": Example('<origin xyz="0 0 5cm"/>', '<origin xyz="0 0 0.05"/>'),
    "twice": Example('<link name="ball"/>  <!-- as another one -->', '<link name="tip"/>'),
    "no-link": Example(
        '<parent link="amr"/><child link="thumb"/>', '<parent link="arm"/><child link="thumb"/>'
    ),
    "gazebo-link": Example('<gazebo reference="lef_wheel">', '<gazebo reference="left_wheel">'),
    "tree": Example(
        '<parent link="ball"/><child link="base"/>  <!-- base carries ball -->',
        '<parent link="footprint"/><child link="base"/>',
    ),
    "colour": Example('<material name="ornge"/>', '<material name="orange"/>'),
    "unused-colour": Example(
        f'{_BLUE}<link name="footprint"/>', f'{_BLUE}<link name="footprint">{_MARK}</link>'
    ),
    "macro-twice": Example(
        _TIP.format("tip") + _TIP.format("tip"), _TIP.format("tip") + _TIP.format("top")
    ),
    "unused": Example(
        '<xacro:property name="tip_radius" value="0.015"/> <sphere radius="0.015"/>',
        '<xacro:property name="tip_radius" value="0.015"/> <sphere radius="${tip_radius}"/>',
    ),
    "limit": Example(_AXIS, f"{_AXIS}\n    {_LIMIT}"),
    "limit-range": Example('<limit lower="1" upper="-1" effort="5" velocity="2"/>', _LIMIT),
    "limit-effort": Example('<limit lower="-1" upper="1" effort="0" velocity="2"/>', _LIMIT),
    "mimic": Example('<mimic joint="fingr_joint"/>', '<mimic joint="finger_joint"/>'),
    "degrees": Example(
        '<limit lower="-90" upper="90" effort="5" velocity="2"/>',
        '<limit lower="${-pi/2}" upper="${pi/2}" effort="5" velocity="2"/>',
    ),
    "no-inertia": Example('<link name="base">', f'<link name="base">\n    {_INERTIAL}'),
    "mass": Example('<mass value="-2"/>', _MASS),
    "massless": Example('<mass value="0"/>', _MASS),
    "heavy": Example(
        '<mass value="2000"/><inertia ixx="9" ixy="0" ixz="0" iyy="17" iyz="0" izz="24"/>',
        _MASS + _MOMENTS,
    ),
    "inertia": Example(_MOMENTS.replace('izz="0.024"', 'izz="0.24"'), _MOMENTS),
    "inertia-part": Example(
        _MOMENTS.replace(' ixy="0" ixz="0"', "").replace(' iyz="0"', ""), _MOMENTS
    ),
    "inertia-size": Example('<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>', _MOMENTS),
    "floating": Example(
        '<gazebo reference="base"><gravity>false</gravity></gazebo>',
        '<gazebo reference="base"><gravity>true</gravity></gazebo>',
    ),
    "no-collision": Example(_BOX.format("visual"), _BOX.format("collision")),
    "wheel-collision": Example(f"<visual>{_SHAPE}</visual>", f"<collision>{_SHAPE}</collision>"),
    "wheel-axis": Example(_LEFT.replace("0 1 0", "1 0 0"), _LEFT),
    "wheel-height": Example(_LEFT.replace("0.12 0", "0.12 0.02"), _LEFT),
    "wheel-load": Example(
        f"<collision>{_BODY.replace('0.02', '0')}</collision>", f"<collision>{_BODY}</collision>"
    ),
    "overlap": Example(_LEFT.replace("0.12", "0.09"), _LEFT),
    "wheel-side": Example(
        "<leftJoint>right_joint</leftJoint><rightJoint>left_joint</rightJoint>", _JOINTS
    ),
    "wheel-forward": Example(_LEFT.replace("0 1 0", "0 -1 0"), _LEFT),
    "wheel-measure": Example(
        "<wheelSeparation>0.12</wheelSeparation>", "<wheelSeparation>0.24</wheelSeparation>"
    ),
    "plugin-name": Example(_DRIVE.replace("diff", "dif"), _DRIVE),
    "plugin": Example(f'<plugin name="mine" filename="libmy_magic.so"/> {_DRIVE}', _DRIVE),
    "plugin-link": Example("<robotBaseFrame>fotprint<", "<robotBaseFrame>footprint<"),
    "plugin-joint": Example(_JOINTS.replace("left_j", "lft_j"), _JOINTS),
    "two-drives": Example(
        f'<plugin name="move" filename="libgazebo_ros_planar_move.so"/> {_DRIVE}', _DRIVE
    ),
    "no-drive": Example(
        '<plugin name="control" filename="libgazebo_ros2_control.so"/>',
        f"{_DRIVE}{_JOINTS}</plugin>",
    ),
    "static": Example(
        "<gazebo><static>true</static></gazebo>", "<gazebo><static>false</static></gazebo>"
    ),
    "mesh": Example(_MESH.format("meshes/bdy.stl", _ONE), _MESH.format("meshes/body.stl", _ONE)),
    "mesh-path": Example(
        _MESH.format("file:///home/asha/ws/meshes/body.stl", _ONE),
        _MESH.format("meshes/body.stl", _ONE),
    ),
    "mesh-empty": Example(
        f"{_MESH.format('meshes/empty.stl', _ONE)}  <!-- a file of 0 bytes -->",
        _MESH.format("meshes/body.stl", _ONE),
    ),
    "mesh-unit": Example(
        f"{_MESH.format('meshes/in_mm.stl', _ONE)}  <!-- drawn in millimetres -->",
        _MESH.format("meshes/in_mm.stl", "0.001 0.001 0.001"),
    ),
    "robot-unit": Example(
        f"{_TIP_BOX.format('30 20 10')}  <!-- in millimetres -->", _TIP_BOX.format("0.03 0.02 0.01")
    ),
    "fits": Example(
        '<visual><geometry><box size="0.5 0.2 0.1"/></geometry>  <!-- where 0.4 x 0.3 m are asked '
        "for -->",
        '<visual><geometry><box size="0.3 0.2 0.1"/></geometry>',
    ),
    "require-file": Example("links base", "link base"),
    "require": Example("link bsae  # there is a link base", "link base"),
}
