"""SDF models become robots; what is wrong with one is a line with its place."""

import math
from pathlib import Path

import pytest

from holozen.robot.errors import RobotError
from holozen.robot.files.elements import Source, read_xml
from holozen.robot.files.sdf_models import parse_sdf, read_models
from holozen.robot.model import Drive, Inertial, Limits, Link, Mimic, Pose, RobotModel, Surface

ORIGIN = Path("/nowhere/a.sdf")
MASS = "<inertial><mass>1</mass></inertial>"
BARE = '<link name="a"/>'
A, B = (f'<link name="{name}">{MASS}</link>' for name in "ab")


def read(body: str, version: str = "1.9") -> list[RobotModel]:
    """The models of a file whose `body` starts on line 2."""
    source = Source(Path("a.sdf"), {})
    return read_models(f'<sdf version="{version}">\n{body}\n</sdf>', source)


def model(body: str, version: str = "1.9") -> RobotModel:
    (only,) = read(f'<model name="m">\n{body}\n</model>', version)
    return only


def refusal(body: str) -> str:
    with pytest.raises(RobotError) as error:
        model(body)
    message = str(error.value)
    assert message.startswith("a.sdf, line 3: <") and message.isprintable()
    return message.removeprefix("a.sdf, line 3: ")


def only_link(inside: str) -> Link:
    return model(f'<link name="a">{inside}</link>').links["a"]


def test_a_model_has_its_name_root_links_and_joints() -> None:
    robot = model(f'{A}{B}<joint name="j" type="fixed"><parent>a</parent><child>b</child></joint>')
    assert (robot.name, robot.root, list(robot.links), list(robot.joints)) == (
        "m",
        "a",
        ["a", "b"],
        ["j"],
    )
    assert (robot.static, robot.pose, robot.drive, robot.warnings) == (False, Pose(), None, ())


def test_masses_and_inertias_are_read() -> None:
    inertia = "".join(
        f"<{name}>{value}</{name}>"
        for name, value in {
            "ixx": 1.5,
            "ixy": 0.1,
            "ixz": 0.2,
            "iyy": 2,
            "iyz": 0.3,
            "izz": 3,
        }.items()
    )
    link = only_link(f"<inertial><mass> 2 </mass><inertia>{inertia}</inertia></inertial>")
    assert link.inertial == Inertial(Pose(), 2.0, (1.5, 0.1, 0.2, 2, 0.3, 3))


def test_what_an_inertial_leaves_out_is_1() -> None:
    assert only_link("<inertial/>").inertial == Inertial(Pose(), 1.0, (1, 0, 0, 1, 0, 1))


def test_a_link_without_inertial_has_gazebos_and_is_reported() -> None:
    robot = model(BARE)
    assert robot.links["a"].inertial == Inertial(Pose(), 1.0, (1, 0, 0, 1, 0, 1))
    assert robot.warnings == (
        "a.sdf, line 3: <link name='a'> has no <inertial>; as in Gazebo it is treated as 1 kg "
        "with 1 kg m^2 about each"
        " axis",
    )


def test_a_static_model_needs_no_inertial() -> None:
    robot = model(f"<static>true</static>{BARE}")
    assert robot.static and robot.links["a"].inertial is None and robot.warnings == ()


@pytest.mark.parametrize(
    ("inertial", "message"),
    [
        ("<mass>0</mass>", "has no mass; the link is treated as massless, with no inertia"),
        (
            "<inertia><ixx>0</ixx></inertia>",
            "is zero or not positive definite, which is impossible",
        ),
    ],
)
def test_an_inertia_that_no_body_has_makes_a_warning(inertial: str, message: str) -> None:
    robot = model(f'<link name="a"><inertial>{inertial}</inertial></link>')
    assert robot.links["a"].inertial is not None
    assert robot.links["a"].inertial.inertia == (0, 0, 0, 0, 0, 0)
    assert len(robot.warnings) == 1 and message in robot.warnings[0]


def test_the_surface_is_that_of_ode_or_of_bullet() -> None:
    contact = "<contact><ode><kp>1e12</kp><kd>2</kd></ode></contact>"
    ode = f"<friction><ode><mu>0.3</mu><mu2>0.4</mu2></ode></friction>{contact}"
    bullet = (
        "<friction><bullet><friction>0.5</friction><friction2>0.6</friction2></bullet></friction>"
    )
    sphere = "<geometry><sphere><radius>1</radius></sphere></geometry>"
    link = only_link(f'{MASS}<collision name="c">{sphere}<surface>{ode}</surface></collision>')
    assert link.surface == Surface(0.3, 0.4, 1e12, 2)
    link = only_link(f'{MASS}<collision name="c">{sphere}<surface>{bullet}</surface></collision>')
    assert link.surface == Surface(0.5, 0.6)


def test_collisions_with_different_surfaces_are_reported() -> None:
    surface = "<surface><friction><ode><mu>{0}</mu></ode></friction></surface>"
    collision = f'<collision name="c{{0}}"><geometry><empty/></geometry>{surface}</collision>'
    robot = model(f'<link name="a">{MASS}{collision.format(1)}{collision.format(2)}</link>')
    assert robot.links["a"].surface.mu1 == 1
    assert robot.warnings == (
        "a.sdf, line 3: <link name='a'> has collisions with different surfaces; the first is used "
        "for all",
    )


def test_self_collision_is_the_models_unless_the_link_overrides_it() -> None:
    inside = (
        f"<self_collide>1</self_collide>{A}<link "
        f'name="b">{MASS}<self_collide>0</self_collide></link>'
    )
    joint = '<joint name="j" type="fixed"><parent>a</parent><child>b</child></joint>'
    links = model(inside + joint).links
    assert (links["a"].surface.self_collide, links["b"].surface.self_collide) == (True, False)


def test_a_link_may_be_without_gravity() -> None:
    assert only_link(MASS).gravity
    assert not only_link(f"{MASS}<gravity>false</gravity>").gravity


JOINT = '<joint name="j" type="{}"><parent>a</parent><child>b</child><axis>{}</axis></joint>'


def test_limits_are_infinite_where_the_file_sets_none() -> None:
    for kind, axis, is_kind, limits in [
        ("revolute", "", "continuous", Limits()),
        (
            "revolute",
            "<limit><lower>-1e16</lower><upper>1e16</upper></limit>",
            "continuous",
            Limits(),
        ),
        (
            "revolute",
            "<limit><lower>-1</lower><upper>2</upper></limit>",
            "revolute",
            Limits(lower=-1, upper=2),
        ),
        ("revolute", "<limit><upper>2</upper></limit>", "revolute", Limits(upper=2)),
        (
            "prismatic",
            "<limit><effort>-1</effort><velocity>-1</velocity></limit>",
            "prismatic",
            Limits(),
        ),
        (
            "prismatic",
            "<limit><effort>5</effort><velocity>0</velocity></limit>",
            "prismatic",
            Limits(5, 0),
        ),
        (
            "continuous",
            "<limit><lower>0</lower><effort>3</effort></limit>",
            "continuous",
            Limits(3),
        ),
        ("fixed", "<limit><lower>5</lower><upper>5</upper></limit>", "fixed", Limits()),
    ]:
        joint = model(A + B + JOINT.format(kind, axis)).joints["j"]
        assert (joint.kind, joint.limits) == (is_kind, limits)


def test_friction_damping_and_mimic_are_read() -> None:
    axis = (
        "<dynamics><damping>0.1</damping><friction>0.2</friction></dynamics>"
        "<mimic "
        'joint="k"><multiplier>2</multiplier><offset>1</offset><reference>0.25</reference></mimic>'
    )
    leader = JOINT.format("revolute", "").replace('"j"', '"k"').replace("<child>b", "<child>c")
    joint = model(
        f'{A}{B}<link name="c">{MASS}</link>{leader}{JOINT.format("revolute", axis)}'
    ).joints["j"]
    assert (joint.friction, joint.damping) == (0.2, 0.1)
    assert joint.mimic == Mimic("k", 2.0, 0.5)  # 2 (q - 0.25) + 1


def test_a_joint_of_a_model_inside_follows_one_beside_it() -> None:
    joints = JOINT.format("revolute", "").replace('"j"', '"k"').replace(
        "<child>b", "<child>c"
    ) + JOINT.format("revolute", '<mimic joint="k"/>')
    inner = f'<model name="arm">{A}{B}<link name="c">{MASS}</link>{joints}</model>'
    hold = '<joint name="hold" type="fixed"><parent>base</parent><child>arm::a</child></joint>'
    robot = model(f'<link name="base">{MASS}</link>{inner}{hold}')
    assert robot.joints["arm::j"].mimic == Mimic("arm::k")


def test_a_joint_that_is_not_simulated_is_reported_and_fixed() -> None:
    for kind in ["ball", "universal", "screw", "revolute2"]:
        robot = model(A + B + JOINT.format(kind, ""))
        assert robot.joints["j"].kind == "fixed"
        slides = (
            ", and its link 'b' slides without friction" if kind in ("ball", "universal") else ""
        )
        assert robot.warnings == (
            f"a.sdf, line 3: <joint name='j'> is of the type {kind}, which is not simulated;"
            f" it is treated as fixed{slides}",
        )


def test_the_link_of_a_ball_joint_slides_as_a_caster_rolls() -> None:
    for kind, friction in [("ball", 0.0), ("universal", 0.0), ("fixed", 0.9), ("screw", 0.9)]:
        mu = "<surface><friction><ode><mu>0.9</mu><mu2>0.9</mu2></ode></friction></surface>"
        ball = f"<collision><geometry><sphere><radius>1</radius></sphere></geometry>{mu}</collision></link>"  # noqa: E501
        robot = model(A + B.replace("</link>", ball) + JOINT.format(kind, ""))
        assert (robot.links["b"].surface.mu1, robot.links["b"].surface.mu2) == (friction, friction)
        assert robot.links["a"].surface == Surface()


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (
            f'<link name="a">{MASS}<kinematic>1</kinematic></link>',
            "<link name='a'> is kinematic, which is not simulated; gravity and contacts act on it "
            "as on any link",
        ),
        (
            A
            + B
            + JOINT.format(
                "revolute", "<dynamics><spring_stiffness>1e9</spring_stiffness></dynamics>"
            ),
            "<joint name='j'> has a spring, which is not simulated",
        ),
        (
            f"<placement_frame>a</placement_frame>{A}",
            "<model name='m'> has an unknown placement_frame",
        ),
    ],
)
def test_what_is_not_simulated_is_reported(body: str, message: str) -> None:
    (warning,) = model(body).warnings
    assert warning.startswith(f"a.sdf, line {2 if 'placement' in message else 3}: {message}")


def test_a_gearbox_is_left_out() -> None:
    robot = model(
        A + B + JOINT.format("fixed", "") + JOINT.format("gearbox", "").replace('"j"', '"k"')
    )
    assert list(robot.joints) == ["j"]
    assert "line 3: <joint name='k'> is a gearbox, which is not simulated" in robot.warnings[0]


@pytest.mark.parametrize(("kind", "warnings"), [("fixed", 0), ("revolute", 1)])
def test_what_is_fixed_to_the_world_is_static(kind: str, warnings: int) -> None:
    joint = f'<joint name="j" type="{kind}"><parent>world</parent><child>a</child></joint>'
    robot = model(A + joint)
    assert (robot.static, robot.joints, len(robot.warnings)) == (True, {}, warnings)


def test_a_joint_and_a_link_may_share_a_name_as_old_files_do() -> None:
    robot = model(A + B + JOINT.format("fixed", "").replace('"j"', '"b"'), "1.6")
    assert (list(robot.links), list(robot.joints)) == (["a", "b"], ["b"])


def test_links_that_no_joint_holds_are_bodies_of_their_own() -> None:
    joint = '<joint name="j" type="fixed"><parent>c</parent><child>b</child></joint>'
    models = read(f'<model name="m">{A}{B}<link name="c">{MASS}</link>{joint}</model>')
    assert [(part.name, part.root, list(part.links), list(part.joints)) for part in models] == [
        ("m", "a", ["a"], []),
        ("m_c", "c", ["b", "c"], ["j"]),
    ]


def test_the_canonical_link_decides_which_body_has_the_models_name() -> None:
    models = read(f'<model name="m" canonical_link="b">{A}{B}</model>')
    assert [(part.name, part.root) for part in models] == [("m", "b"), ("m_a", "a")]


def test_a_static_model_is_one_body_however_many_links_it_has() -> None:
    robot = model(f'<static>1</static>{BARE}<link name="b"><pose>1 0 0 0 0 0</pose></link>')
    assert (robot.static, list(robot.links)) == (True, ["a", "b"])
    (joint,) = robot.joints.values()
    assert (joint.kind, joint.parent, joint.child, joint.pose.xyz) == ("fixed", "a", "b", (1, 0, 0))


def test_a_plane_makes_a_model_static() -> None:
    collision = '<collision name="c"><geometry><plane/></geometry></collision>'
    robot = model(f'<link name="a">{collision}</link>')
    assert robot.static
    assert robot.warnings == (
        "a.sdf, line 3: <plane> of <collision name='c'> is not a shape of a moving body;"
        " the model is treated as static",
    )


def test_plugins_directly_in_the_model_drive_it() -> None:
    drive = model(f'{A}<plugin name="p" filename="libgazebo_ros_planar_move.so"/>').drive
    assert drive == Drive(robot_base_frame="a")


def test_a_warning_names_a_sensor_that_is_not_simulated() -> None:
    robot = model(
        f'<link name="a">{MASS}<sensor name="s" '
        'type="gps"><update_rate>50</update_rate></sensor></link>'
    )
    assert robot.warnings == ("a.sdf, line 3: <sensor name='s'> (gps) is not simulated",)


def test_misspelt_elements_are_reported_once_with_the_nearest_name() -> None:
    link = '<link name="{}"><inertal/><a:own/></link>'
    robot = model(
        f"<static>1</static>{link.format('a')}{link.format('b')}<my:thing/>".replace(
            "a:own", "my:own"
        )
    )
    assert robot.warnings == (
        "a.sdf, line 3: <inertal> of <link name='a'> is not an SDF child of <link> and is ignored"
        " (did you mean 'inertial'?)",
    )


def test_a_mistake_is_one_line_with_its_place() -> None:
    rows = [
        ("<link/>", "<link> of <model name='m'> has no name=\"...\""),
        (
            A + A,
            "<link name='a'> has a duplicate name (first at a.sdf, line 3); give each a "
            "unique name",
        ),
        (A + '<frame name="a"/>', "<frame name='a'> has a duplicate name"),
        (A + B + 2 * JOINT.format("fixed", ""), "<joint name='j'> has a duplicate name"),
        (
            A + "<static>perhaps</static>",
            "<static> of <model name='m'> is 'perhaps'; it must be true or false",
        ),
        (
            f'<link name="a"><pose>0 0 0</pose>{MASS}</link>',
            "of <link name='a'>: '0 0 0' has 3 numbers instead of 6",
        ),
        (f'<link name="a"><pose>0 0 nan 0 0 0</pose>{MASS}</link>', "'nan' is not a finite number"),
        (
            f'<link name="a"><pose>0 0 1e9 0 0 0</pose>{MASS}</link>',
            "puts it beyond 1e+06 m, where only a static",
        ),
        (
            f'<link name="a"><pose rotation_format="quat_xyzw">0 0 0 0 0 0 0</pose>{MASS}</link>',
            "has a quaternion of length 0",
        ),
        (
            '<link name="a"><inertial><mass>-1</mass></inertial></link>',
            "<mass> of <link name='a'> is -1.0 kg, which",
        ),
        (
            '<link name="a"><inertial><mass>nan</mass></inertial></link>',
            "'nan' is not a finite number",
        ),
        (
            '<link name="a"><inertial><mass>two</mass></inertial></link>',
            "'two' is not a finite number",
        ),
        (
            '<link name="a"><inertial><mass/></inertial></link>',
            "link name='a'>: '' has 0 numbers instead of 1",
        ),
        (
            '<link name="a"><inertial><inertia><ixx>-1</ixx></inertia></inertial></link>',
            "has ixx=-1.0, iyy=1.0, izz=1.0; a moment of inertia is never negative",
        ),
        (A + '<joint name="j"><child>a</child></joint>', "<joint name='j'> has no type"),
        (
            A + B + JOINT.format("hinge", ""),
            "has unknown type 'hinge'; known types: continuous, revolute, prismatic",
        ),
        (
            A + '<joint name="j" type="fixed"><parent>a</parent></joint>',
            "<joint name='j'> has no <child>",
        ),
        (
            A + B + JOINT.format("revolute", "<xyz>0 0 0</xyz>"),
            "<axis> of <joint name='j'> has no direction in xyz",
        ),
        (
            A + B + JOINT.format("revolute", "<xyz>0 1</xyz>"),
            "<xyz> of <joint name='j'>: '0 1' has 2 numbers",
        ),
        (
            A + B + JOINT.format("revolute", "<limit><lower>2</lower><upper>1</upper></limit>"),
            "<limit> of <joint name='j'> has lower 2.0 above upper 1.0",
        ),
        (
            A + B + JOINT.format("revolute", "<dynamics><damping>-1</damping></dynamics>"),
            "has friction 0.0 and damping -1.0; a negative one would drive the joint",
        ),
        (
            A + B + JOINT.format("revolute", '<mimic joint="ghost"/>'),
            "<joint name='j'> follows the joint 'ghost', which does not exist; joints: j",
        ),
        (
            A + B + JOINT.format("revolute", '<mimic joint="j"/>'),
            "<joint name='j'> follows itself in a loop through the joints j",
        ),
        (
            A + B + JOINT.format("fixed", "") + JOINT.format("fixed", "").replace('"j"', '"k"'),
            "<joint name='k'> has the child link 'b', which is already the child of the joint 'j'",
        ),
        (
            A + B + JOINT.format("fixed", "").replace("<child>b", "<child>a"),
            "connects the link 'a' to",
        ),
        (
            f'<link name="a">{MASS}<collision '
            'name="c"><geometry/><surface><friction><ode><mu>-1</mu></ode></friction>'
            "</surface></collision></link>",
            "<geometry> of <collision name='c'> contains nothing",
        ),
        (
            f'<link name="a">{MASS}<collision '
            'name="c"><geometry><empty/></geometry><surface><friction><ode><mu>-1</mu>'
            "</ode></friction></surface></collision></link>",
            "<mu> of <collision name='c'> is -1.0, which is negative",
        ),
        ('<model name="x::y"><link name="a"/></model>', "<model name='x::y'> has '::' in its name"),
    ]
    for body, message in rows:
        assert message in refusal(body)


def test_joints_in_a_circle_are_reported() -> None:
    joints = '<joint name="j" type="fixed"><parent>{}</parent><child>{}</child></joint>'
    with pytest.raises(
        RobotError, match="has joints that form a loop through the links a, b; remove one joint"
    ):
        model(A + B + joints.format("a", "b") + joints.format("b", "a").replace('"j"', '"k"'))


def test_a_file_without_a_model_is_reported() -> None:
    for text, message in [
        ("<robot name='r'/>", "a.sdf, line 1: <robot name='r'> is not an <sdf>"),
        ("<sdf/>", "a.sdf, line 1: <sdf> has no <model> with a <link>"),
        ("<sdf><model name='m'/></sdf>", "a.sdf, line 1: <sdf> has no <model> with a <link>"),
        (
            "<sdf><world name='w'/></sdf>",
            "contains a <world>, not a robot or an object; pass it to the simulator as",
        ),
        (
            "<sdf>\n<model name='m'></sdf>",
            "a.sdf, line 2: broken XML: mismatched tag; <model name='m'> of a.sdf, line 2",
        ),
        (
            "<sdf>" + 2 * '<model name="m"><static>1</static><link name="a"/></model>' + "</sdf>",
            "<model name='m'> has a duplicate name",
        ),
        ("<sdf><model><link name='a'/></model></sdf>", "<model> has no name"),
    ]:
        with pytest.raises(RobotError) as error:
            read_models(text, Source(Path("a.sdf"), {}))
        assert message in str(error.value) and str(error.value).isprintable()


def test_a_robot_is_one_body() -> None:
    text = f'<sdf version="1.9"><model name="m">{A}{B}</model></sdf>'
    with pytest.raises(
        RobotError,
        match=r"holds 2 bodies that no joint connects \(m, m_b\); a robot has to be one body",
    ):
        parse_sdf(read_xml(text, "a.sdf"), Source(ORIGIN, {}))


def test_two_bodies_of_one_name_are_reported() -> None:
    with pytest.raises(RobotError, match="<model name='m_b'> makes a second body called 'm_b'"):
        read(f'<model name="m">{A}{B}</model><model name="m_b">{A}</model>')


def test_a_model_of_too_many_links_is_refused() -> None:
    links = "".join(f'<link name="l{i}"/>' for i in range(1001))
    with pytest.raises(
        RobotError, match="has 1001 links and 0 joints; a model has at most 1000 of each"
    ):
        model(f"<static>1</static>{links}")


def test_a_joint_that_turns_has_no_limit_to_its_angle() -> None:
    assert math.isinf(model(A + B + JOINT.format("continuous", "")).joints["j"].limits.upper)
