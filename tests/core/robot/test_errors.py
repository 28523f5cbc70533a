"""Messages stay short, however long the words of the file are."""

from pathlib import Path

from holozen.robot.errors import MAX_MESSAGE, RobotError
from holozen.robot.files.loading import parse
from holozen.suggest import cut, listed

ORIGIN = Path("somewhere/robot.urdf")
LONG = "x" * 300_000
MASS = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
LINK = f'<link name="a">{MASS}</link>'


def test_a_word_is_cut_and_a_short_one_is_not() -> None:
    assert cut("x" * 81) == f"'{'x' * 77}...'"
    assert cut("it's") == '"it\'s"'
    assert len(listed([LONG, LONG])) == 162


def test_a_message_has_an_end() -> None:
    assert str(RobotError("x" * MAX_MESSAGE)) == "x" * MAX_MESSAGE
    assert str(RobotError(LONG)) == "x" * (MAX_MESSAGE - 3) + "..."


def test_a_long_word_of_the_file_does_not_make_a_long_message() -> None:
    for confined in [True, False]:
        for parts in [
            f'<gazebo><plugin name="p" filename="{LONG}"/></gazebo>',
            f'<gazebo><plugin name="{LONG}" filename="p"/></gazebo>',
            f'<gazebo><plugin name="{LONG}" '
            f'filename="libgazebo_ros_p3d/{LONG}/libgazebo_ros_p3d.so"/></gazebo>',
            f'<gazebo reference="{LONG}"/>',
            f'<gazebo><sensor name="s" type="{LONG}"/></gazebo>',
            '<gazebo><plugin name="p" filename="libgazebo_ros_planar_move.so">'
            f"<robotBaseFrame>{LONG}</robotBaseFrame></plugin></gazebo>",
            f'<transmission name="t"><joint name="{LONG}"/></transmission>',
            f'<link name="{LONG}"/>',
            f'<joint name="j" type="{LONG}"/>',
            f'<joint name="j" type="fixed"><parent link="{LONG}"/><child link="a"/></joint>',
            '<link name="b"><collision><geometry><mesh '
            f'filename="package://{LONG}/x.stl"/></geometry></collision></link>',
            '<link name="b"><collision><geometry><mesh '
            f'filename="{LONG}"/></geometry></collision></link>',
            '<link name="b"><collision><geometry><mesh '
            f'filename="{LONG}://x"/></geometry></collision></link>',
            f'<link name="b"><collision><geometry><{LONG}/></geometry></collision></link>',
        ]:
            text = f'<robot name="r">{LINK}{parts}</robot>'
            try:
                message = parse(text, ORIGIN, confined=confined).warnings
            except RobotError as error:
                message = (str(error),)
            assert message
            assert all(len(line) < 1000 for line in message)
