"""What a person wrote becomes a message, or one error line with the reason."""

import builtins
import io
import sys
from typing import Any

import pytest

from holozen.cli.publish import Ours, read_message
from holozen.cli.values import LARGEST
from holozen.messages import NextGoalRequest, Twist, TwistStamped

KINDS = (Twist, TwistStamped)


def refusal(text: str) -> str:
    with pytest.raises(ValueError) as error:
        Ours(KINDS, "cmd_vel", "json", force=False).payload(text)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_json_and_yaml_are_read() -> None:
    for text in [
        '{"linear": {"x": 0.3}}',
        "{linear: {x: 0.3}}",
        "linear:\n  x: 0.3\n",
        "linear: {x: 3e-1}",
    ]:
        assert read_message(text, KINDS) == Twist.planar(0.3)


def test_the_first_kind_that_fits_is_taken() -> None:
    assert read_message("twist: {linear: {x: 1}}", KINDS) == TwistStamped(twist=Twist.planar(1))
    assert read_message("{}", KINDS) == Twist()
    assert read_message("request_goal: 2", (NextGoalRequest,)) == NextGoalRequest(2)


def test_a_dash_reads_standard_input(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO('{"linear": {"x": 0.3}}'))
    assert read_message("-", KINDS) == Twist.planar(0.3)


def test_what_is_no_message_is_refused_with_the_reason() -> None:
    for text, reason in [
        ('{"linaer": {}}', "not a Twist: Object contains unknown field `linaer`"),
        ("[]", "not a Twist: Expected `object`, got `array`"),
        ("", "not a Twist: Expected `object`, got `null`"),
        ("-1", "not a Twist: Expected `object`, got `int`"),
        ('{"linear":{"x":NaN}}', "linear.x is not a finite number"),
        ('{"linear":{"x":1e999}}', "linear.x is not a finite number"),
        ("{angular: {z: -.inf}}", "angular.z is not a finite number"),
        ("{twist: {angular: {z: .nan}}}", "twist.angular.z is not a finite number"),
        ("{linear: {x: fast}}", "Expected `float`, got `str` - at `$.linear.x`"),
        ("{linear: {x: 1", "neither JSON nor YAML: "),
        ("a: b: c", "neither JSON nor YAML: "),
        ("linear:\n\tx: 1", "neither JSON nor YAML: "),
        ("!!python/object/apply:os.getcwd []", "neither JSON nor YAML: "),
        ("&a {linear: *a}", "unknown field `linear`"),
        ("{1: 2}", "not a Twist: "),
        ("[" * 100_000, "the value is nested too deeply"),
        ('{"now":' * 700 + "1" + "}" * 700, "the value is nested too deeply"),
        ("{" * 3000, "the value is nested too deeply"),
        ('{"linear": {"x": ' + "9" * 5000 + "}}", "4300 digits"),
        ('{"linear": {"x": ' + "9" * 500 + "}}", "out of range"),
        ("x" * (LARGEST + 1), "the value is longer than 1000000 bytes"),
    ]:
        assert reason in refusal(text)


def test_too_much_on_standard_input_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO(" " * LARGEST + "{}"))
    assert refusal("-") == "the value is longer than 1000000 bytes"


def test_yaml_without_its_library_names_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def without_yaml(name: str, *rest: Any) -> Any:
        if name == "yaml":
            raise ModuleNotFoundError(name=name)
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without_yaml)
    assert "pip install pyyaml" in refusal("linear: {x: 1}")
    assert read_message('{"linear": {"x": 1}}', KINDS) == Twist.planar(1)
