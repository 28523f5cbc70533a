"""Where the links of an SDF model are, and what they turn about: by hand-worked numbers, and
against a URDF twin.
"""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holozen.robot.errors import RobotError
from holozen.robot.files.elements import Source, read_xml
from holozen.robot.files.loading import load
from holozen.robot.files.sdf_models import parse_sdf, read_models
from holozen.robot.model import Inertial, Pose, RobotModel
from holozen.robot.rigid import Frame, joint_axes, link_frames, lump
from holozen.robot.rotation import matrix_of, rpy_of

REPO = Path(__file__).parents[3]
ORIGIN = Path("/nowhere/a.sdf")
QUARTER = math.pi / 2
MASS = "<inertial><mass>1</mass></inertial>"
A_BOX = '<collision name="c"><geometry><box><size>1 1 1</size></box></geometry></collision>'


def model(body: str, version: str = "1.9", attributes: str = "") -> RobotModel:
    text = f'<sdf version="{version}"><model name="m" {attributes}>{body}</model></sdf>'
    return parse_sdf(read_xml(text, "a.sdf"), Source(ORIGIN, {}))


def link(name: str, pose: str = "", within: str = "", more: str = "") -> str:
    relative = f' relative_to="{within}"' if within else ""
    at = f"<pose{relative}>{pose}</pose>" if pose else ""
    return f'<link name="{name}">{at}{MASS}{more}</link>'


def joint(name: str, parent: str, child: str, kind: str = "fixed", more: str = "") -> str:
    return (
        f'<joint name="{name}" '
        f'type="{kind}"><parent>{parent}</parent><child>{child}</child>{more}</joint>'
    )


def about(
    pose: Pose, xyz: tuple[float, float, float], rpy: tuple[float, float, float] = (0, 0, 0)
) -> None:
    assert pose.xyz == pytest.approx(xyz, abs=1e-12)
    np.testing.assert_allclose(matrix_of(pose.rpy), matrix_of(rpy), atol=1e-12)


def test_a_joints_pose_is_the_childs_frame_as_the_parent_sees_it() -> None:
    robot = model(
        link("root")
        + link("a", f"1 0 0 0 0 {QUARTER}")
        + link("b", f"1 2 0.5 0 0 {2 * QUARTER}")
        + joint("j", "root", "a")
        + joint("k", "a", "b")
    )
    about(robot.joints["j"].pose, (1, 0, 0), (0, 0, QUARTER))
    # From a, which is turned left, the way of 2 along the model's y is 2 along its own x.
    about(robot.joints["k"].pose, (2, 0, 0.5), (0, 0, QUARTER))


def test_the_root_link_is_in_the_models_frame() -> None:
    robot = model(f"<pose>1 2 3 0 0 0.5</pose>{link('base', f'0 0 0.5 0 0 {QUARTER}', more=A_BOX)}")
    about(robot.pose, (1, 2, 3), (0, 0, 0.5))
    base = robot.links["base"]
    assert base.inertial is not None
    about(base.inertial.pose, (0, 0, 0.5), (0, 0, QUARTER))
    about(base.collisions[0].pose, (0, 0, 0.5), (0, 0, QUARTER))


def test_shapes_and_masses_have_poses_in_their_link() -> None:
    shape = "<pose>0 0 1 0 0 0</pose><geometry><sphere><radius>0.1</radius></sphere></geometry>"
    body = (
        f'<link name="base"><pose>1 0 0 0 0 {QUARTER}</pose><inertial><pose>1 0 0 0 0 '
        "0</pose></inertial>"
    )
    robot = model(
        f'{body}<visual name="v">{shape}</visual><collision name="c">{shape}</collision></link>'
    )
    base = robot.links["base"]
    assert base.inertial is not None
    about(base.inertial.pose, (1, 1, 0), (0, 0, QUARTER))
    about(base.visuals[0].pose, (1, 0, 1), (0, 0, QUARTER))
    about(base.collisions[0].pose, (1, 0, 1), (0, 0, QUARTER))


def test_a_pose_is_in_radians_degrees_or_a_quaternion() -> None:
    for pose, xyz, rpy in [
        ("<pose>1 2 3 0.1 0.2 0.3</pose>", (1, 2, 3), (0.1, 0.2, 0.3)),
        ('<pose degrees="true">1 2 3 90 0 -90</pose>', (1, 2, 3), (QUARTER, 0, -QUARTER)),
        ('<pose rotation_format="quat_xyzw">1 2 3 0 0 2 2</pose>', (1, 2, 3), (0, 0, QUARTER)),
        ("<pose/>", (0, 0, 0), (0, 0, 0)),
        ("", (0, 0, 0), (0, 0, 0)),
    ]:
        about(model(f"{pose}{link('base')}").pose, xyz, rpy)


def test_a_pose_may_be_relative_to_a_link_a_joint_a_frame_and_the_model() -> None:
    robot = model(
        link("root", "0 0 1 0 0 0")
        + '<frame name="mark" attached_to="a"><pose>0 0 2 0 0 0</pose></frame>'
        + link("a", f"1 0 0 0 0 {QUARTER}", "root")
        + link("b", "1 0 0 0 0 0", "a")
        + link("c", "0 1 0 0 0 0", "mark")
        + link("d", "0 0 1 0 0 0", "k")
        + link("e", "5 0 0 0 0 0", "__model__")
        + joint("j", "root", "a")
        + joint("k", "root", "b", more="<pose>0 0 -1 0 0 0</pose>")
        + "".join(joint(f"to_{name}", "root", name) for name in "cde")
    )
    frames = link_frames(robot)
    assert frames["a"].xyz == pytest.approx((1, 0, 1))
    assert frames["b"].xyz == pytest.approx((1, 1, 1))  # 1 along the x of a, which is the model's y
    # 1 along the y of a, which is the model's -x
    assert frames["c"].xyz == pytest.approx((0, 0, 3))
    assert frames["d"].xyz == pytest.approx((1, 1, 1))  # 1 above joint k, which is 1 below b
    assert frames["e"].xyz == (5, 0, 0)


def test_sdf_1_6_calls_it_frame() -> None:
    robot = model(
        f"{link('a', '0 0 1 0 0 0')}<link name='b'><pose frame='a'>0 0 1 0 0 "
        "0</pose></link>" + joint("j", "a", "b"),
        "1.6",
    )
    assert link_frames(robot)["b"].xyz == (0, 0, 2)


HINGE = link("base") + link("arm", f"0 0 0 0 0 {QUARTER}")


def test_an_axis_is_in_the_childs_frame() -> None:
    for version, axis, pose, seen_from_child in [
        ("1.9", "<xyz>1 0 0</xyz>", "", (1, 0, 0)),
        ("1.9", "<xyz>0 0 5</xyz>", "", (0, 0, 1)),
        ("1.9", "", "", (0, 0, 1)),
        ("1.9", "<xyz>0 0 1</xyz>", f"<pose>0 0 0 {QUARTER} 0 0</pose>", (0, -1, 0)),
        ("1.9", '<xyz expressed_in="__model__">1 0 0</xyz>', "", (0, -1, 0)),
        (
            "1.9",
            '<xyz expressed_in="base">1 0 0</xyz>',
            f"<pose>0 0 0 {QUARTER} 0 0</pose>",
            (0, -1, 0),
        ),
        ("1.10", "<xyz>1 0 0</xyz>", "", (1, 0, 0)),
        (
            "1.6",
            "<xyz>1 0 0</xyz><use_parent_model_frame>1</use_parent_model_frame>",
            "",
            (0, -1, 0),
        ),
        ("1.5", "<xyz>1 0 0</xyz>", "", (1, 0, 0)),
        ("1.4", "<xyz>1 0 0</xyz>", "", (0, -1, 0)),
        (
            "1.4",
            "<xyz>1 0 0</xyz><use_parent_model_frame>0</use_parent_model_frame>",
            "",
            (1, 0, 0),
        ),
    ]:
        robot = model(
            HINGE + joint("j", "base", "arm", "revolute", f"{pose}<axis>{axis}</axis>"), version
        )
        assert robot.joints["j"].axis == pytest.approx(seen_from_child, abs=1e-12)


DOOR = link("frame") + link("door", f"0.5 0 1 0 0 {QUARTER}", more=A_BOX)


@pytest.mark.parametrize("turn", [0, 1])
def test_a_hinge_beside_its_links_frame_carries_the_frame_onto_the_axis(turn: float) -> None:
    # The joint is 0.5 along the door's y, which is the model's -x: the edge of the door, right
    # above the origin.
    robot = model(
        DOOR + joint("hinge", "frame", "door", "revolute", f"<pose>0 0.5 0 0 0 {turn}</pose>")
    )
    about(robot.joints["hinge"].pose, (0, 0, 1), (0, 0, QUARTER))
    about(robot.links["door"].collisions[0].pose, (0, -0.5, 0))
    assert joint_axes(robot)["hinge"].xyz == pytest.approx((0, 0, 1))
    assert lump(robot).centre == pytest.approx((0.25, 0, 0.5))


@pytest.mark.parametrize(
    ("kind", "pose"),
    [("revolute", "0 0 3 0 0 0"), ("prismatic", "0 0.5 0 0 0 0"), ("fixed", "0 0.5 0 0 0 0")],
    ids=["along the axis", "a slide", "nothing moves"],
)
def test_a_links_frame_stays_where_it_need_not_be_moved(kind: str, pose: str) -> None:
    robot = model(DOOR + joint("hinge", "frame", "door", kind, f"<pose>{pose}</pose>"))
    about(robot.joints["hinge"].pose, (0.5, 0, 1), (0, 0, QUARTER))
    about(robot.links["door"].collisions[0].pose, (0, 0, 0))


def test_a_joint_may_name_frames_for_the_links_they_are_attached_to() -> None:
    robot = model(
        link("a")
        + link("b", "0 0 1 0 0 0")
        + '<frame name="f" attached_to="g"/><frame name="g" attached_to="b"/>'
        + joint("j", "__model__", "f")
    )
    assert (robot.joints["j"].parent, robot.joints["j"].child) == ("a", "b")


def test_a_model_inside_a_model_is_placed_in_it_and_keeps_its_names() -> None:
    inner = (
        f"<model name='arm'><pose>0 0 1 0 0 {QUARTER}</pose>"
        + link("base", "1 0 0 0 0 0")
        + link("tip", "0 0 1 0 0 0", "base")
        + joint("j", "base", "tip")
        + "</model>"
    )
    robot = model(link("base") + inner + joint("hold", "base", "arm::base"))
    assert list(robot.links) == ["base", "arm::base", "arm::tip"]
    assert {name: (part.parent, part.child) for name, part in robot.joints.items()} == {
        "hold": ("base", "arm::base"),
        "arm::j": ("arm::base", "arm::tip"),
    }
    assert link_frames(robot)["arm::tip"].xyz == pytest.approx((0, 1, 2))


def test_the_root_is_the_link_that_no_joint_holds_even_if_another_is_canonical() -> None:
    robot = model(link("wheel") + link("base", "0 0 1 0 0 0") + joint("j", "base", "wheel"))
    assert robot.root == "base"
    assert link_frames(robot)["wheel"].xyz == (0, 0, 0)


def test_a_frame_that_is_nowhere_is_reported() -> None:
    for body, message in [
        (link("a", "0 0 0 0 0 0", "b"), "names the unknown frame 'b'; frames: a"),
        (link("a", "0 0 0 0 0 0", "a"), "has a circular pose reference: m::a"),
        (
            link("a") + link("b", "0 0 0 0 0 0", "c") + link("c", "0 0 0 0 0 0", "b"),
            "has a circular pose reference: m::b, m::c",
        ),
        (
            link("a")
            + '<frame name="f" attached_to="g"/><frame name="g" attached_to="f"/>'
            + joint("j", "a", "f"),
            "<joint name='j'> names 'f', which is attached to itself in a loop",
        ),
        (link("a") + joint("j", "a", "ghost"), "<joint name='j'> names the unknown frame 'ghost'"),
        (
            link("a") + joint("j", "a", "world"),
            "<joint name='j'> connects 'the world', which is not a link of this model",
        ),
        (link("a") + joint("j", "a", "a"), "<joint name='j'> connects the link 'a' to itself"),
    ]:
        with pytest.raises(RobotError) as error:
            model(body)
        assert message in str(error.value) and str(error.value).startswith("a.sdf, line 1: <")


def test_a_chain_of_a_thousand_frames_ends_where_it_should() -> None:
    frames = '<frame name="f0"/>' + "".join(
        f'<frame name="f{i}"><pose relative_to="f{i - 1}">0 0 0.001 0 0 0</pose></frame>'
        for i in range(1, 1001)
    )
    robot = model(frames + link("a") + link("b", "0 0 0 0 0 0", "f1000") + joint("j", "a", "b"))
    assert link_frames(robot)["b"].xyz == pytest.approx((0, 0, 1))


NUMBER = st.floats(-3, 3)


@given(NUMBER, NUMBER, NUMBER)
def test_roll_pitch_and_yaw_come_back_from_their_matrix(
    roll: float, pitch: float, yaw: float
) -> None:
    matrix = matrix_of((roll, pitch, yaw))
    np.testing.assert_allclose(matrix_of(rpy_of(matrix)), matrix, atol=1e-7)


@pytest.mark.parametrize("pitch", [QUARTER, -QUARTER])
def test_straight_up_and_down_keep_their_turn(pitch: float) -> None:
    matrix = matrix_of((0.3, pitch, 1.1))
    np.testing.assert_allclose(matrix_of(rpy_of(matrix)), matrix, atol=1e-9)


@given(st.lists(st.tuples(*[NUMBER] * 6), min_size=6, max_size=6))
def test_an_inverse_undoes_its_frame(numbers: list[tuple[float, ...]]) -> None:
    frame = Frame(np.array(numbers[0][:3]), matrix_of(numbers[0][3:]))
    back = frame @ frame.inverse
    np.testing.assert_allclose(back.position, 0, atol=1e-12)
    np.testing.assert_allclose(back.rotation, np.eye(3), atol=1e-12)


def twin(robot: RobotModel, relative: bool) -> str:
    """The SDF of a URDF robot: links placed in the model, or each in the link that carries it."""
    frames, above = link_frames(robot), {part.child: part for part in robot.joints.values()}
    parts = []
    for name, part in robot.links.items():
        carried = relative and name in above
        pose = above[name].pose if carried else frames[name].pose
        within = f' relative_to="{above[name].parent}"' if carried else ""
        message = " ".join(map(repr, (*pose.xyz, *pose.rpy)))
        parts.append(
            f'<link name="{name}"><pose{within}>{message}</pose>{_inertial(part.inertial)}</link>'
        )
    for held in robot.joints.values():
        axis = f"<axis><xyz>{' '.join(map(repr, held.axis))}</xyz></axis>"
        parts.append(joint(held.name, held.parent, held.child, held.kind, axis))
    return "".join(parts)


def _inertial(inertial: Inertial | None) -> str:
    if inertial is None:
        return "<inertial><mass>0</mass></inertial>"
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    numbers = "".join(
        f"<{name}>{value!r}</{name}>" for name, value in zip(names, inertial.inertia, strict=True)
    )
    pose = " ".join(map(repr, (*inertial.pose.xyz, *inertial.pose.rpy)))
    return f"<inertial><pose>{pose}</pose><mass>{inertial.mass!r}</mass><inertia>{numbers}</inertia></inertial>"  # noqa: E501


@pytest.mark.parametrize("relative", [False, True], ids=["in the model", "in each other"])
def test_hb_bot_written_in_sdf_is_the_same_robot(relative: bool) -> None:
    urdf = load(REPO / "urdf" / "hb_bot.urdf.xacro")
    sdf = model(twin(urdf, relative))
    assert (sdf.root, list(sdf.links), list(sdf.joints)) == (
        urdf.root,
        list(urdf.links),
        list(urdf.joints),
    )
    ours, theirs = link_frames(sdf), link_frames(urdf)
    for name in theirs:
        np.testing.assert_allclose(ours[name].position, theirs[name].position, atol=1e-12)
        np.testing.assert_allclose(ours[name].rotation, theirs[name].rotation, atol=1e-12)
    axes = joint_axes(urdf)
    for name, axis in joint_axes(sdf).items():
        assert axis.xyz == pytest.approx(axes[name].xyz, abs=1e-12)
        assert axis.direction == pytest.approx(axes[name].direction, abs=1e-12)
    body, other = lump(sdf), lump(urdf)
    assert body.mass == pytest.approx(other.mass)
    assert body.centre == pytest.approx(other.centre)
    assert body.inertia == pytest.approx(other.inertia)


def test_parts_of_one_model_keep_their_places_to_each_other() -> None:
    text = (
        '<sdf version="1.9"><model name="m"><pose>1 0 0 0 0 '
        f"{QUARTER}</pose>{link('a')}{link('b', '2 0 0 0 0 0')}"
    )
    models = read_models(f"{text}</model></sdf>", Source(ORIGIN, {}))
    assert [part.name for part in models] == ["m", "m_b"]
    about(models[0].pose, (1, 0, 0), (0, 0, QUARTER))
    about(models[1].pose, (1, 2, 0), (0, 0, QUARTER))
