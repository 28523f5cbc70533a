"""The parameters of a script's node on the wire: `holozen param` sees them as those of any node,
while it spins.
"""

import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from holozen.messages import rcl_interfaces as r
from holozen.messages.codec import WIRES
from holozen.ros.generated import find
from holozen.ros.rclpy.context import Context
from holozen.ros.rclpy.executors import SingleThreadedExecutor
from holozen.ros.rclpy.node import Node
from holozen.ros.rclpy.parameter import Parameter, set_result
from holozen.testing import Wire
from holozen.transport.errors import ServiceError
from holozen.transport.parameters import ELSE, MAX_NAMES

Descriptor = find("rcl_interfaces/msg/ParameterDescriptor")
Range = find("rcl_interfaces/msg/FloatingPointRange")

Run = Callable[..., tuple[int, str, str]]


class Robot(Node):
    """A node as scripts have them, called /lab/tom."""

    def __init__(self, *words: str, **options: Any) -> None:
        words = ("--ros-args", "-r", "__ns:=/lab", *words)
        super().__init__("tom", cli_args=words, **options)
        limits = [Range(from_value=0.0, to_value=2.0)]
        self.declare_parameter(
            "speed", 0.5, Descriptor(description="how fast", floating_point_range=limits)
        )
        self.declare_parameters(
            "", [("shape", "square"), ("goals", [1.0, 2.0]), ("names", ["a", "b"]), ("laps", 3)]
        )
        self.declare_parameter("later", Parameter.Type.INTEGER)
        self.add_on_set_parameters_callback(self.check)

    def check(self, parameters: list[Parameter]) -> Any:
        shapes = [each.value for each in parameters if each.name == "shape"]
        return set_result(
            "shapes are square and hexagon" if set(shapes) - {"square", "hexagon"} else ""
        )

    def values(self, *names: str) -> list[Any]:
        return [each.value for each in self.get_parameters(names)]


@pytest.fixture
def robot(context: Context) -> Iterator[Robot]:
    """One that spins in a thread."""
    node = Robot(context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    yield node
    executor.shutdown()
    thread.join(10)


def test_they_are_listed_with_their_types(run: Run, robot: Robot) -> None:
    code, out, err = run("param", "list", "--param-type")
    assert (code, err) == (0, "")
    assert out.splitlines() == [
        "lab/tom:",
        "  goals (type: double array)",
        "  laps (type: integer)",
        "  later (type: integer)",
        "  names (type: string array)",
        "  shape (type: string)",
        "  speed (type: double)",
        "  use_sim_time (type: boolean)",
    ]


def test_they_are_read_and_set(run: Run, robot: Robot) -> None:
    assert run("param", "get", "/lab/tom", "speed") == (0, "Double value is: 0.5\n", "")
    assert run("param", "set", "lab/tom", "speed", "1.5") == (0, "Set parameter successful\n", "")
    assert (
        run("param", "set", "lab/tom", "goals", "[3.5, 4.0, 5.5]", "laps", "7", "later", "8")[0]
        == 0
    )
    assert robot.values("speed", "goals", "laps", "later") == [1.5, [3.5, 4.0, 5.5], 7, 8]
    assert run("param", "get", "lab/tom", "goals")[1] == "Double Array value is: [3.5, 4.0, 5.5]\n"


def test_what_the_node_refuses_is_reported(run: Run, robot: Robot) -> None:
    for name, value, reason in [
        ("speed", "3.0", "speed: 3.0: use a number from 0.0 to 2.0"),
        ("speed", "1", "speed takes DOUBLE, and 1 is INTEGER; write 1.0"),
        ("goals", "[1, 2]", "goals takes DOUBLE_ARRAY, and [1, 2] is INTEGER_ARRAY"),
        ("shape", "circle", "shapes are square and hexagon"),
        ("sped", "1.0", "lab/tom has no parameter 'sped' (did you mean 'speed'?)"),
        ("use_sim_time", "maybe", "use_sim_time takes BOOL, and 'maybe' is STRING"),
    ]:
        assert run("param", "set", "lab/tom", name, value) == (
            1,
            "",
            f"holozen param set: setting parameter failed: {reason}\n",
        )
        assert robot.values("speed", "goals", "shape", "use_sim_time") == [
            0.5,
            [1.0, 2.0],
            "square",
            False,
        ]


def test_several_are_set_all_or_none(wire: Wire, robot: Robot) -> None:
    caller = wire.bus("caller")

    def set_(**values: Any) -> list[str]:
        request = r.SetParametersRequest(
            [r.Parameter(name, r.ParameterValue.of(value)) for name, value in values.items()]
        )
        return [
            each.reason
            for each in caller.call("lab/tom/set_parameters", request, r.SetParametersReply).results
        ]

    assert set_(speed=1.0, laps="x") == [ELSE, "laps takes INTEGER, and 'x' is STRING"]
    assert set_(speed=1.0, shape="circle") == ["shapes are square and hexagon", ELSE]
    assert robot.values("speed", "laps", "shape") == [0.5, 3, "square"]
    twice = r.SetParametersRequest([r.Parameter("laps", r.ParameterValue.of(1))] * 2)
    results = caller.call("lab/tom/set_parameters", twice, r.SetParametersReply).results
    assert [each.reason for each in results] == [ELSE, "'laps' is set twice in one request"]
    assert set_(speed=1.0, laps=4) == ["", ""]
    assert robot.values("speed", "laps") == [1.0, 4]


@pytest.mark.parametrize("form", WIRES)
def test_all_services_of_ros_answer_on_every_wire(wire: Wire, robot: Robot, form: str) -> None:
    caller = wire.bus("caller", wire=form)

    def call(name: str, **fields: Any) -> Any:
        kind = find(f"rcl_interfaces/srv/{name}")
        snake = "".join(
            f"_{letter.lower()}" if letter.isupper() else letter for letter in name
        ).lstrip("_")
        return caller.call(f"lab/tom/{snake}", kind.Request(**fields), kind.Response)

    assert call("GetParameterTypes", names=["speed", "names", "later"]).types.tolist() == [3, 9, 0]
    assert call("ListParameters", prefixes=["speed"]).result.names == ["speed"]
    values = call("GetParameters", names=["names", "later"]).values
    assert [Parameter.from_parameter_msg(_named(each)).value for each in values] == [
        ["a", "b"],
        None,
    ]
    assert call("DescribeParameters", names=["speed"]).descriptors[0].description == "how fast"
    two = [
        Parameter("laps", value=5).to_parameter_msg(),
        Parameter("shape", value="circle").to_parameter_msg(),
    ]
    outcome = call("SetParametersAtomically", parameters=two).result
    assert (outcome.successful, outcome.reason) == (False, "shapes are square and hexagon")
    assert call("SetParametersAtomically", parameters=two[:1]).result.successful
    assert robot.values("laps", "shape") == [5, "square"]


def _named(value: Any) -> Any:
    return find("rcl_interfaces/msg/Parameter")(name="x", value=value)


def test_what_is_asked_wrongly_is_refused_and_the_node_spins_on(
    wire: Wire, run: Run, robot: Robot
) -> None:
    assert run("param", "get", "lab/tom", "sped") == (
        1,
        "",
        "holozen param get: lab/tom has no parameter 'sped' (did you mean 'speed'?)\n",
    )
    caller = wire.bus("caller")
    with pytest.raises(ServiceError, match=f"at most {MAX_NAMES}"):
        caller.call(
            "lab/tom/get_parameters",
            r.GetParametersRequest(["speed"] * (MAX_NAMES + 1)),
            r.GetParametersReply,
        )
    wrong = r.SetParametersRequest([r.Parameter("laps", r.ParameterValue(type=77))])
    (refused,) = caller.call("lab/tom/set_parameters", wrong, r.SetParametersReply).results
    assert refused.reason == "77 is not a parameter type; they go from 0 to 9"
    assert run("param", "get", "lab/tom", "laps")[0] == 0


def test_what_dump_writes_load_and_a_params_file_read(
    run: Run, robot: Robot, tmp_path: Path
) -> None:
    file = tmp_path / "tom.yaml"
    robot.set_parameters([Parameter("later", value=1)])
    file.write_text(
        run("param", "dump", "lab/tom")[1].replace("laps: 3", "laps: 9").replace("[1.0, 2.0]", "[]")
    )
    assert run("param", "load", "lab/tom", str(file))[::2] == (0, "")
    assert robot.values("laps", "goals", "names") == [9, [], ["a", "b"]]
    again = Robot("--params-file", str(file), context=robot.context, start_parameter_services=False)
    assert again.values("laps", "goals", "names", "later") == [9, [], ["a", "b"], 1]


def test_a_params_file_with_wildcards_reaches_the_nodes_it_names(
    context: Context, tmp_path: Path
) -> None:
    file = tmp_path / "all.yaml"
    file.write_text(
        "/**:\n  ros__parameters: {speed: 0.1, laps: 1}\n"
        "/lab/*:\n  ros__parameters: {laps: 2}\n"
        "/other/tom:\n  ros__parameters: {laps: 3}\n"
    )
    node = Robot("--params-file", str(file), "-p", "speed:=0.2", context=context)
    assert node.values("speed", "laps") == [0.2, 2]


def test_a_node_without_parameter_services_is_not_there_for_others(
    run: Run, context: Context
) -> None:
    Robot(context=context, start_parameter_services=False)
    assert (
        "there is no node 'lab/tom' with parameters" in run("param", "get", "lab/tom", "speed")[2]
    )


def test_a_node_that_does_not_spin_does_not_answer(run: Run, context: Context) -> None:
    Robot(context=context)
    code, out, err = run("param", "get", "lab/tom", "speed", "--timeout", "0.1")
    assert (code, out) == (1, "")
    assert "lab/tom/get_parameters" in err
    assert err.count("\n") == 1
