"""What a person wrote becomes a message, or one error line with the reason."""

import builtins
import io
import sys
from argparse import Namespace
from collections.abc import Callable
from threading import Event
from types import SimpleNamespace
from typing import Any

import pytest
import yaml

from holozen.cli import publish
from holozen.cli.form import Form
from holozen.cli.values import LARGEST
from holozen.messages import WIRES, CommandStatus, JointState, Message, Twist, TwistStamped, codec
from holozen.testing import Wire
from holozen.wire import TOPICS, topic

KINDS = (Twist, TwistStamped)


def form(key: str, wire: str = "json") -> Form:
    row = topic(key)
    assert row
    return Form(Namespace(key=key, package=[], wire=wire, force=False), row.type_names)


def read_message(text: str) -> Message:
    """The command that a sim reads of what is sent."""
    commands = form("cmd_vel")
    return codec.decode(commands.payload(text), commands.encoding, KINDS)


def refusal(text: str) -> str:
    with pytest.raises(ValueError) as error:
        form("cmd_vel").payload(text)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_json_and_yaml_are_read() -> None:
    for text in [
        '{"linear": {"x": 0.3}}',
        "{linear: {x: 0.3}}",
        "linear:\n  x: 0.3\n",
        "linear: {x: 3e-1}",
    ]:
        assert read_message(text) == Twist.planar(0.3)


def test_slips_of_yaml_are_named() -> None:
    for text, hint in [
        ("{linear: {x:0.1}}", "has no field 'linear.x:0.1'; write a space after ':'"),
        ("linear:{x: 1}", "has no field 'linear:{x'; write a space after ':'"),
        ("{linear: {x: 0,2}}", "has no field 'linear.2'; write a decimal point, not a comma"),
        (
            "{linear: {x: 0,05, y: 0}}",
            "has no field 'linear.05'; write a decimal point, not a comma",
        ),
        ("{linear: {2: 1}}", "has no field 'linear.2'; it has x, y, z"),
    ]:
        assert refusal(text).endswith(hint)


def test_the_first_kind_that_fits_is_taken() -> None:
    assert read_message("twist: {linear: {x: 1}}") == TwistStamped(twist=Twist.planar(1))
    assert read_message("{}") == Twist()


@pytest.mark.parametrize("wire", WIRES)
def test_each_wire_has_what_a_reader_of_the_type_takes(wire: str) -> None:
    status = "{sources: [{source: teleop@1, rate: 20}], refused: {late: 2}}"
    rows: list[tuple[str, str, type[Message]]] = [
        ("cmd_vel", "twist: {angular: {z: 1}}", TwistStamped),
        ("joint_command", "{name: [j], velocity: [1]}", JointState),
        ("cmd_vel_status", status, CommandStatus),
    ]
    for key, text, kind in rows:
        made = form(key, wire)
        payload = made.payload(text)
        assert made.encoding == codec.encoding(wire, kind)
        assert codec.decode(payload, made.encoding, (kind,)) == codec.convert(
            yaml.safe_load(text), (kind,)
        )


def test_each_topic_of_the_wire_is_published_by_its_key_alone(
    wire: Wire, run: Callable[..., object]
) -> None:
    bus = wire.bus("reader")
    for row in TOPICS:
        reader = bus.subscribe(row.key, *row.types)
        run("topic", "pub", row.key, "{}", "--once")
        received = reader.recv()
        assert (received.message, received.error) == (row.types[0](), ""), row.key
        reader.close()


def test_a_dash_reads_standard_input(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO('{"linear": {"x": 0.3}}'))
    assert read_message("-") == Twist.planar(0.3)


def test_what_is_no_message_is_refused_with_the_reason() -> None:
    for text, reason in [
        (
            '{"linaer": {}}',
            "geometry_msgs/msg/Twist has no field 'linaer' (did you mean 'linear'?)",
        ),
        (
            "{twist: {linaer: {}}}",
            "geometry_msgs/msg/Twist has no field 'twist.linaer' (did you mean 'linear'?)",
        ),
        ("[]", "geometry_msgs/msg/Twist: [] is not a mapping of fields"),
        ("", "geometry_msgs/msg/Twist: None is not a mapping of fields"),
        (
            "-1",
            "geometry_msgs/msg/Twist: -1 is not a mapping of fields; write {linear: ..., angular: "
            "...}",
        ),
        ('{"linear":{"x":NaN}}', "linear.x is not a finite number"),
        ('{"linear":{"x":1e999}}', "linear.x is not a finite number"),
        ("{angular: {z: -.inf}}", "angular.z is not a finite number"),
        ("{twist: {angular: {z: .nan}}}", "twist.angular.z is not a finite number"),
        ("{linear: {x: fast}}", "linear.x: 'fast' is not a valid float64"),
        ("{linear: {x: 1", "'{linear: {x: 1' is not valid JSON or YAML: expected ',' or '}'"),
        ("a: b: c", " is not valid JSON or YAML: "),
        ("linear:\n\tx: 1", " is not valid JSON or YAML: "),
        ("!!python/object/apply:os.getcwd []", " is not valid JSON or YAML: "),
        ("&a {linear: *a}", "has no field 'linear.linear'"),
        ("{1: 2}", "geometry_msgs/msg/Twist has no field '1'"),
        ("[" * 100_000, "the value is nested too deeply"),
        ('{"now":' * 20_000 + "1" + "}" * 20_000, "the value is nested too deeply"),
        ("{\n" * 3000, "the value is nested too deeply"),
        ('{"linear": {"x": ' + "9" * 5000 + "}}", "4300 digits"),
        ('{"linear": {"x": ' + "9" * 500 + "}}", "is not a valid float64"),
        ('{"linear": {"x": 0.1, "x": 3}}', "'x' is given twice"),
        ("linear: {x: 0.1, x: 3}", "'x' is given twice"),
        ("linear: {x: 1:30}", "is not a valid float64"),
        ("linear: {x: 1_0.5}", "is not a valid float64"),
        ("linear: {x: 010}", "is not a valid float64"),
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
    assert read_message('{"linear": {"x": 1}}') == Twist.planar(1)


def test_after_a_pause_no_burst_makes_up_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    now, pauses = 0.0, list[float]()

    def pause(seconds: float) -> None:
        nonlocal now
        pauses.append(seconds)
        now += seconds + 10.0 * (len(pauses) == 2)  # in the second it is suspended

    monkeypatch.setattr(publish, "time", SimpleNamespace(monotonic=lambda: now))
    args = Namespace(key="cmd_vel", rate=10.0, once=False, times=5, value="{}")
    sent = list(publish.turns(form("cmd_vel"), b"{}", args, Event(), pause))
    assert sent == [b"{}"] * 5
    assert pauses == pytest.approx([0.1, 0.1, 0.0, 0.1, 0.1])
