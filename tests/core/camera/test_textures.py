"""The overhead camera sees the textures of files, as Gazebo's does: OpenCV finds each ArUco marker
in its picture.
"""

import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image

from holozen.messages import Exposure, Point, Pose, Quaternion, SeenEntity
from holozen.robot.files.description import read, written
from holozen.robot.files.loading import both, load, received
from holozen.robot.model import RobotModel
from services.camera.picture import Bytes
from services.camera.rasterizer import Rasterizer

MARKERS = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
SIDE = 0.25  # m, of a sheet; the marker on it has a white rim
HIGH = 3.0  # m; the height of the camera
WIDTH, HEIGHT, FIELD = 800, 600, 1.0
PLACES = {"dae": (-0.9, 0.6), "obj": (0.9, 0.6), "script": (-0.9, -0.6), "urdf": (0.9, -0.6)}
RIM = 8  # of the marker's 6 cells and this rim: pixels a cell

DAE = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><up_axis>Z_UP</up_axis></asset>
<library_images><image id="marker_png"><init_from>dae%20marker.png</init_from></image></library_images>
<library_effects><effect id="e"><profile_COMMON>
<newparam sid="marker-surface"><surface type="2D"><init_from>marker_png</init_from></surface></newparam>
<newparam sid="marker-sampler"><sampler2D><source>marker-surface</source></sampler2D></newparam>
<technique sid="common"><lambert><diffuse><texture texture="marker-sampler" texcoord="UVMap"/></diffuse></lambert>
</technique>
</profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="12">-0.5 -0.5 0 0.5 -0.5 0 -0.5 0.5 0 0.5 0.5 0</float_array>
<technique_common><accessor source="#pa" count="4" stride="3"/></technique_common></source>
<source id="t"><float_array id="ta" count="8">0 0 1 0 0 1 1 1</float_array>
<technique_common><accessor source="#ta" count="4" stride="2"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles material="s" count="2"><input semantic="VERTEX" source="#v" offset="0"/>
<input semantic="TEXCOORD" source="#t" offset="1" set="0"/><p>0 0 1 1 3 3 0 0 3 3 2 2</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="vs"><node><instance_geometry url="#g">
<bind_material><technique_common>
<instance_material symbol="s" target="#m"/></technique_common></bind_material>
</instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#vs"/></scene></COLLADA>"""  # noqa: E501
OBJ = """mtllib obj.mtl
v -0.5 -0.5 0\nv 0.5 -0.5 0\nv 0.5 0.5 0\nv -0.5 0.5 0
vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1
usemtl paper\nf 1/1 2/2 3/3 4/4\n"""
SCRIPT = """material Arena/Marker { technique { pass { texture_unit { texture script.png } } } }
// material Arena/Other { technique { pass { texture_unit { texture none.png } } } }"""


def marker(number: int, file: Path) -> None:
    """A marker of 6 cells with a rim of one cell."""
    picture = np.full((8 * RIM * 4, 8 * RIM * 4), 255, np.uint8)
    picture[RIM * 4 : -RIM * 4, RIM * 4 : -RIM * 4] = cv2.aruco.generateImageMarker(
        MARKERS, number, 6 * RIM * 4
    )
    Image.fromarray(picture).save(file)


def sheet(shape: str, material: str = "") -> str:
    """An SDF model with one visual."""
    return (
        "<sdf version='1.6'><model name='sheet'><static>true</static><link name='a'><visual "
        "name='v'><geometry>"
        f"{shape}</geometry>{material}</visual></link></model></sdf>"
    )


@pytest.fixture
def sheets(tmp_path: Path) -> dict[str, Path]:
    """A file with a marker, 0 to 3, in each way in which files name an image."""
    folder = tmp_path / "arena"
    scripts, images = folder / "materials" / "scripts", folder / "materials" / "textures"
    for each in (scripts, images, folder / "meshes"):
        each.mkdir(parents=True)
    (folder / "model.config").write_text("<model><sdf>dae.sdf</sdf></model>")
    scale = f"<scale>{SIDE} {SIDE} 1</scale>"
    for number, (name, suffix) in enumerate({"dae": "dae marker.png", "obj": "obj.jpg"}.items()):
        marker(number, folder / "meshes" / suffix)
        text = sheet(f"<mesh><uri>model://arena/meshes/sheet.{name}</uri>{scale}</mesh>")
        (folder / f"{name}.sdf").write_text(text)
    (folder / "meshes" / "sheet.dae").write_text(DAE)
    (folder / "meshes" / "sheet.obj").write_text(OBJ)
    (folder / "meshes" / "obj.mtl").write_text("newmtl paper\nKd 1 1 1\nmap_Kd -s 1 1 1 obj.jpg\n")
    marker(2, images / "script.png")
    (scripts / "arena.material").write_text(SCRIPT)
    named = "<uri>model://arena/materials/scripts</uri><uri>model://arena/materials/textures</uri>"
    (folder / "script.sdf").write_text(
        sheet(
            f"<plane><normal>0 0 1</normal><size>{SIDE} {SIDE}</size></plane>",
            f"<material><script>{named}<name>Arena/Marker</name></script></material>",
        )
    )
    marker(3, folder / "urdf.png")
    (folder / "urdf.urdf").write_text(
        "<robot name='sheet'><material name='m'><texture filename='urdf.png'/></material><link "
        "name='a'><visual>"
        f"<geometry><box size='{SIDE} {SIDE} 0.002'/></geometry><material "
        "name='m'/></visual></link></robot>"
    )
    return {path.stem: path for path in folder.iterdir() if path.suffix in (".sdf", ".urdf")}


def seen(renderer: Any, models: dict[str, RobotModel]) -> Bytes:
    """The picture of a camera above the sheets, each in its place."""
    for number, (name, model) in enumerate(models.items()):
        renderer.add(name, number, read(written(model)))
    down = Quaternion(-0.5, 0.5, 0.5, 0.5)  # forward is down, the picture's right is x, its top y
    exposure = Exposure(
        image="camera/image_raw",
        info="camera/camera_info",
        width=WIDTH,
        height=HEIGHT,
        field_of_view=FIELD,
        near=0.1,
        far=10.0,
        encoding="rgb8",
        pose=Pose(Point(0, 0, HIGH), down),
        ground=True,
        entities=[
            SeenEntity(name, number, ["a"], [Pose(Point(*PLACES[name], 0.01))])
            for number, name in enumerate(models)
        ],
    )
    colors: Bytes = renderer.render(exposure).colors
    return colors


def found(colors: Bytes) -> dict[int, tuple[float, float]]:
    """The markers in a picture, and where their centres are in metres."""
    corners, numbers, _ = cv2.aruco.ArucoDetector(MARKERS).detectMarkers(
        cv2.cvtColor(colors, cv2.COLOR_RGB2GRAY)
    )
    metres = 2 * HIGH * math.tan(FIELD / 2) / WIDTH  # of a pixel
    places = {}
    for marker_corners, number in zip(
        corners, [] if numbers is None else numbers.ravel(), strict=True
    ):
        x, y = marker_corners[0].mean(axis=0)
        places[int(number)] = (float(x - WIDTH / 2) * metres, float(HEIGHT / 2 - y) * metres)
    return places


def test_each_marker_is_found_where_it_is(renderer: Any, sheets: dict[str, Path]) -> None:
    models = {name: load(sheets[name]) for name in PLACES}
    assert [
        warning
        for model in models.values()
        for warning in model.warnings
        if "inertia" not in warning
    ] == []
    places = found(seen(renderer, models))
    assert {
        number: pytest.approx(place, abs=0.01) for number, place in enumerate(PLACES.values())
    } == places


def test_they_are_sent_with_the_text_of_a_robot(sheets: dict[str, Path]) -> None:
    models = {name: received(both(sheets[name], {}, {}, False, ())[1]) for name in PLACES}
    assert found(seen(Rasterizer(), models)).keys() == {0, 1, 2, 3}


def test_a_missing_or_broken_image_is_named_and_the_mesh_is_drawn(
    renderer: Any, sheets: dict[str, Path]
) -> None:
    meshes = sheets["dae"].parent / "meshes"
    (meshes / "dae marker.png").unlink()
    (meshes / "obj.jpg").write_bytes(b"no image")
    models = {name: load(sheets[name]) for name in ("dae", "obj")}
    assert [
        "there is no texture 'dae%20marker.png' beside it" in each
        for each in models["dae"].warnings
    ] == [True]
    colors = seen(renderer, models)
    assert found(colors) == {}
    for x, y in (PLACES["dae"], PLACES["obj"]):
        scale = WIDTH / (2 * HIGH * math.tan(FIELD / 2))
        assert 100 < colors[round(HEIGHT / 2 - y * scale), round(WIDTH / 2 + x * scale)].min() < 240
