"""Colours by Gazebo's names and by numbers."""

from pathlib import Path

import pytest

from holozen.robot.colors import GAZEBO, nearest_gazebo, read_color
from holozen.robot.parts import Color
from holozen.robot.source import Source
from holozen.robot.tag import Tag

TAG = Tag("color", {}, "f, line 3")


def source() -> Source:
    return Source(Path("robot.urdf"), {})


@pytest.mark.parametrize(
    ("name", "color"),
    [
        ("Gazebo/Black", (0, 0, 0, 1)),
        ("Gazebo/Grey", (0.7, 0.7, 0.7, 1)),
        ("Gazebo/Orange", (1, 0.5088, 0.0468, 1)),
        ("Gazebo/SkyBlue", (0, 0, 1, 1)),
        ("Gazebo/RedTransparent", (1, 0, 0, 0.5)),
        ("Gazebo/TurquoiseGlow", (0, 1, 1, 1)),
        ("Gazebo/WoodPallet", (1, 1, 1, 1)),
        ("Gazebo/Lanes_4", (0.8, 0.8, 0.8, 1)),
    ],
)
def test_gazebos_names_have_its_diffuse_colours(name: str, color: Color) -> None:
    assert GAZEBO[name] == color


def test_every_colour_of_gazebo_lies_between_zero_and_one() -> None:
    assert all(len(color) == 4 and min(color) >= 0 and max(color) <= 1 for color in GAZEBO.values())


@pytest.mark.parametrize(
    ("words", "color"),
    [("0.1 0.2 0.3 0.4", (0.1, 0.2, 0.3, 0.4)), (" 1  0\t0 ", (1, 0, 0, 1)), ("0 0 0 0", (0, 0, 0, 0))],
)
def test_three_or_four_numbers_are_a_colour(words: str, color: Color) -> None:
    notes = source()
    assert read_color(TAG, words, notes) == color
    assert notes.warnings == []


@pytest.mark.parametrize("words", ["", "1 0", "1 0 0 0 0", "255 0 0 1", "-0.1 0 0", "red", "nan 0 0 1", "0,0,0,1"])
def test_anything_else_is_told_and_left_out(words: str) -> None:
    notes = source()
    assert read_color(TAG, words, notes) is None
    assert notes.warnings == [
        f"f, line 3: <color> has the colour {words!r}, which is left out; "
        "write red, green, blue and alpha, each from 0 to 1"
    ]


@pytest.mark.parametrize("word", ["Black", "Gazebo/black", "gazebo/Blck", "BLACK"])
def test_a_misspelt_name_of_gazebo_is_met_with_the_nearest(word: str) -> None:
    assert nearest_gazebo(word, source()) == "; the nearest is 'Gazebo/Black'"
