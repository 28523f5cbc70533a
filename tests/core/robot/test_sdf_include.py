"""`<include>` finds models where Gazebo users keep them, and an error names the places searched."""

from pathlib import Path

import pytest

from holozen.robot.errors import RobotError
from holozen.robot.files.elements import Source
from holozen.robot.files.gazebo_models import MODELS
from holozen.robot.files.sdf_models import read_models
from holozen.robot.model import RobotModel
from holozen.robot.rigid import link_frames

MODEL = (
    '<sdf version="1.6"><model name="{}"><static>1</static><pose>0 0 1 0 0 0</pose><link '
    'name="a"/></model></sdf>'
)


@pytest.fixture(autouse=True)
def alone(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for variable in ("GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH", "GAZEBO_MODEL_PATH"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setenv("HOME", str(home / "user"))


def put(folder: Path, name: str = "table", file: str = "model.sdf", text: str = MODEL) -> Path:
    (folder / name).mkdir(parents=True, exist_ok=True)
    (folder / name / file).write_text(text.replace("{}", name))
    return folder / name / file


def read(
    home: Path, include: str, confined: bool = False, **packages: Path
) -> tuple[list[RobotModel], list[str]]:
    """The models of a world that includes something, and the warnings."""
    (home / "worlds").mkdir(exist_ok=True)
    source = Source(home / "worlds" / "w.sdf", packages, confined=confined)
    first = '<model name="first"><static>1</static><link name="a"/></model>'
    return read_models(f"<sdf>{first}\n<include>{include}</include></sdf>", source)[
        1:
    ], source.warnings


@pytest.mark.parametrize("place", ["worlds", "models", "worlds/models", "user/.gazebo/models", "."])
def test_a_model_is_found_around_the_file_and_in_gazebos_folder(home: Path, place: str) -> None:
    put(home / place)
    models, warnings = read(home, "<uri>model://table</uri>")
    assert ([model.name for model in models], warnings) == (["table"], [])


@pytest.mark.parametrize(
    "variable", ["GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH", "GAZEBO_MODEL_PATH"]
)
def test_a_model_is_found_by_gazebos_variables(
    home: Path, monkeypatch: pytest.MonkeyPatch, variable: str
) -> None:
    put(home / "far" / "away")
    monkeypatch.setenv(variable, f"/nowhere:{home / 'far' / 'away'}")
    assert [model.name for model in read(home, "<uri>model://table</uri>")[0]] == ["table"]


def test_a_model_is_found_in_a_given_package_and_in_the_models_of_a_package_beside(
    home: Path,
) -> None:
    put(home / "x")
    assert len(read(home, "<uri>model://table</uri>", table=home / "x" / "table")[0]) == 1
    put(home / "things" / "models", "chair")
    (home / "things" / "package.xml").write_text("<package><name>things</name></package>")
    assert len(read(home, "<uri>model://chair</uri>")[0]) == 1
    assert len(read(home, "<uri>package://things/models/chair</uri>")[0]) == 1


@pytest.mark.parametrize(
    "uri", ["table", "../models/table", "../models/table/model.sdf", "file://../models/table"]
)
def test_a_path_from_the_file_is_a_uri_too(home: Path, uri: str) -> None:
    put(home / "models")
    assert [model.name for model in read(home, f"<uri>{uri}</uri>")[0]] == ["table"]


def test_the_include_names_places_and_holds_the_model(home: Path) -> None:
    put(home / "models", text=MODEL.replace("<static>1</static>", "<static>0</static>"))
    include = (
        "<uri>model://table</uri><name>desk</name><pose>1 2 3 0 0 0</pose><static>true</static>"
    )
    (model,) = read(home, include)[0]
    assert (model.name, model.pose.xyz, model.static) == ("desk", (1, 2, 3), True)


def test_without_a_pose_of_its_own_the_models_counts(home: Path) -> None:
    put(home / "models")
    (model,) = read(home, "<uri>model://table</uri>")[0]
    assert (model.pose.xyz, model.static) == ((0, 0, 1), True)


def test_the_config_names_the_file_and_the_newest_version_wins(home: Path) -> None:
    config = (
        '<model><sdf version="1.10">new.sdf</sdf><sdf '
        'version="1.9">old.sdf</sdf><sdf>../../out.sdf</sdf></model>'
    )
    put(home / "models", file="model.config", text=config)
    put(home / "models", file="old.sdf", text=MODEL.replace("{}", "old"))
    put(home / "models", file="new.sdf", text=MODEL.replace("{}", "new"))
    assert [model.name for model in read(home, "<uri>model://table</uri>")[0]] == ["new"]


def test_a_model_included_in_a_model_hangs_on_its_joints(home: Path) -> None:
    put(home / "models")
    include = "<include><uri>model://table</uri><pose>0 0 2 0 0 0</pose></include>"
    joint = '<joint name="j" type="fixed"><parent>b</parent><child>table::a</child></joint>'
    inertial = "<inertial><mass>1</mass></inertial>"
    text = f'<sdf><model name="m">{include}<link name="b">{inertial}</link>{joint}</model></sdf>'
    (model,) = read_models(text, Source(home / "w.sdf", {}))
    assert link_frames(model)["table::a"].xyz == (0, 0, 2)


def test_meshes_of_an_included_model_are_found_from_its_own_folder(home: Path) -> None:
    mesh = '<visual name="v"><geometry><mesh><uri>{}</uri></mesh></geometry></visual>'
    text = MODEL.replace('<link name="a"/>', '<link name="a">MESHES</link>')
    uris = ("top.stl", "model://table/top.stl")
    put(
        home / "models",
        text=text.replace("MESHES", "".join(mesh.replace("{}", uri) for uri in uris)),
    )
    found = home / "models" / "table" / "top.stl"
    found.write_bytes(b"solid\nendsolid\n")
    (model,) = read(home, "<uri>model://table</uri>")[0]
    assert [shape.path for shape in model.links["a"].visuals] == [found, found]


def test_a_model_that_is_nowhere_is_left_out_and_reported_with_where_it_was_looked_for(
    home: Path,
) -> None:
    models, (warning,) = read(home, "<uri>model://airplane</uri>")
    assert models == []
    assert warning.startswith(
        f"{home / 'worlds' / 'w.sdf'}, line 2: <include> ('model://airplane') is not found"
    )
    assert str(home / "worlds" / "models") in warning
    assert warning.endswith("add its folder to GZ_SIM_RESOURCE_PATH or give --package NAME=DIR")


@pytest.mark.parametrize(
    "uri", ["https://fuel.gazebosim.org/1.0/a/models/b", "model://../etc", "model://a/../../b"]
)
def test_what_is_not_fetched_is_left_out(home: Path, uri: str) -> None:
    models, (warning,) = read(home, f"<uri>{uri}</uri>")
    assert models == [] and "is not fetched and is left out; write model://NAME" in warning


@pytest.mark.parametrize(
    "uri", ["../models/chest", "file://{home}/models/chest", "model://chest", "{home}/models/chest"]
)
def test_a_text_that_came_over_the_wire_reaches_no_file_around(home: Path, uri: str) -> None:
    put(home / "models", "chest")
    uri = uri.replace("{home}", str(home))
    assert len(read(home, f"<uri>{uri}</uri>")[0]) == 1
    assert read(home, f"<uri>{uri}</uri>", confined=True)[0] == []


def test_a_text_that_came_over_the_wire_reaches_given_packages(home: Path) -> None:
    put(home / "x")
    assert len(read(home, "<uri>model://table</uri>", True, table=home / "x" / "table")[0]) == 1


def test_a_text_that_came_over_the_wire_follows_no_link_out_of_a_package(home: Path) -> None:
    secret = put(home / "secret", "chest")
    (home / "x" / "chest").mkdir(parents=True)
    (home / "x" / "chest" / "model.sdf").symlink_to(secret)
    include = "<uri>model://chest</uri>"
    assert len(read(home, include, chest=home / "x" / "chest")[0]) == 1
    assert read(home, include, True, chest=home / "x" / "chest")[0] == []


def test_models_that_include_each_other_are_reported(home: Path) -> None:
    for name, other in (("a", "b"), ("b", "a")):
        put(
            home / "models",
            name,
            text="<sdf><model "
            f"name='{name}'><include><uri>model://{other}</uri></include></model></sdf>",
        )
    with pytest.raises(RobotError) as error:
        read(home, "<uri>model://a</uri>")
    a, b = (home / "models" / name / "model.sdf" for name in "ab")
    assert (
        str(error.value)
        == f"{b}, line 1: <include> of <model name='b'> has circular or too deeply nested "
        f"includes: {a} -> {b} -> {a}"
    )


def test_a_few_files_that_make_millions_of_models_are_refused(home: Path) -> None:
    for level in range(8):
        twice = "".join(
            f"<include><uri>model://m{level + 1}</uri><name>n{i}</name></include>"
            for i in range(10)
        )
        put(
            home / "models",
            f"m{level}",
            text=f"<sdf><model name='m{level}'><link name='a'/>{twice}</model></sdf>",
        )
    put(home / "models", "m8")
    with pytest.raises(
        RobotError, match="brings the number of models and links above 5000; remove some models"
    ):
        read(home, "<uri>model://m0</uri>")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<sdf><model></sdf>", "line 1: broken XML: mismatched tag"),
        ("", "the file is empty"),
        ("<robot name='r'/>", "which contains no <sdf><model>"),
        ("<sdf><light name='l'/></sdf>", "which contains no <sdf><model>"),
    ],
)
def test_a_broken_model_file_is_named(home: Path, text: str, message: str) -> None:
    path = put(home / "models", text=text)
    with pytest.raises(RobotError) as error:
        read(home, "<uri>model://table</uri>")
    assert message in str(error.value) and str(path) in str(error.value)


def test_an_include_without_uri_is_reported(home: Path) -> None:
    with pytest.raises(
        RobotError, match="line 2: <include> has no <uri>; write <uri>model://NAME</uri>"
    ):
        read(home, "")


@pytest.mark.parametrize(
    "uri",
    [
        "model://Cafe Table",
        "https://fuel.gazebosim.org/1.0/OpenRobotics/models/Cafe%20Table/2",
        "cafe_table",
    ],
)
def test_an_everyday_model_that_is_nowhere_has_the_size_of_gazebo_s(home: Path, uri: str) -> None:
    (model,), warnings = read(home, f"<uri>{uri}</uri><pose>1 2 0 0 0 0</pose>")
    assert (model.name, model.static, model.pose.xyz, warnings) == (
        "cafe_table",
        True,
        (1, 2, 0),
        [],
    )
    assert (
        max(shape.pose.xyz[2] + shape.size[2] / 2 for shape in model.links["link"].collisions)
        == 0.775
    )
    put(home / "models", "cafe_table")
    assert read(home, "<uri>model://cafe_table</uri>")[0][0].links.keys() == {"a"}


def test_the_everyday_models_stand_where_they_are_put() -> None:
    """But for cubes of wood, whose origin is their middle, as in Gazebo."""
    for name, (_, _, pieces) in MODELS.items():
        bottom = min(at[2] - size[-1] / 2 for _, size, at in pieces)
        middle = pieces[0][1][2] / 2 if name.startswith("wood_cube") else 0
        assert bottom == pytest.approx(-middle, abs=0.01), name


def test_what_gazebo_forgives_in_a_model_is_forgiven(home: Path) -> None:
    """A raw & in its model.config, a scale of 0, and a place far away."""
    path = put(home / "models", "house", text=MODEL.replace("0 0 1", "4e6 5e6 0"))
    (path.parent / "model.config").write_text(
        "<model><name>Walls & Doors</name><sdf>model.sdf</sdf></model>"
    )
    (model,), warnings = read(home, "<uri>model://house</uri>")
    assert model.pose.xyz == (4e6, 5e6, 0)
    assert warnings[0].startswith(f"{path.parent}/model.config, line 1: ")
    assert "&amp;" in warnings[0]
