"""The description of a robot or object shows, without any other file, what its own files show."""

import base64
import gzip
from pathlib import Path

import numpy as np
import pytest

from holozen import data
from holozen.robot.errors import RobotError
from holozen.robot.files.description import Mesh, read, written
from holozen.robot.files.loading import both, load, parse
from holozen.robot.files.meshes import bounds, file_in
from holozen.robot.files.sdf_world import load_world
from holozen.robot.files.uris import NOWHERE

pytestmark = pytest.mark.usefixtures("forked")

ROBOTS = sorted(
    path
    for path in data.find("urdf").glob("*.xacro")
    if path.name not in ("materials.xacro", "wheels.xacro")
)


@pytest.mark.parametrize("path", ROBOTS, ids=lambda path: path.name.partition(".")[0])
def test_it_has_the_links_shapes_and_joints_of_the_file(path: Path) -> None:
    model = load(path)
    found = read(written(model))
    assert [link.name for link in found.links] == list(model.links)
    for (_, shapes), before in zip(found.shapes(), model.links.values(), strict=True):
        for (shape, meshes), own in zip(shapes, before.visuals, strict=True):
            assert (shape.kind, shape.size, shape.pose, shape.color) == (
                own.kind,
                own.size,
                own.pose,
                own.color,
            )
            if own.path:
                corners = np.vstack(
                    [
                        points[triangles].reshape(-1, 3)
                        for points, triangles in map(Mesh.arrays, meshes)
                    ]
                )
                assert np.allclose(
                    [corners.min(axis=0), corners.max(axis=0)], bounds(own.path), atol=1e-6
                )
    for joint, same in zip(found.joints, model.joints.values(), strict=True):
        assert (joint.name, joint.kind, joint.parent, joint.child) == (
            same.name,
            same.kind,
            same.parent,
            same.child,
        )
        assert (joint.pose, joint.axis) == (same.pose, same.axis)


def test_a_robot_that_was_sent_has_the_same_description() -> None:
    path = data.find("urdf", "hb_bot.urdf.xacro")
    _, text = both(path, {}, {}, False, ())
    assert read(written(parse(text, NOWHERE, confined=True))) == read(written(load(path)))


def test_the_models_of_a_world_have_one_too() -> None:
    models = {
        model.name: read(written(model))
        for model in load_world(data.find("worlds", "arena.world")).models
    }
    assert next(shape.size for link in models["walls"].links for shape in link.visuals) == (
        10.2,
        0.1,
        0.5,
    )
    assert [shape.kind for link in models["ball"].links for shape in link.visuals] == ["sphere"]


def test_what_has_no_visual_shows_its_collision_shapes(tmp_path: Path) -> None:
    file = tmp_path / "r.urdf"
    file.write_text(
        '<robot name="r"><link name="a"><collision><geometry><box size="1 2 '
        '3"/></geometry></collision></link></robot>'
    )
    ((shape,),) = (link.visuals for link in read(written(load(file))).links)
    assert (shape.kind, shape.size) == ("box", (1.0, 2.0, 3.0))


def test_a_mesh_that_is_none_or_too_large_is_refused() -> None:
    bomb = base64.b64encode(gzip.compress(bytes(30_000_000))).decode()
    for uri, reason in [
        ("data:model/stl;base64,AAAA", "holds no mesh"),
        ("data:model/stl+gzip;base64,AAAA", "is not valid"),
        (f"data:model/stl+gzip;base64,{bomb}", "holds more than 20 MB"),
    ]:
        with pytest.raises(RobotError, match=reason):
            file_in(uri)
