"""Which word was meant."""

import pytest

from holozen.check.vocabulary import PLUGIN, URDF
from holozen.check.words import closest, distance, nearest


@pytest.mark.parametrize(
    ("one", "other", "far"), [("", "", 0), ("limit", "dimit", 1), ("length", "lenght", 1), ("a", "abcd", 3),
     ("ab", "cd", 2)]
)  # fmt: skip
def test_letters_are_counted(one: str, other: str, far: int) -> None:
    assert distance(one, other) == distance(other, one) == far


@pytest.mark.parametrize(
    ("word", "element", "meant"),
    [("ivz", "inertia", True), ("raduis", "cylinder", "radius"), ("height", "cylinder", "length"),
     ("foo", "origin", None)],
)  # fmt: skip
def test_a_known_word_is_found(word: str, element: str, meant: object) -> None:
    found = nearest(word, sorted(URDF[element].attributes))
    assert found == meant if meant is not True else found in ("ixz", "iyz", "izz")


def test_of_two_spellings_the_one_in_the_same_style_is_meant() -> None:
    assert nearest("comandTopic", PLUGIN, 6) == "commandTopic"
    assert nearest("comand_topic", PLUGIN, 6) == "command_topic"


def test_short_and_far_words_are_not_guessed_at() -> None:
    assert nearest("kp", ["kd"], 4) is None
    assert nearest("x" * 50, ["x" * 49]) is None


def test_a_hint_names_what_is_there() -> None:
    assert closest("whel", ["wheel", "arm"]) == " (did you mean 'wheel'?)"
    assert closest("arm", ["left_arm_link"]) == " (did you mean 'left_arm_link'?)"
    assert closest("zzz", ["wheel"]) == ""
