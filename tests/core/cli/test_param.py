"""`holozen param` reads and sets parameters as `ros2 param` does, in its words, and as JSON."""

import json
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any

import pytest

from holozen import cli
from holozen.testing import Wire
from holozen.transport.parameters import Choice, Number, Parameter, Parameters

Run = Callable[..., tuple[int, str, str]]


class Node:
    """The values behind a node's parameters."""

    def __init__(self) -> None:
        self.values: dict[str, Any] = {"speed": 1.0, "shape": "square"}

    def declared(self) -> list[Parameter]:
        def write(name: str) -> Any:
            return lambda value: self.values.__setitem__(name, value)

        return [
            Number(
                "speed", "how fast", "m/s", 0.1, 2.0, lambda: self.values["speed"], write("speed")
            ),
            Choice(
                "shape", "form", ("square", "hexagon"), lambda: self.values["shape"], write("shape")
            ),
        ]


@pytest.fixture
def node(wire: Wire) -> Node:
    """One that is called sim."""
    node = Node()
    Parameters(wire.bus("sim", lasting=True), "sim", node.declared, lambda _: None).start()
    return node


def test_list_names_them_below_each_node(run: Run, node: Node, wire: Wire) -> None:
    Parameters(wire.bus("pose_service"), "pose_service", node.declared, lambda _: None).start()
    assert run("param", "list") == (
        0,
        "pose_service:\n  shape\n  speed\nsim:\n  shape\n  speed\n",
        "",
    )
    assert run("param", "list", "/sim", "--param-type") == (
        0,
        "  shape (type: string)\n  speed (type: double)\n",
        "",
    )
    assert run("param", "list", "sim", "--param-prefixes", "speed") == (0, "  speed\n", "")
    rows = [json.loads(line) for line in run("param", "list", "sim", "--json")[1].splitlines()]
    assert rows[1] == {"node": "sim", "name": "speed", "type": "double"}


def test_list_without_nodes_reports_it(run: Run, wire: Wire) -> None:
    wire.bus("somebody_without_any")
    assert run("param", "list") == (
        0,
        "",
        "no parameters: no node has any; `holozen up` starts a robot\n",
    )


def test_get_shows_type_and_value(run: Run, node: Node) -> None:
    assert run("param", "get", "/sim", "speed") == (0, "Double value is: 1.0\n", "")
    assert run("param", "get", "sim", "shape") == (0, "String value is: square\n", "")
    assert run("param", "get", "sim", "shape", "--hide-type") == (0, "square\n", "")
    row = {"node": "sim", "name": "speed", "type": "double", "value": 1.0}
    assert json.loads(run("param", "get", "sim", "speed", "--json")[1]) == row


def test_set_sets_one_or_several(run: Run, node: Node) -> None:
    assert run("param", "set", "sim", "speed", "0.5") == (0, "Set parameter successful\n", "")
    assert node.values["speed"] == 0.5
    several = run("param", "set", "sim", "speed", "2", "shape", "hexagon")
    assert several == (0, "Set parameter speed successful\nSet parameter shape successful\n", "")
    assert node.values == {"speed": 2.0, "shape": "hexagon"}


def test_set_reports_in_one_line_the_reason_and_what_is_allowed(run: Run, node: Node) -> None:
    for words, expected in [
        (("speed", "9"), "speed: 9: use a number from 0.1 to 2 m/s"),
        (("speed", "nan"), "speed: 'nan': use a number from 0.1 to 2 m/s"),
        (("speed", "1e999"), "speed: '1e999': use a number from 0.1 to 2 m/s"),
        (("speed", "true"), "speed: True: use a number from 0.1 to 2 m/s"),
        (("speed", ""), "speed: '': use a number from 0.1 to 2 m/s"),
        (("sped", "1"), "sim has no parameter 'sped' (did you mean 'speed'?)"),
    ]:
        assert run("param", "set", "sim", *words) == (
            1,
            "",
            f"holozen param set: setting parameter failed: {expected}\n",
        )
        code, out, err = run("param", "set", "sim", *words, "--json")
        assert (code, err) == (1, "")
        assert (json.loads(out)["successful"], json.loads(out)["reason"]) == (False, expected)
        assert node.values["speed"] == 1.0


def test_a_text_that_is_not_unicode_is_one_error_line(run: Run, node: Node) -> None:
    code, out, err = run("param", "set", "sim", "shape", "\udcff")
    assert (code, out, len(err.splitlines())) == (1, "", 1)


def test_of_several_only_the_wrong_ones_are_reported(run: Run, node: Node) -> None:
    assert run("param", "set", "sim", "shape", "hexagon", "speed", "9") == (
        1,
        "",
        "holozen param set: setting parameter speed failed: speed: 9: use a number from "
        "0.1 to 2 m/s\n"
        "holozen param set: none of the 2 was set\n",
    )
    assert node.values["shape"] == "square"


def test_a_name_without_a_value_is_wrong_usage(run: Run) -> None:
    code, out, err = run("param", "set", "sim", "speed", "1", "shape")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "'shape' has no value" in err


def test_wrong_usage_is_one_line(call: Callable[..., CompletedProcess[str]]) -> None:
    for words in ("gett sim x", "get sim", "list --jsn", ""):
        done = call("param", *words.split())
        assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)


def test_describe_shows_what_is_allowed(run: Run, node: Node) -> None:
    code, out, _ = run("param", "describe", "sim", "speed", "shape")
    assert code == 0
    assert out.splitlines() == [
        "Parameter name: speed",
        "  Type: double",
        "  Description: how fast, in m/s",
        "  Constraints:",
        "    Min value: 0.1",
        "    Max value: 2.0",
        "Parameter name: shape",
        "  Type: string",
        "  Description: form",
        "  Constraints:",
        "    Additional constraints: one of square, hexagon",
    ]
    row = json.loads(run("param", "describe", "sim", "speed", "--json")[1])
    assert (row["min"], row["max"], row["read_only"]) == (0.1, 2.0, False)


def test_what_dump_writes_load_reads(run: Run, node: Node, tmp_path: Path) -> None:
    code, out, _ = run("param", "dump", "sim")
    assert (code, out) == (0, '/sim:\n  ros__parameters:\n    shape: "square"\n    speed: 1.0\n')
    file = tmp_path / "sim.yaml"
    file.write_text(out)
    node.values = {"speed": 0.5, "shape": "hexagon"}
    assert run("param", "load", "sim", str(file)) == (
        0,
        "Set parameter shape successful\nSet parameter speed successful\n",
        "",
    )
    assert node.values == {"speed": 1.0, "shape": "square"}
    rows = [json.loads(line) for line in run("param", "dump", "sim", "--json")[1].splitlines()]
    assert [row["value"] for row in rows] == ["square", 1.0]


def test_load_sets_nothing_of_a_file_with_a_mistake(run: Run, node: Node, tmp_path: Path) -> None:
    file = tmp_path / "sim.yaml"
    file.write_text("/sim:\n  ros__parameters:\n    shape: hexagon\n    sped: 1.0\n")
    code, _, err = run("param", "load", "sim", str(file))
    assert (code, node.values["shape"]) == (1, "square")
    assert "parameter sped failed: sim has no parameter 'sped' (did you mean 'speed'?)" in err


@pytest.mark.parametrize("verb", ["get", "set", "describe"])
def test_an_unknown_node_is_reported_with_the_closest_one(run: Run, node: Node, verb: str) -> None:
    words = ("smi", "speed") + (("1",) if verb == "set" else ())
    assert run("param", verb, *words) == (
        1,
        "",
        f"holozen param {verb}: there is no node 'smi' with parameters (did you mean 'sim'?)\n",
    )


def test_two_nodes_of_the_same_name_are_not_asked(run: Run, node: Node, wire: Wire) -> None:
    other, twin = Node(), wire.bus("sim")
    Parameters(twin, "sim", other.declared, lambda _: None).start()
    code, _, err = run("param", "set", "sim", "speed", "0.5")
    assert (code, node.values["speed"], other.values["speed"]) == (1, 1.0, 1.0)
    assert "2 nodes are called 'sim' (" in err and twin.id[:6] in err
    code, out, err = run("param", "list")
    assert (code, out) == (1, "sim:\n  shape\n  speed\n")
    assert "only one of them is shown" in err


def test_a_node_that_does_not_answer_is_reported(run: Run, wire: Wire) -> None:
    bus = wire.bus("sim")
    Parameters(bus, "sim", lambda: [])  # `answer` is never called
    code, _, err = run("param", "get", "sim", "speed", "--timeout", "0.2")
    assert code == 1
    assert err.startswith(
        "holozen param get: no reply from 'sim/get_parameters' within 0.2 s: "
        f"{bus.source} does not answer: it hangs"
    )


def test_help_shows_examples(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        cli.main(["param", "set", "--help"])
    assert "holozen param set sim max_linear 0.5" in capsys.readouterr().out
