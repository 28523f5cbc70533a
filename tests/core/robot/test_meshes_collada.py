"""COLLADA files: unit, up-axis and the nodes of the scene, against boxes of known size and against
trimesh.
"""

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from holozen.robot.errors import RobotError
from holozen.robot.files import meshes
from holozen.robot.files.meshes import read_dae

CORNERS = [(x, y, z) for x in (0, 1) for y in (0, 2) for z in (0, 3)]
FACES = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6)]
INDEXES = " ".join(str(index) for face in FACES for index in face)
TRIANGLES = (
    '<triangles count="8"><input semantic="VERTEX" source="#v" '
    f'offset="0"/><p>{INDEXES}</p></triangles>'
)
HERE = '<instance_geometry url="#g"/>'
METRES = '<unit meter="1"/><up_axis>Z_UP</up_axis>'


def dae(
    asset: str = METRES, nodes: str = f"<node>{HERE}</node>", faces: str = TRIANGLES, more: str = ""
) -> str:
    """A box of 1 x 2 x 3 units, one corner at the origin."""
    numbers = " ".join(str(number) for corner in CORNERS for number in corner)
    params = "".join(f'<param name="{axis}" type="float"/>' for axis in "XYZ")
    accessor = (
        '<technique_common><accessor source="#a" count="8" '
        f'stride="3">{params}</accessor></technique_common>'
    )
    return f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>{asset}</asset>
<library_geometries><geometry id="g"><mesh><source id="s"><float_array id="a" count="24">{numbers}</float_array>
{accessor}</source><vertices id="v"><input semantic="POSITION" source="#s"/></vertices>{faces}</mesh></geometry>
</library_geometries>{more}<library_visual_scenes><visual_scene id="vs">{nodes}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#vs"/></scene></COLLADA>"""  # noqa: E501


def points(text: str) -> Any:
    data = text.encode()
    return np.vstack(
        [
            np.zeros((0, 3)),
            *(part.points for part in read_dae(io.BytesIO(data), len(data), "a.dae")),
        ]
    )


def bounds(text: str) -> Any:
    found = points(text)
    return np.array([found.min(axis=0), found.max(axis=0)])


def refusal(text: str) -> str:
    with pytest.raises(RobotError) as error:
        points(text)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_unit_and_up_axis_give_metres_with_z_up() -> None:
    for asset, low, high in [
        ("<up_axis>Z_UP</up_axis>", (0, 0, 0), (1, 2, 3)),
        (
            '<unit name="inch" meter="0.0254"/><up_axis> Z_UP </up_axis>',
            (0, 0, 0),
            (0.0254, 0.0508, 0.0762),
        ),
        ('<unit meter="0.01"/><up_axis>Y_UP</up_axis>', (0, -0.03, 0), (0.01, 0, 0.02)),
        ("", (0, -3, 0), (1, 0, 2)),
        ("<up_axis>X_UP</up_axis>", (-2, -3, 0), (0, 0, 1)),
    ]:
        assert bounds(dae(asset)) == pytest.approx(np.array([low, high], float))


def test_the_up_axis_turns_and_does_not_mirror() -> None:
    for turn in meshes.UP.values():
        assert np.linalg.det(np.array(turn, float)) == pytest.approx(1)


MATRIX = "<matrix>0 -1 0 10  1 0 0 0  0 0 1 0  0 0 0 1</matrix>"
TURNED = "<translate>10 0 0</translate><rotate>0 0 1 90</rotate>"


@pytest.mark.filterwarnings("ignore:Setting the shape on a NumPy array")  # by pycollada
def test_a_geometry_stands_where_its_nodes_put_it_as_trimesh_sees_it() -> None:
    for nodes, low, high in [
        (f"<node><translate>1 2 3</translate>{HERE}</node>", (1, 2, 3), (2, 4, 6)),
        (f"<node>{TURNED}{HERE}</node>", (8, 0, 0), (10, 1, 3)),
        (f"<node>{MATRIX}{HERE}</node>", (8, 0, 0), (10, 1, 3)),
        (f"<node>{TURNED}<scale>2 2 2</scale>{HERE}</node>", (6, 0, 0), (10, 2, 6)),
        (
            f"<node>{TURNED}<node><translate>0 -1 0</translate>{HERE}</node></node>",
            (9, 0, 0),
            (11, 1, 3),
        ),
        (
            f"<node>{HERE}</node><node><translate>5 0 0</translate>{HERE}</node>",
            (0, 0, 0),
            (6, 2, 3),
        ),
        (f"<node><rotate>0 1 0 90</rotate>{HERE}</node>", (0, 0, -1), (3, 2, 0)),
    ]:
        found = bounds(dae(nodes=nodes))
        assert found == pytest.approx(np.array([low, high], float))
        scene = trimesh.load_scene(io.BytesIO(dae(nodes=nodes).encode()), file_type="dae")
        assert found == pytest.approx(scene.bounds, abs=1e-5)


def test_a_turn_about_no_axis_is_none() -> None:
    nodes = f"<node><rotate>0 0 0 90</rotate>{HERE}</node>"
    assert bounds(dae(nodes=nodes)) == pytest.approx(np.array([(0, 0, 0), (1, 2, 3)]))


def test_the_unit_scales_what_nodes_move() -> None:
    nodes = f"<node><translate>100 0 0</translate>{HERE}</node>"
    assert bounds(dae('<unit meter="0.01"/><up_axis>Z_UP</up_axis>', nodes))[0] == pytest.approx(
        [1, 0, 0]
    )


def test_a_node_of_the_library_is_placed_by_its_name() -> None:
    more = f'<library_nodes><node id="n"><translate>1 0 0</translate>{HERE}</node></library_nodes>'
    nodes = '<node><translate>1 0 0</translate><instance_node url="#n"/></node>'
    assert bounds(dae(nodes=nodes, more=more))[0] == pytest.approx([2, 0, 0])


VERTEX = (
    '<input semantic="VERTEX" source="#v" offset="1"/><input semantic="NORMAL" source="#s" '
    'offset="0"/>'
)


def test_only_the_vertices_that_faces_use_count_in_each_kind_of_faces() -> None:
    for faces in [
        f"<triangles>{VERTEX}<p>7 0 7 1 7 2</p></triangles>",
        f"<polylist><vcount>3</vcount>{VERTEX}<p>7 0 7 1 7 2</p></polylist>",
        f"<polygons>{VERTEX}<p>7 0 7 1</p><ph><p>7 2 7 0</p></ph></polygons>",
        f"<lines>{VERTEX}<p>7 5 7 4</p></lines><trifans>{VERTEX}<p>7 0 7 1 7 2</p></trifans>",
    ]:
        assert set(map(tuple, points(dae(faces=faces)))) == {(0, 0, 0), (0, 0, 3), (0, 2, 0)}


def test_lines_alone_are_no_faces() -> None:
    assert len(points(dae(faces=f"<lines>{VERTEX}<p>7 5 7 4</p></lines>"))) == 0
    assert len(points(dae().replace("<scene>", "<extra>").replace("</scene>", "</extra>"))) == 0


ENTITY = dae().replace("<COLLADA", '<!DOCTYPE x [<!ENTITY a "aaaa">]>\n<COLLADA', 1)
LOOP = '<library_nodes><node id="n"><instance_node url="#n"/></node></library_nodes>'


def test_what_is_no_mesh_is_reported_in_one_line_with_its_place() -> None:
    for text, message in [
        ("<COLLADA><asset>", "a.dae, line 1: broken XML: no element found"),
        ("<html/>", "a.dae, line 1: <html> is not a <COLLADA>; a .dae file starts with one"),
        (ENTITY, "a.dae, line 2: the entity 'a' is declared; write out its text instead"),
        (dae('<unit meter="0"/>'), "<unit> meter is 0; a length must be positive"),
        (dae('<unit meter="nan"/>'), "meter: 'nan' is not a finite number"),
        (dae("<up_axis>W_UP</up_axis>"), "<up_axis> is 'W_UP'; it must be one of Z_UP, Y_UP, X_UP"),
        (
            dae(nodes='<node><instance_geometry url="#h"/></node>'),
            "url='h' names no <geometry> of this file",
        ),
        (
            dae(nodes='<node><instance_node url="#n"/></node>', more=LOOP),
            "in its scene, or one that contains itself",
        ),
        (
            dae(nodes=f"<node><skew>1 2</skew>{HERE}</node>"),
            "<skew> is not supported; apply the transforms",
        ),
        (
            dae(nodes=f"<node><matrix>1 2 3</matrix>{HERE}</node>"),
            "<matrix> has 3 numbers instead of 16",
        ),
        (
            dae(nodes=f"<node><translate>1 2 x</translate>{HERE}</node>"),
            "contains something that is not a number",
        ),
        (
            dae(faces=f"<triangles>{VERTEX}<p>0 8</p></triangles>"),
            "<triangles> names vertex 8 of 8",
        ),
        (
            dae(faces=f"<triangles>{VERTEX}<p>0 -1</p></triangles>"),
            "<triangles> names vertex -1 of 8",
        ),
        (
            dae(faces="<triangles><p>0 1 2</p></triangles>"),
            "<triangles> has no <input semantic='VERTEX'>",
        ),
        (dae().replace('stride="3"', 'stride="1"'), "<accessor> has offset 0 and stride 1"),
        (dae().replace('"POSITION"', '"NORMAL"'), "<vertices> has no <input semantic='POSITION'>"),
    ]:
        assert message in refusal(text)
        assert refusal(text).startswith("a.dae, line ")


def test_a_geometry_that_stands_everywhere_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(meshes, "MAX_POINTS", 20)
    assert len(points(dae(nodes=f"<node>{HERE * 2}</node>"))) == 16
    assert (
        refusal(dae(nodes=f"<node>{HERE * 3}</node>"))
        == "a.dae: has more than 20 corners in its scene; simplify it"
    )


def test_a_file_may_be_larger_than_a_robot(tmp_path: Path) -> None:
    assert len(points(dae(more=f"<extra>{'x' * 5_000_000}</extra>"))) == 8
