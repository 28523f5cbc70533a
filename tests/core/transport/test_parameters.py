"""Parameters of a node: listed, read, described, and set as a whole or not at all."""

import math
from typing import Any

import pytest

from holozen.bus import Bus
from holozen.messages import rcl_interfaces as r
from holozen.messages.codec import WIRES
from holozen.testing import Wire
from holozen.transport.errors import ServiceError
from holozen.transport.parameters import ELSE, MAX_NAMES, Choice, Number, Parameter, Parameters


class Node:
    """A node with parameters, and a caller beside it."""

    def __init__(self, wire: Wire, form: str = "cdr") -> None:
        self.values: dict[str, Any] = {"speed": 1.0, "Fred.timeout": -1.0, "shape": "square"}
        self.reports: list[str] = []
        served = wire.bus("node", wire=form)
        Parameters(served, "node", self.declared, self.reports.append).start()
        self.caller: Bus = wire.bus("caller", wire=form)

    def declared(self) -> list[Parameter]:
        def write(name: str) -> Any:
            return lambda value: self.values.__setitem__(name, value)

        return [
            Number(
                "speed", "how fast", "m/s", 0.1, 2.0, lambda: self.values["speed"], write("speed")
            ),
            Number(
                "Fred.timeout",
                "silence",
                "s",
                0.1,
                2,
                lambda: self.values["Fred.timeout"],
                write("Fred.timeout"),
            ),
            Choice(
                "shape", "form", ("square", "hexagon"), lambda: self.values["shape"], write("shape")
            ),
            Choice("file", "where", (), lambda: "goals.txt"),
        ]

    def set(self, *pairs: tuple[str, r.ParameterValue]) -> list[tuple[bool, str]]:
        request = r.SetParametersRequest([r.Parameter(name, value) for name, value in pairs])
        results = self.caller.call("node/set_parameters", request, r.SetParametersReply).results
        return [(result.successful, result.reason) for result in results]

    def refused(self, name: str, value: r.ParameterValue) -> str:
        before = dict(self.values)
        ((successful, reason),) = self.set((name, value))
        assert (successful, self.values, self.reports) == (False, before, [])
        return reason


@pytest.fixture
def node(wire: Wire) -> Node:
    return Node(wire)


def of(value: r.Value) -> r.ParameterValue:
    return r.ParameterValue.of(value)


def test_they_are_listed_below_prefixes(node: Node) -> None:
    for prefixes, depth, names in [
        ([], 0, ["speed", "Fred.timeout", "shape", "file"]),
        ([], 1, ["speed", "shape", "file"]),
        (["Fred"], 0, ["Fred.timeout"]),
        (["Fred"], 1, ["Fred.timeout"]),
        (["Fre", "spee"], 0, []),
        (["shape", "Fred"], 0, ["Fred.timeout", "shape"]),
    ]:
        request = r.ListParametersRequest(prefixes, depth)
        result = node.caller.call("node/list_parameters", request, r.ListParametersReply).result
        assert result.names == names
        assert result.prefixes == (["Fred"] if "Fred.timeout" in names else [])


def test_their_values_come_in_the_order_asked_for(node: Node) -> None:
    request = r.GetParametersRequest(["shape", "speed"])
    values = node.caller.call("node/get_parameters", request, r.GetParametersReply).values
    assert [value.plain() for value in values] == ["square", 1.0]
    assert [value.type for value in values] == [r.STRING, r.DOUBLE]


def test_they_are_described_with_what_they_take(node: Node) -> None:
    request = r.DescribeParametersRequest(["speed", "shape", "file"])
    speed, shape, file = node.caller.call(
        "node/describe_parameters", request, r.DescribeParametersReply
    ).descriptors
    assert (speed.type, speed.description) == (r.DOUBLE, "how fast, in m/s")
    assert speed.floating_point_range == [r.FloatingPointRange(0.1, 2.0)]
    assert (shape.additional_constraints, shape.read_only) == ("one of square, hexagon", False)
    assert file.read_only


@pytest.mark.parametrize("key", ["get_parameters", "describe_parameters"])
def test_an_unknown_name_is_refused_with_the_closest_one(node: Node, key: str) -> None:
    request = {
        "get_parameters": r.GetParametersRequest,
        "describe_parameters": r.DescribeParametersRequest,
    }[key]
    with pytest.raises(
        ServiceError, match=r"^node has no parameter 'sped' \(did you mean 'speed'\?\)$"
    ):
        node.caller.call(f"node/{key}", request(["speed", "sped"]), r.GetParametersReply)
    with pytest.raises(ServiceError, match=r"'zzz'; it has speed, Fred.timeout, shape, file$"):
        node.caller.call(f"node/{key}", request(["zzz"]), r.GetParametersReply)


def test_a_value_is_set_and_reported_with_its_caller(node: Node) -> None:
    assert node.set(("speed", of(0.5))) == [(True, "")]
    assert node.values["speed"] == 0.5
    assert node.reports == [f"node: speed is 0.5 m/s (was 1), set by {node.caller.source}"]


@pytest.mark.parametrize("form", WIRES)
def test_they_speak_every_wire(wire: Wire, form: str) -> None:
    node = Node(wire, form)
    assert node.set(("speed", of(0.5)), ("shape", of("hexagon"))) == [(True, "")] * 2
    request = r.GetParametersRequest(["speed", "shape"])
    reply = node.caller.call("node/get_parameters", request, r.GetParametersReply)
    assert [value.plain() for value in reply.values] == [0.5, "hexagon"]
    asked = r.DescribeParametersRequest(["speed"])
    (row,) = node.caller.call(
        "node/describe_parameters", asked, r.DescribeParametersReply
    ).descriptors
    assert row.floating_point_range == [r.FloatingPointRange(0.1, 2.0)]
    listed = node.caller.call(
        "node/list_parameters", r.ListParametersRequest(), r.ListParametersReply
    )
    assert listed.result.prefixes == ["Fred"]


def test_a_whole_number_will_do_for_any_number(node: Node) -> None:
    assert node.set(("speed", of(2))) == [(True, "")]
    assert (node.values["speed"], type(node.values["speed"])) == (2.0, float)


def test_a_request_is_done_as_a_whole_or_not_at_all(node: Node) -> None:
    assert node.set(("shape", of("hexagon")), ("speed", of(3.0))) == [
        (False, ELSE),
        (False, "speed: 3: use a number from 0.1 to 2 m/s"),
    ]
    assert (node.values["shape"], node.reports) == ("square", [])
    assert node.set(("shape", of("hexagon")), ("speed", of(1.5))) == [(True, ""), (True, "")]
    assert (node.values["shape"], node.values["speed"]) == ("hexagon", 1.5)


def test_what_a_parameter_does_not_take_is_refused(node: Node) -> None:
    for name, value, reason in [
        ("speed", of(0.05), "speed: 0.05: use a number from 0.1 to 2 m/s"),
        ("speed", of(-1.0), "speed: -1: use a number from 0.1 to 2 m/s"),
        ("speed", of("fast"), "speed: 'fast': use a number from 0.1 to 2 m/s"),
        ("speed", of(True), "speed: True: use a number from 0.1 to 2 m/s"),
        ("speed", r.ParameterValue(), "speed: no value: use a number from 0.1 to 2 m/s"),
        (
            "speed",
            r.ParameterValue(200, double_value=1.0),
            "speed: no value: use a number from 0.1 to 2 m/s",
        ),
        (
            "speed",
            r.ParameterValue(8, double_array_value=[1.0]),
            "speed: [1.0]: use a number from 0.1 to 2 m/s",
        ),
        ("shape", of("circle"), "shape: 'circle': use one of square, hexagon"),
        ("shape", of(4), "shape: 4: use one of square, hexagon"),
        ("file", of("other.txt"), "file: it is read-only"),
        ("sped", of(1.0), "node has no parameter 'sped' (did you mean 'speed'?)"),
        ("shape", of("x" * 500), f"shape: '{'x' * 76}...: use one of square, hexagon"),
    ]:
        assert node.refused(name, value) == reason


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_no_finite_number_never_gets_in(node: Node, value: float) -> None:
    """Our own codec refuses it already; a foreign one may not."""
    parameter = next(parameter for parameter in node.declared() if parameter.name == "speed")
    with pytest.raises(ValueError, match="use a number from"):
        parameter.checked(value)


def test_what_it_has_already_may_be_set_although_it_is_out_of_range(node: Node) -> None:
    assert node.set(("Fred.timeout", of(-1.0)), ("file", of("goals.txt"))) == [
        (True, ""),
        (True, ""),
    ]
    assert node.reports == []
    assert (
        node.refused("Fred.timeout", of(-2.0)) == "Fred.timeout: -2: use a number from 0.1 to 2 s"
    )


def test_the_same_name_twice_in_a_request_is_refused(node: Node) -> None:
    assert (
        node.set(("speed", of(1.5)), ("speed", of(0.5)))
        == [(False, "'speed' is set twice in one request")] * 2
    )
    assert node.values["speed"] == 1.0


def test_a_request_with_too_many_names_is_refused(node: Node) -> None:
    with pytest.raises(
        ServiceError, match=f"^{MAX_NAMES + 1} parameters in one request; at most {MAX_NAMES}$"
    ):
        node.set(*[("speed", of(1.0))] * (MAX_NAMES + 1))
