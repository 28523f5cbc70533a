"""What a client sends needs no file: collision meshes are in the text, all else of it is kept."""

import re
from pathlib import Path

import pytest
import trimesh

from holozen.robot.errors import RobotError
from holozen.robot.mesh.files import hull
from holozen.robot.model import load, parse
from holozen.robot.portable import portable

REPO = Path(__file__).parents[3]
ELSEWHERE = Path("/elsewhere/robot.urdf")
DATA = re.compile(r"data:model/stl;base64,[A-Za-z0-9+/=]+")

URDF = """<?xml version="1.0" encoding="utf-8"?>
<!-- ä: <collision><geometry><mesh filename="box.stl"/></geometry></collision> -->
<robot name="r" note='filename="box.stl"'>\r
  <link name="a>b">
    <visual><geometry><mesh filename="box.stl" scale="1 1 2"/></geometry></visual>
    <collision><geometry>
      <mesh
        scale="1 1 2"  filename = '%s'  />
    </geometry></collision>
    <collision><geometry><mesh filename="package://p/box.stl"></mesh></geometry></collision>
  </link>
</robot>
<!-- end -->
"""
SDF = """<sdf version="1.6"><model name="m"><link name="a">
<visual name="v"><geometry><mesh><uri>box.stl</uri></mesh></geometry></visual>
<collision name="c"><geometry><mesh><scale>2 2 2</scale><uri> model://p/box.stl </uri></mesh></geometry></collision>
</link></model></sdf>
"""


@pytest.fixture
def folder(home: Path) -> Path:
    """Where box.stl is."""
    trimesh.creation.box((1, 2, 3)).export(home / "box.stl")
    return home


def sent(folder: Path, text: str, name: str = "robot.urdf") -> tuple[str, tuple[str, ...]]:
    (folder / name).write_text(text, newline="")
    return portable(folder / name, packages={"p": folder})


def test_only_the_uris_of_collision_meshes_are_replaced(folder: Path) -> None:
    text, warnings = sent(folder, URDF % "box.stl")
    assert warnings == ()
    assert len(DATA.findall(text)) == 2
    first, second = DATA.finditer(text)
    assert (
        text[: first.start()] + "box.stl" + text[first.end() : second.start()]
        == (URDF % "box.stl").partition("package://")[0]
    )
    assert text[second.end() :] == URDF.partition("package://p/box.stl")[2]


def test_elsewhere_it_has_the_hulls_that_it_has_here(folder: Path) -> None:
    text, _ = sent(folder, URDF % "box.stl")
    there = parse(text, ELSEWHERE, confined=True)
    assert there.warnings == ()
    first, second = there.links["a>b"].collisions
    assert set(first.points) == set(hull(folder / "box.stl", (1, 1, 2)))
    assert set(second.points) == set(hull(folder / "box.stl"))


def test_an_sdf_file_is_sent_with_its_hulls_too(folder: Path) -> None:
    text, warnings = sent(folder, SDF, "model.sdf")
    assert warnings == ()
    assert re.sub(DATA, " model://p/box.stl ", text) == SDF
    (shape,) = parse(text, ELSEWHERE, confined=True).links["a"].collisions
    assert set(shape.points) == set(hull(folder / "box.stl", (2, 2, 2)))


def test_an_sdf_s_uri_in_cdata_is_replaced_whole(folder: Path) -> None:
    text, _ = sent(folder, SDF.replace(" model://p/box.stl ", "<![CDATA[box.stl]]>"), "model.sdf")
    assert "CDATA" not in text and len(DATA.findall(text)) == 1


def test_a_mesh_that_cannot_be_sent_is_left_with_a_warning(folder: Path) -> None:
    text, warnings = sent(folder, URDF % "gone.stl")
    assert "'gone.stl'" in text and len(DATA.findall(text)) == 1
    told = f"{folder}/robot.urdf: the collision mesh 'gone.stl' is not sent: no such file 'gone.stl'; looked for "
    assert len(warnings) == 1 and warnings[0].startswith(told)


def test_what_holds_its_mesh_already_is_kept(folder: Path) -> None:
    text, _ = sent(folder, URDF % "box.stl")
    assert sent(folder, text) == (text, ())


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("<robot>", "broken XML"),
        ('<!DOCTYPE r [<!ENTITY a "b">]><robot/>', "the entity 'a' is declared"),
        ("", "is empty"),
    ],
)
def test_a_file_that_is_none_is_refused(folder: Path, text: str, told: str) -> None:
    with pytest.raises(RobotError, match=told):
        sent(folder, text)


def test_the_lesson_s_robot_is_expanded_and_the_same_elsewhere() -> None:
    path = REPO / "urdf" / "hb_bot.urdf.xacro"
    text, warnings = portable(path)
    assert warnings == () and "${" not in text
    there, here = parse(text, ELSEWHERE, confined=True), load(path)
    assert there.warnings == ()
    assert [link.collisions for link in there.links.values()] == [link.collisions for link in here.links.values()]
    assert there.drive == here.drive
