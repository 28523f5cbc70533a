"""Robot files that scripts and launch files expand are read as by `holozen spawn`."""

from pathlib import Path

import pytest

from holozen.ros import descriptions, xacro
from holozen.ros.launch.launch_context import LaunchContext
from holozen.ros.launch.launch_context import text as text_of
from holozen.ros.launch.substitutions import Command

from .conftest import Write

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
ROBOT = f"""{HEAD}
<xacro:include filename="/home/asha/ws/src/my_bot/urdf/sizes.xacro"/>
<xacro:include filename="$(find parts)/wheel.xacro"/>
<xacro:arg name="n" default="0"/>
<link name="base_$(arg n)_${{size}}"/><xacro:wheel/></robot>"""


@pytest.fixture
def robot(my_bot: Path, write: Write) -> Path:
    """A robot of files that are found by name, and in a package elsewhere in the workspace."""
    write("src/my_bot/urdf/sizes.xacro", f'{HEAD}<xacro:property name="size" value="7"/></robot>')
    write("src/others/parts/package.xml", "<package><name>parts</name></package>")
    write(
        "src/others/parts/wheel.xacro",
        f'{HEAD}<xacro:macro name="wheel"><link name="wheel"/></xacro:macro></robot>',
    )
    return write("src/my_bot/urdf/r.urdf.xacro", ROBOT)


def test_a_robot_is_expanded_with_mended_paths_and_its_file_is_known(
    robot: Path, my_bot: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    values = {"n": 3}
    document = xacro.process_file(str(robot), mappings=values)
    with robot.open() as file:
        parsed = xacro.parse(file)
    xacro.process_doc(parsed, mappings=values)
    assert parsed.documentElement
    ordered = text_of(LaunchContext(), Command(["xacro ", str(robot), " n:=3"]))
    for text in (
        document.toxml(),
        document.toprettyxml(indent="  "),
        parsed.documentElement.toxml(),
        ordered,
        xacro.process(robot, mappings=values),
    ):
        assert '<link name="base_3_7"/>' in text and '<link name="wheel"/>' in text
        assert descriptions.origin(text) == [
            str(robot),
            "n:=3",
            "--package",
            f"parts={my_bot.parent}/others/parts",
        ]
    assert (
        f"warning: {robot}, line 2: there is no file '/home/asha/ws/src/my_bot"
        in capsys.readouterr().err
    )
    assert descriptions.origin(document.toxml().replace("wheel", "leg")) is None


def test_an_error_in_a_robot_is_one_line_with_its_line(robot: Path, write: Write) -> None:
    robot.write_text(ROBOT.replace("${size}", "${sise}"))
    with pytest.raises(xacro.XacroException, match=rf"^{robot}, line 5: .*sise"):
        xacro.process_file(robot)
    with pytest.raises(xacro.XacroException, match=r"^nowhere.xacro: No such file"):
        xacro.process_file("nowhere.xacro")
    with pytest.raises(TypeError, match=r"^xacro needs the path of a file, not <"):
        xacro.process_file(object())
