"""Robots that look alike: one mesh in the page, at the places of all of them."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import viser

from holozen.robot.rigid import moved_by
from holozen.rotation import Transform, from_rpy
from holozen.view.instances import GREY, Instances
from holozen.view.meshes import appearance

WHEEL = """<visual><origin xyz="0 0.1 0" rpy="1.5 0 0"/><geometry><cylinder radius="0.1" length="0.05"/></geometry>
<material name="red"><color rgba="1 0 0 1"/></material></visual>"""  # noqa: E501
URDF = f"""<robot name="r"><link name="root"/>
<joint name="up" type="fixed"><origin xyz="0 0 0.5" rpy="0 0 1"/><parent link="root"/><child link="base"/></joint>
<link name="base"><visual><geometry><box size="1 1 0.2"/></geometry></visual></link>
<joint name="turns" type="continuous"><origin xyz="1 0 0" rpy="0 0.3 0"/><axis xyz="0 0.6 0.8"/>
  <parent link="base"/><child link="wheel"/></joint><link name="wheel">{WHEEL}</link>
<joint name="slides" type="prismatic"><origin xyz="-1 0 0"/><axis xyz="0 1 0"/>
  <limit lower="-9" upper="9" effort="1" velocity="1"/><parent link="wheel"/><child link="foot"/></joint>
<link name="foot">{WHEEL}</link></robot>"""  # noqa: E501
NAMES = ["slides", "turns"]
AT = [
    Transform((1.0, 2.0, 3.0), from_rpy(0.1, 0.2, 0.3)),
    Transform((-4.0, 0.0, 0.0), from_rpy(0.0, 0.0, 2.0)),
]
ANGLES = [(0.4, 1.5), (-2.0, -0.7)]


@pytest.fixture
def pages() -> list[Any]:
    """The meshes in the page, in the order in which they were added."""
    return []


@pytest.fixture
def scene(pages: list[Any]) -> viser.SceneApi:
    def add(path: str, vertices: object, faces: object, *_: object, **__: object) -> Any:
        mesh = SimpleNamespace(path=path)
        mesh.remove = lambda: pages.remove(mesh)
        pages.append(mesh)
        return mesh

    return cast("viser.SceneApi", SimpleNamespace(add_batched_meshes_simple=add))


@pytest.fixture
def drawn(scene: viser.SceneApi) -> Instances:
    """Two bodies, each in a place of its own."""
    drawn = Instances(scene, "/instances/1", URDF, NAMES)
    for at, angles in zip(AT, ANGLES, strict=True):
        body = drawn.add()
        body.at, body.joints = at, np.array(angles)
    drawn.draw()
    return drawn


def placed(at: Transform, angles: tuple[float, float]) -> dict[str, Transform]:
    """Where the visuals of the wheel and of the foot are in the world, link by link."""
    positions, found = dict(zip(NAMES, angles, strict=True)), {"root": at}
    for joint in appearance(URDF)[0].joints:
        there = moved_by(
            joint, joint.pose.xyz, from_rpy(*joint.pose.rpy), positions.get(joint.name, 0.0)
        )
        found[joint.child] = found[joint.parent] @ Transform(*there)
    return {
        link: found[link] @ Transform((0.0, 0.1, 0.0), from_rpy(1.5, 0.0, 0.0))
        for link in ("wheel", "foot")
    }


def test_links_that_look_alike_are_one_mesh_at_the_places_of_all_bodies(
    drawn: Instances, pages: list[Any]
) -> None:
    assert len(pages) == 2
    wanted = [
        placed(at, angles)[link]
        for link in ("wheel", "foot")
        for at, angles in zip(AT, ANGLES, strict=True)
    ]
    wheels = pages[1]
    assert wheels.batched_positions == pytest.approx(
        np.array([one.translation for one in wanted]), abs=1e-5
    )
    rotations = np.array([(one.rotation[3], *one.rotation[:3]) for one in wanted])
    assert np.abs((wheels.batched_wxyzs * rotations).sum(axis=1)) == pytest.approx(1.0, abs=1e-6)


def test_one_body_can_be_grey_alone_and_its_removal_leaves_the_others(
    drawn: Instances, pages: list[Any]
) -> None:
    red, grey = [255, 0, 0], [*GREY]
    assert pages[1].batched_colors.tolist() == [red] * 4
    drawn.bodies[0].grey = drawn.changed = True
    drawn.draw()
    assert pages[1].batched_colors.tolist() == [grey, red, grey, red]
    second = pages[1].batched_positions[[1, 3]]
    drawn.remove(drawn.bodies[0])
    drawn.draw()
    assert pages[1].batched_positions == pytest.approx(second)
    drawn.close()
    assert pages == []


@pytest.mark.timeout(20)
def test_a_loop_of_links_is_left_out(scene: viser.SceneApi, pages: list[Any]) -> None:
    """A foreign sim may describe one; ours never does."""
    joint = '<joint name="{0}{1}" type="fixed"><parent link="{0}"/><child link="{1}"/></joint>'
    for pairs, shown in (
        (["ab", "ba"], 0),
        (["rb", "ba", "ab"], 0),
        (["rb", "ba"], 2),
        (["xa"], 1),
    ):
        links = "".join(f'<link name="{name}">{WHEEL}</link>' for name in "ab") + '<link name="r"/>'
        text = f"<robot name='r'>{links}{''.join(joint.format(*pair) for pair in pairs)}</robot>"
        drawn = Instances(scene, "/instances/1", text)
        drawn.add()
        drawn.draw()
        assert sum(len(mesh.batched_positions) for mesh in pages) == shown, pairs
        drawn.close()
