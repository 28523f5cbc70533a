"""Colours of URDF and of Gazebo."""

from pathlib import Path

import pytest

from holozen.robot.files.elements import Source, Tag
from holozen.robot.files.loading import parse
from holozen.robot.files.shapes import GAZEBO, nearest_gazebo, read_color
from holozen.robot.model import Color, RobotModel

TAG = Tag("color", {}, "f, line 3")


def source() -> Source:
    return Source(Path("robot.urdf"), {})


def test_gazebos_names_have_its_diffuse_colours() -> None:
    for name, color in [
        ("Gazebo/Black", (0, 0, 0, 1)),
        ("Gazebo/Grey", (0.7, 0.7, 0.7, 1)),
        ("Gazebo/Orange", (1, 0.5088, 0.0468, 1)),
        ("Gazebo/SkyBlue", (0, 0, 1, 1)),
        ("Gazebo/RedTransparent", (1, 0, 0, 0.5)),
        ("Gazebo/TurquoiseGlow", (0, 1, 1, 1)),
        ("Gazebo/WoodPallet", (1, 1, 1, 1)),
        ("Gazebo/Lanes_4", (0.8, 0.8, 0.8, 1)),
    ]:
        assert GAZEBO[name] == color


def test_every_colour_of_gazebo_lies_between_zero_and_one() -> None:
    assert all(len(color) == 4 and min(color) >= 0 and max(color) <= 1 for color in GAZEBO.values())


@pytest.mark.parametrize(
    ("words", "color"),
    [
        ("0.1 0.2 0.3 0.4", (0.1, 0.2, 0.3, 0.4)),
        (" 1  0\t0 ", (1, 0, 0, 1)),
        ("0 0 0 0", (0, 0, 0, 0)),
    ],
)
def test_three_or_four_numbers_are_a_colour(words: str, color: Color) -> None:
    notes = source()
    assert read_color(TAG, words, notes) == color
    assert notes.warnings == []


def test_anything_else_is_reported_and_left_out() -> None:
    for words in ["", "1 0", "1 0 0 0 0", "255 0 0 1", "-0.1 0 0", "red", "nan 0 0 1", "0,0,0,1"]:
        notes = source()
        assert read_color(TAG, words, notes) is None
        assert notes.warnings == [
            f"f, line 3: <color> has the colour {words!r}, which is left out; "
            "write red, green, blue and alpha, each from 0 to 1"
        ]


def test_a_misspelt_name_of_gazebo_is_met_with_the_nearest() -> None:
    for word in ["Black", "Gazebo/black", "gazebo/Blck", "BLACK"]:
        assert nearest_gazebo(word, source()) == " (did you mean 'Gazebo/Black'?)"


ORIGIN = Path("somewhere/robot.urdf")
RED = '<color rgba="1 0 0 1"/>'
SHAPE = '<geometry><box size="1 1 1"/></geometry>'


def robot(*visuals: str, around: str = "") -> RobotModel:
    shapes = "".join(f"<visual>{SHAPE}{visual}</visual>" for visual in visuals)
    return parse(f'<robot name="r">\n<link name="a">{shapes}</link>\n{around}</robot>', ORIGIN)


def colors(model: RobotModel) -> list[Color | None]:
    return [shape.color for shape in model.links["a"].visuals]


def message(model: RobotModel) -> list[str]:
    return [warning.removeprefix(f"{ORIGIN}, line ") for warning in model.warnings]


def test_a_material_gives_its_colour_by_itself_or_by_its_name() -> None:
    for visual, around in [
        (f'<material name="x">{RED}</material>', ""),
        (f"<material>{RED}</material>", ""),
        (f'<material name="">{RED}</material>', ""),
        ('<material name="x"/>', f'<material name="x">{RED}</material>'),
        ('<material name="Gazebo/Red"/>', ""),
        (
            f'<material name="x">{RED}</material>',
            '<material name="x"><color rgba="0 1 0 1"/></material>',
        ),
    ]:
        model = robot(visual, around=around)
        assert (colors(model), model.warnings) == ([(1, 0, 0, 1)], ())


def test_a_material_defined_in_one_visual_is_known_to_the_others_before_and_after() -> None:
    model = robot(
        '<material name="x"/>', f'<material name="x">{RED}</material>', '<material name="x"/>', ""
    )
    assert (colors(model), model.warnings) == ([(1, 0, 0, 1)] * 3 + [None], ())


def test_an_undefined_material_causes_a_warning_with_the_nearest_one() -> None:
    model = robot('<material name="blak"/>', around=f'<material name="black">{RED}</material>')
    assert colors(model) == [None]
    assert message(model) == [
        "2: <material name='blak'> has no colour, neither here nor in <robot> (did you mean "
        "'black'?)"
    ]


def test_a_colour_that_is_none_is_reported_once() -> None:
    model = robot('<material name="x"><color rgba="255 0 0 1"/></material>')
    assert colors(model) == [None]
    (warning,) = message(model)
    assert warning.startswith(
        "2: <color> of <material name='x'> has the colour '255 0 0 1', which is left out"
    )


def test_a_material_twice_is_reported_and_the_first_counts() -> None:
    twice = (
        f'<material name="x">{RED}</material>\n<material name="x"><color rgba="0 1 0 '
        '1"/></material>'
    )
    model = robot('<material name="x"/>', around=twice)
    assert colors(model) == [(1, 0, 0, 1)]
    assert message(model) == ["4: <material name='x'> is defined twice; the first is used"]


def test_a_picture_without_colour_is_reported() -> None:
    model = robot('<material name="x"><texture filename="a.png"/></material>')
    (warning,) = message(model)
    assert (
        "2: <texture> of <material name='x'> is a texture that is not drawn: no such file "
        "'a.png'; looked for" in warning
    )
    assert robot(f'<material name="x"><texture filename="a.png"/>{RED}</material>').warnings == ()


def test_the_colour_of_gazebo_wins_over_that_of_urdf() -> None:
    for inside in [
        "<material>Gazebo/Green</material>",
        "<material> Gazebo/Green\n</material>",
        '<material value="Gazebo/Green"/>',
        "<visual><material><diffuse>0 1 0 1</diffuse><ambient>1 1 1 "
        "1</ambient></material></visual>",
        "<visual><material><ambient>0 1 0</ambient></material></visual>",
        "<visual><material><script><name>Gazebo/Green</name></script></material></visual>",
        "<material><script>Gazebo/Green</script></material>",
    ]:
        urdf = f'<material name="x">{RED}</material>'
        model = robot(urdf, urdf, around=f'<gazebo reference="a">{inside}</gazebo>')
        assert (colors(model), model.warnings) == ([(0, 1, 0, 1)] * 2, ())


def test_a_colour_that_gazebo_does_not_know_is_reported_and_urdfs_stays() -> None:
    gazebo = '<gazebo reference="a"><material>Gazebo/Gren</material></gazebo>'
    model = robot(f'<material name="x">{RED}</material>', around=gazebo)
    assert colors(model) == [(1, 0, 0, 1)]
    assert message(model) == [
        "3: <material> of <gazebo reference='a'> names the colour 'Gazebo/Gren', which Gazebo "
        "does not have "
        "(did you mean 'Gazebo/Green'?)"
    ]


def test_an_empty_material_of_gazebo_has_no_effect() -> None:
    model = robot(
        f'<material name="x">{RED}</material>', around='<gazebo reference="a"><material/></gazebo>'
    )
    assert (colors(model), model.warnings) == ([(1, 0, 0, 1)], ())
