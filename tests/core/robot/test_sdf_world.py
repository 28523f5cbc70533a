"""World files are read for what is simulated; what is not is named, and what is wrong is one line
with its place.
"""

import math
from pathlib import Path

import numpy as np
import pytest

from holozen.robot.errors import RobotError
from holozen.robot.files.sdf_world import load_world
from holozen.robot.model import GRAVITY, STEP, WorldSpec
from holozen.robot.rigid import Frame, lump

REPO = Path(__file__).parents[3]
QUARTER = math.pi / 2
BOX = (
    '<link name="l"><collision name="c"><geometry><box><size>1 1 '
    "1</size></box></geometry></collision></link>"
)
STATIC = f'<model name="{{}}"><static>1</static>{{}}{BOX}</model>'


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for variable in (
        "GZ_SIM_RESOURCE_PATH",
        "IGN_GAZEBO_RESOURCE_PATH",
        "GAZEBO_MODEL_PATH",
        "ROS_PACKAGE_PATH",
    ):
        monkeypatch.delenv(variable, raising=False)
    tmp_path.chmod(0o1777)
    (tmp_path / "home").mkdir()
    return tmp_path / "home" / "my.world"


NOT_FINITE = "is not a finite number; write numbers such as 0.25, separated by spaces"


def loaded(path: Path, body: str, name: str = ' name="w"', version: str = "1.9") -> WorldSpec:
    path.write_text(f'<sdf version="{version}"><world{name}>\n{body}</world></sdf>')
    return load_world(path)


def physics(path: Path, tag: str, text: str) -> WorldSpec:
    return loaded(path, f"<physics><{tag}>{text}</{tag}></physics>")


def refusal(path: Path, content: bytes | None = None) -> str:
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(RobotError) as error:
        load_world(path)
    message = str(error.value)
    assert message.startswith(str(path)) and message.isprintable()
    return message.removeprefix(str(path))


@pytest.mark.parametrize("name", ["gazebo", "empty", "arena"])
def test_the_worlds_of_the_tree_have_sun_ground_and_the_engines_step(name: str) -> None:
    spec = load_world(REPO / "worlds" / f"{name}.world")
    assert spec.step == pytest.approx(1 / 240, rel=1e-12)
    assert (spec.name, spec.gravity, spec.rtf, spec.ground, spec.warnings) == (
        name,
        (0, 0, -9.8),
        1,
        True,
        (),
    )
    assert bool(spec.models) == (name == "arena")


def test_an_empty_world_element_has_the_defaults_and_no_ground(path: Path) -> None:
    assert loaded(path, "", name="") == WorldSpec("default", STEP, GRAVITY, 1.0, False, ())


def test_step_gravity_and_factor_are_read(path: Path) -> None:
    spec = loaded(
        path,
        "<gravity> 0 0\n -1.62 </gravity>"
        "<physics><max_step_size>0.001</max_step_size><real_time_factor>0.5</real_time_factor></physics>",
    )
    assert (spec.name, spec.step, spec.gravity, spec.rtf) == ("w", 0.001, (0, 0, -1.62), 0.5)


def test_of_several_physics_the_default_one_counts_or_else_the_first(path: Path) -> None:
    one, two = (
        f"<physics{{}}><max_step_size>{step}</max_step_size></physics>" for step in (0.001, 0.002)
    )
    assert loaded(path, one.format("") + two.format("")).step == 0.001
    assert loaded(path, one.format("") + two.format(' default="1"')).step == 0.002


def test_gravity_may_stand_in_physics_as_it_did_in_old_files(path: Path) -> None:
    assert loaded(path, "<physics><gravity>0 0 -3</gravity></physics>").gravity == (0, 0, -3)


UP, DOWN = "<pose>0 0 1 0 0 0</pose>", "<pose>0 0 -1 0 0 0</pose>"
UPWARDS = "<normal>0 0 2</normal>"
PLANE = (
    '<link name="l"><collision name="c">{}<geometry><plane>{}</plane></geometry></collision></link>'
)


def test_a_level_plane_at_zero_is_ground(path: Path) -> None:
    for body in [
        "<include><uri>model://ground_plane</uri></include>",
        "<include><uri> model://asphalt_plane </uri></include>",
        f'<model name="floor"><static>1</static>{PLANE.format("", "")}</model>',
        "<model "
        f'name="m"><static>1</static>{PLANE.format("<pose>5 0 0 0 0 1</pose>", UPWARDS)}</model>',
        f'<model name="up"><static>1</static>{UP}{PLANE.format(DOWN, "")}</model>',
    ]:
        spec = loaded(path, body)
        assert (spec.ground, spec.models, spec.warnings) == (True, (), ())


def test_any_other_plane_is_a_static_model_where_it_stands(path: Path) -> None:
    for body, xyz, up in [
        (
            "<include><uri>model://ground_plane</uri><pose>0 0 -0.5 0 0 0</pose></include>",
            (0, 0, -0.5),
            (0, 0, 1),
        ),
        (
            "<include><uri>model://ground_plane</uri><pose>0 0 0 0.1 0 0</pose></include>",
            (0, 0, 0),
            (0, -math.sin(0.1), math.cos(0.1)),
        ),
        (
            "<model "
            f'name="wall"><static>1</static>{PLANE.format("", "<normal>1 0 0</normal>")}</model>',
            (0, 0, 0),
            (1, 0, 0),
        ),
        (
            '<model name="m"><static>1</static><pose>0 0 2 0 0 '
            f"0</pose>{PLANE.format('', '')}</model>",
            (0, 0, 2),
            (0, 0, 1),
        ),
    ]:
        spec = loaded(path, body)
        (model,) = spec.models
        (placed,) = lump(model).collisions
        frame = Frame.of(model.pose) @ Frame.of(placed.shape.pose)
        assert not spec.ground and model.static and placed.shape.kind == "plane"
        np.testing.assert_allclose(frame.position, xyz, atol=1e-12)
        np.testing.assert_allclose(frame.rotation[:, 2], up, atol=1e-12)


def test_a_ground_with_more_on_it_stays_a_model(path: Path) -> None:
    body = PLANE.format("", "").replace(
        "</link>", BOX.removeprefix('<link name="l">').replace('"c"', '"d"')
    )
    spec = loaded(path, f'<model name="m"><static>1</static>{body}</model>')
    assert not spec.ground and len(spec.models[0].links["l"].collisions) == 2


def test_a_second_header_in_the_middle_is_read_as_gazebo_does(path: Path) -> None:
    spec = loaded(path, f'<?xml version="1.0" ?>\n{STATIC.format("m", "")}')
    assert [model.name for model in spec.models] == ["m"]
    (warning,) = spec.warnings
    assert warning.startswith(f"{path}, line 2: a second <?xml ...?> header")


def test_a_sun_is_no_ground_and_no_model(path: Path) -> None:
    spec = loaded(path, "<include><uri>model://sun</uri><pose>0 0 5 0 0 0</pose></include>")
    assert (spec.ground, spec.models, spec.warnings) == (False, (), ())


def test_models_stand_where_the_file_puts_them(path: Path) -> None:
    spec = loaded(
        path,
        '<frame name="corner"><pose>10 0 0 0 0 0</pose></frame>'
        + STATIC.format("a", f'<pose relative_to="corner">1 0 0 0 0 {QUARTER}</pose>')
        + STATIC.format("b", '<pose relative_to="a">2 0 0 0 0 0</pose>')
        + STATIC.format("c", '<pose relative_to="world">0 0 7 0 0 0</pose>')
        + STATIC.format("d", ""),
    )
    assert [model.name for model in spec.models] == ["a", "b", "c", "d"]
    expected = [(11, 0, 0), (11, 2, 0), (0, 0, 7), (0, 0, 0)]
    for model, xyz in zip(spec.models, expected, strict=True):
        assert model.static and model.pose.xyz == pytest.approx(xyz)


def test_a_model_of_the_users_is_included(path: Path) -> None:
    (path.parent / "models" / "table").mkdir(parents=True)
    text = f'<sdf version="1.6">{STATIC.format("table", "")}</sdf>'
    (path.parent / "models" / "table" / "model.sdf").write_text(text)
    spec = loaded(path, "<include><uri>model://table</uri><pose>1 2 0 0 0 0</pose></include>")
    assert [(model.name, model.pose.xyz) for model in spec.models] == [("table", (1, 2, 0))]


def test_models_that_are_nowhere_are_named_and_left_out(path: Path) -> None:
    spec = loaded(path, '<include><uri>model://airplane</uri></include>\n<model name="table"/>')
    assert not spec.ground and spec.models == ()
    assert [
        warning.removeprefix(str(path)).partition("; looked")[0] for warning in spec.warnings
    ] == [
        ", line 2: <include> of <world name='w'> ('model://airplane') is not found and is left out",
        ", line 3: <model name='table'> has no <link> and is left out",
    ]


def test_what_needs_no_physics_is_passed_over_in_silence(path: Path) -> None:
    quiet = (
        "gui",
        "scene",
        "state",
        "plugin",
        "audio",
        "wind",
        "magnetic_field",
        "atmosphere",
        "my:own",
    )
    body = "".join(f"<{name}/>" for name in (*quiet, "spherical_coordinates"))
    assert loaded(path, body, ' name="w" xmlns:my="x"').warnings == ()


def test_what_is_not_simulated_or_unknown_is_reported(path: Path) -> None:
    spec = loaded(path, "<actor/>\n<modle/>\n<modle/>")
    assert [warning.removeprefix(f"{path}, ") for warning in spec.warnings] == [
        "line 2: <actor> of <world name='w'> is not simulated and is left out",
        "line 3: <modle> of <world name='w'> is not an SDF child of <world> and is ignored (did "
        "you mean 'model'?)",
    ]


def test_a_number_that_no_engine_survives_is_refused(path: Path) -> None:
    for tag, text, message in [
        ("max_step_size", "0", " is 0 s; use 0.0001 to 0.02"),
        ("max_step_size", "-1", " is -1 s; use 0.0001 to 0.02"),
        ("max_step_size", "1", " is 1 s; use 0.0001 to 0.02"),
        ("max_step_size", "nan", f": 'nan' {NOT_FINITE}"),
        ("max_step_size", "", ": '' has 0 numbers instead of 1"),
        ("real_time_factor", "-1", " is -1; use 0 (as fast as possible) to 1000"),
        ("real_time_factor", "1001", " is 1001; use 0 (as fast as possible) to 1000"),
        ("real_time_factor", "fast\nest", f": 'fast' {NOT_FINITE}"),
        ("gravity", "0 0", ": '0 0' has 2 numbers instead of 3"),
        ("gravity", "0 0 down", f": 'down' {NOT_FINITE}"),
        ("gravity", "0 0 -inf", f": '-inf' {NOT_FINITE}"),
        ("gravity", "0 0 1e300", ": '1e300' is beyond 1e+06; use metres, kilograms and radians"),
        ("gravity", "0 0 101", " is 0 0 101; use at most 100 m/s^2 along each axis"),
    ]:
        content = f'<sdf><world name="w">\n<physics>\n<{tag}>{text}</{tag}></physics></world></sdf>'
        assert refusal(path, content.encode()) == f", line 3: <{tag}> of <world name='w'>{message}"


@pytest.mark.parametrize("value", ["0.0001", "0.02"])
def test_the_ends_of_the_range_of_steps_are_in_it(path: Path, value: str) -> None:
    assert physics(path, "max_step_size", value).step == float(value)


def test_a_factor_of_zero_is_as_fast_as_it_goes(path: Path) -> None:
    assert physics(path, "real_time_factor", "0").rtf == 0


def test_an_ampersand_in_a_world_is_read_as_gazebo_does(path: Path) -> None:
    warnings = loaded(path, '<plugin name="a & b">x & y\n &amp; z</plugin>').warnings
    assert ["a & that starts no entity" in warning for warning in warnings] == [True, True]


def test_one_bad_model_is_left_out_of_a_world_and_named(path: Path) -> None:
    good = '<model name="{}"><static>1</static><link name="l"/></model>'
    bad = '<model name="bad"><pose relative_to="x"/><link name="l"/></model>'
    broken = '<model name="broken"><link name="l"><collision name="c"/></link></model>'
    spec = loaded(
        path,
        "\n".join(
            [good.format("a"), bad, good.format("b"), broken, good.format("a"), good.format("c")]
        ),
    )
    assert [model.name for model in spec.models] == ["a", "b", "c"]
    left = [
        warning for warning in spec.warnings if "this model of the world is left out" in warning
    ]
    assert ["names the unknown frame 'x'" in left[0], "has a dupl" in left[0]].count(
        True
    ) == 1 and len(left) == 3, left


def test_a_file_that_is_no_world_is_named_with_the_reason(path: Path) -> None:
    rows = [
        (b"<sdf>\n<world>\n</sdf>", ", line 3: broken XML: mismatched tag; <world> of "),
        (b"<sdf>\n<world>\n", ", line 3: broken XML: no element found; <world> of "),
        (b"", ": the file is empty; a robot is a <robot> or an <sdf>, a world an <sdf>"),
        (b"\0", ", line 1: broken XML: "),
        (b"<sdf>&evil;</sdf>", ", line 1: broken XML: undefined entity"),
        (b"<sdf>\xff</sdf>", ", line 1: byte 5 is not UTF-8 text; save the file as UTF-8"),
        (
            b'<robot name="r"/>',
            ", line 1: <robot name='r'> is a robot (URDF), not a world; pass it to",
        ),
        (b"<sdf/>", ", line 1: <sdf> holds no <world>"),
        (
            b'<sdf><model name="m"/></sdf>',
            ", line 1: <sdf> contains a model but no <world>; add it to a running world",
        ),
        (
            b"<world><world/></world>",
            ", line 1: <world> is not a world; a world file starts with <sdf",
        ),
    ]
    for content, message in rows:
        assert refusal(path, content).startswith(message)


def test_a_file_that_is_not_there_and_a_folder_are_named(path: Path) -> None:
    assert refusal(path) == ": No such file or directory"
    path.mkdir()
    assert refusal(path) == ": Is a directory"


def test_a_file_of_100_mb_is_refused_before_it_is_read(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(100_000_000)
    assert refusal(path).startswith(": the file contains 100.0 MB of XML")


def test_an_entity_is_not_read(path: Path) -> None:
    secret = path.with_name("secret")
    secret.write_text("0 0 -1")
    content = (
        "<!DOCTYPE a [<!ENTITY x SYSTEM "
        f'"{secret}">]><sdf><world><gravity>&x;</gravity></world></sdf>'
    )
    assert (
        refusal(path, content.encode())
        == ", line 1: the entity 'x' is declared; write out its text instead"
    )


def test_a_big_world_is_read_whole(path: Path) -> None:
    body = "\n".join(STATIC.format(f"box{i}", f"<pose>{i} 0 0.5 0 0 0</pose>") for i in range(500))
    spec = loaded(path, body)
    assert [model.pose.xyz[0] for model in spec.models] == list(range(500))


def solid(kind: str, mass: float, size: tuple[float, ...]) -> tuple[float, float, float]:
    """The textbook's moments of inertia of a solid."""
    if kind == "box":
        a, b, c = (side * side for side in size)
        return mass * (b + c) / 12, mass * (a + c) / 12, mass * (a + b) / 12
    if kind == "sphere":
        return (0.4 * mass * size[0] ** 2,) * 3
    radius, height = size
    across = mass * (3 * radius**2 + height**2) / 12
    return across, across, mass * radius**2 / 2


def test_what_there_is_to_push_in_the_arena_has_the_inertia_of_its_shape_and_stands_on_the_floor() -> (  # noqa: E501
    None
):
    things = [
        model for model in load_world(REPO / "worlds" / "arena.world").models if not model.static
    ]
    kinds = []
    for model in things:
        (link,) = model.links.values()
        (shape,) = link.collisions
        assert link.inertial is not None and link.inertial.mass > 0
        xx, xy, xz, yy, yz, zz = link.inertial.inertia
        assert (xx, yy, zz) == pytest.approx(
            solid(shape.kind, link.inertial.mass, shape.size), abs=1e-6
        )
        assert (xy, xz, yz) == (0, 0, 0)
        below = shape.size[0] if shape.kind == "sphere" else shape.size[-1] / 2
        stands = model.pose.xyz[2] - below
        assert stands == pytest.approx(0.4 if model.name == "small_crate" else 0, abs=1e-12)
        kinds.append(shape.kind)
    assert set(kinds) == {"box", "cylinder", "sphere"}


def test_the_arenas_ramp_goes_from_the_floor_to_its_landing() -> None:
    ramp = next(
        model
        for model in load_world(REPO / "worlds" / "arena.world").models
        if model.name == "ramp"
    )
    slope, landing = lump(ramp).collisions
    place = Frame.of(ramp.pose) @ Frame.of(slope.shape.pose)
    _, length, thickness = slope.shape.size
    ends = [
        place.position + place.rotation @ (0, side * length / 2, thickness / 2) for side in (1, -1)
    ]
    np.testing.assert_allclose(ends, [(3.75, 1.5, 0), (3.75, -1.5, 0.3)], atol=1e-6)
    assert landing.xyz[2] + landing.shape.size[2] / 2 == pytest.approx(0.3)
    assert landing.xyz[1] + landing.shape.size[1] / 2 == pytest.approx(-1.5)
