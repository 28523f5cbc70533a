"""World files are read for what is simulated; what is not is named, and what is wrong is one line with the file."""

from pathlib import Path

import pytest

from services.sim.worldfile import GRAVITY, STEP, WorldError, WorldSpec, load

REPO = Path(__file__).parents[3]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "my.world"


def loaded(path: Path, body: str, name: str = ' name="w"') -> WorldSpec:
    path.write_text(f'<sdf version="1.6"><world{name}>{body}</world></sdf>')
    return load(path)


def physics(path: Path, tag: str, text: str) -> WorldSpec:
    return loaded(path, f"<physics><{tag}>{text}</{tag}></physics>")


def refusal(path: Path, content: bytes | None = None) -> str:
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(WorldError) as error:
        load(path)
    told = str(error.value)
    assert told.startswith(f"world {path}: ")
    assert told.isprintable()
    return told


@pytest.mark.parametrize("name", ["gazebo", "empty"])
def test_the_worlds_of_the_tree_have_ground_and_the_engines_step(name: str) -> None:
    spec = load(REPO / "worlds" / f"{name}.world")
    assert spec.step == pytest.approx(1 / 240, rel=1e-12)
    assert spec == WorldSpec(name, step=spec.step, gravity=(0, 0, -9.8), rtf=1, ground=True)


def test_a_world_that_says_nothing_has_the_defaults_and_no_ground(path: Path) -> None:
    assert loaded(path, "", name="") == WorldSpec("default", STEP, GRAVITY, 1.0, False, ())


def test_step_gravity_and_factor_are_read(path: Path) -> None:
    spec = loaded(
        path,
        "<gravity> 0 0\n -1.62 </gravity>"
        "<physics><max_step_size>0.001</max_step_size><real_time_factor>0.5</real_time_factor></physics>",
    )
    assert (spec.name, spec.step, spec.gravity, spec.rtf) == ("w", 0.001, (0, 0, -1.62), 0.5)


def test_gravity_may_stand_in_physics_as_it_did_in_old_files(path: Path) -> None:
    assert loaded(path, "<physics><gravity>0 0 -3</gravity></physics>").gravity == (0, 0, -3)


@pytest.mark.parametrize(
    "body",
    [
        "<include><uri>model://ground_plane</uri></include>",
        "<include><uri> model://asphalt_plane </uri></include>",
        '<model name="floor"><link><collision><geometry><plane/></geometry></collision></link></model>',
    ],
)
def test_a_plane_is_ground(path: Path, body: str) -> None:
    spec = loaded(path, body)
    assert spec.ground
    assert spec.warnings == ()


def test_a_sun_needs_no_warning_and_is_no_ground(path: Path) -> None:
    spec = loaded(path, "<include><uri>model://sun</uri></include>")
    assert (spec.ground, spec.warnings) == (False, ())


def test_other_models_are_named_and_left_out(path: Path) -> None:
    spec = loaded(path, '<include><uri>model://airplane</uri></include><model name="table"/>')
    assert not spec.ground
    assert [warning.split(" is left out")[0] for warning in spec.warnings] == [
        f"world {path}: model 'airplane'",
        f"world {path}: model 'table'",
    ]


@pytest.mark.parametrize(
    ("tag", "text", "told"),
    [
        ("max_step_size", "0", "max_step_size 0 s; use 0.0001 to 0.02"),
        ("max_step_size", "-1", "max_step_size -1 s; use 0.0001 to 0.02"),
        ("max_step_size", "1", "max_step_size 1 s; use 0.0001 to 0.02"),
        ("max_step_size", "nan", "physics/max_step_size 'nan' is not a finite number"),
        ("max_step_size", "", "physics/max_step_size '' is not a finite number"),
        ("real_time_factor", "-1", "real_time_factor -1; use 0 (as fast as it goes) to 1000"),
        ("real_time_factor", "1001", "real_time_factor 1001; use 0 (as fast as it goes) to 1000"),
        ("real_time_factor", "fast\nest", "physics/real_time_factor 'fast\\nest' is not a finite number"),
        ("gravity", "0 0", "gravity '0 0'; write three numbers, such as '0 0 -9.8'"),
        ("gravity", "0 0 down", "gravity 'down' is not a finite number"),
        ("gravity", "0 0 -inf", "gravity '-inf' is not a finite number"),
        ("gravity", "0 0 1e300", "gravity '0 0 1e300'; use at most 100 m/s^2 along each axis"),
    ],
)
def test_a_number_that_no_engine_survives_is_refused(path: Path, tag: str, text: str, told: str) -> None:
    content = f"<sdf><world><physics><{tag}>{text}</{tag}></physics></world></sdf>"
    assert refusal(path, content.encode()) == f"world {path}: {told}"


@pytest.mark.parametrize("value", ["0.0001", "0.02"])
def test_the_ends_of_the_range_of_steps_are_in_it(path: Path, value: str) -> None:
    assert physics(path, "max_step_size", value).step == float(value)


def test_a_factor_of_zero_is_as_fast_as_it_goes(path: Path) -> None:
    assert physics(path, "real_time_factor", "0").rtf == 0


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"<sdf>\n<world>\n</sdf>", "broken XML: mismatched tag: line 3, column 2"),
        (b"", "broken XML: no element found: line 1, column 0"),
        (b"\0", "broken XML: "),
        (b"<sdf>&evil;</sdf>", "broken XML: undefined entity"),
        (b'<?xml version="1.0" encoding="klingon"?><sdf/>', "unknown encoding: klingon; save it as UTF-8"),
        (b'<?xml version="1.0" encoding="gbk"?><sdf/>', "multi-byte encodings are not supported; save it as UTF-8"),
        (b"<robot/>", "it holds no <sdf><world>, its root is <robot>"),
        (b"<sdf/>", "it holds no <sdf><world>, its root is <sdf>"),
        (b"<world><world/></world>", "it holds no <sdf><world>, its root is <world>"),
    ],
    ids=lambda value: str(value)[:30],
)
def test_a_file_that_is_no_world_is_named_with_the_reason(path: Path, content: bytes, told: str) -> None:
    assert refusal(path, content).startswith(f"world {path}: {told}")


def test_a_file_that_is_not_there_and_a_folder_are_named(path: Path) -> None:
    assert refusal(path) == f"world {path}: No such file or directory"
    path.mkdir()
    assert refusal(path) == f"world {path}: Is a directory"


def test_an_entity_that_names_a_file_is_not_read(path: Path) -> None:
    secret = path.with_name("secret")
    secret.write_text("0 0 -1")
    content = f'<!DOCTYPE a [<!ENTITY x SYSTEM "{secret}">]><sdf><world><gravity>&x;</gravity></world></sdf>'
    assert "broken XML: undefined entity" in refusal(path, content.encode())
