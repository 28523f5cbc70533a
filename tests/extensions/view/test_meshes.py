"""What a description shows: shapes and meshes with their colours, scales and up axes, in metres."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from holozen.robot.files.description import written
from holozen.robot.files.loading import load
from holozen.view.meshes import PLAIN, appearance

URDF = """<robot name="r"><link name="a">
  <visual><geometry>{geometry}</geometry>{material}</visual>
</link></robot>"""
BLUE = '<material name="blue"><color rgba="0 0 1 0.5"/></material>'
DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="0.01"/><up_axis>Y_UP</up_axis></asset>
<library_effects><effect id="e"><profile_COMMON><technique sid="t"><lambert>
  <diffuse><color>0 1 0 1</color></diffuse></lambert></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh>
  <source id="p"><float_array id="pa" count="9">0 0 0 100 0 0 0 200 0</float_array><technique_common>
    <accessor source="#pa" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
    <param name="Z" type="float"/></accessor></technique_common></source>
  <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
  <triangles count="1" material="s"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"><bind_material><technique_common>
  <instance_material symbol="s" target="#m"/></technique_common></bind_material></instance_geometry></node>
</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""  # noqa: E501


def shown(
    folder: Path, geometry: str, material: str = ""
) -> list[tuple[list[float], tuple[int, int, int], float]]:
    """The size along x, y and z, the colour and the opacity of each visible part."""
    file = folder / "r.urdf"
    file.write_text(URDF.format(geometry=geometry, material=material))
    _, ((*parts,),) = appearance(written(load(file)))
    return [
        (np.ptp(part.vertices, axis=0).round(4).tolist(), part.color, part.opacity)
        for _, part in parts
    ]


GREY = tuple(round(255 * part) for part in PLAIN[:3])


def test_a_shape_has_its_size_and_the_colour_of_its_material(tmp_path: Path) -> None:
    assert shown(tmp_path, '<box size="1 2 3"/>', BLUE) == [([1, 2, 3], (0, 0, 255), 0.5)]
    assert shown(tmp_path, '<cylinder radius="0.5" length="3"/>') == [([1, 1, 3], GREY, 1.0)]
    assert shown(tmp_path, '<sphere radius="0.5"/>') == [([1, 1, 1], GREY, 1.0)]


@pytest.mark.parametrize("kind", ["stl", "obj"])
def test_a_mesh_is_scaled(tmp_path: Path, kind: str) -> None:
    trimesh.creation.box((1, 2, 3)).export(tmp_path / f"box.{kind}")
    assert shown(tmp_path, f'<mesh filename="box.{kind}" scale="1 1 0.5"/>', BLUE) == [
        ([1, 2, 1.5], (0, 0, 255), 0.5)
    ]


def test_a_collada_mesh_is_in_metres_z_up_and_has_its_own_colour_or_that_of_the_material(
    tmp_path: Path,
) -> None:
    (tmp_path / "g.dae").write_text(DAE)
    assert shown(tmp_path, '<mesh filename="g.dae"/>') == [([1, 0, 2], (0, 255, 0), 1.0)]
    assert shown(tmp_path, '<mesh filename="g.dae"/>', BLUE) == [([1, 0, 2], (0, 0, 255), 0.5)]


def test_a_mesh_that_is_not_one_is_left_out(tmp_path: Path) -> None:
    (tmp_path / "bad.dae").write_text("<nothing/>")
    (tmp_path / "bad.obj").write_bytes(b"f 1 2 3\n")
    for name in ("bad.dae", "bad.obj"):
        assert shown(tmp_path, f'<mesh filename="{name}"/>') == []
