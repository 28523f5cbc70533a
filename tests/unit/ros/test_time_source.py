"""Simulated time: from the clock key, while `use_sim_time` is true, whoever spins or not."""

from types import SimpleNamespace
from typing import Any

import pytest

from holozen.graph import Graph
from holozen.messages import Clock as ClockMessage
from holozen.messages import Time as TimeMessage
from holozen.messages import Twist
from holozen.ros import arguments
from holozen.ros.clock import Clock, ROSClock
from holozen.ros.duration import Duration
from holozen.ros.jumps import JumpThreshold
from holozen.ros.logging import RcutilsLogger, get_logger
from holozen.ros.parameter import Parameter
from holozen.ros.parameters import NodeParameters, begin
from holozen.ros.time import Time
from holozen.ros.time_source import TimeSource
from holozen.testing import Wire, wait_for


class Node(NodeParameters):
    """What of a node gives it simulated time."""

    def __init__(self, wire: Wire, *words: str) -> None:
        self._given = arguments.parse(["--ros-args", *words])
        core: Any = SimpleNamespace(fqn="/tom", arguments=self._given, bus=wire.bus("tom", lasting=True))
        self._holozen = core
        begin(self, start_services=False)
        self.clock, self.source = ROSClock(), TimeSource(self)
        self.source.attach_clock(self.clock)

    def resolve_topic_name(self, name: str) -> str:
        return self._given.remap(name, "tom", "/")

    def get_logger(self) -> RcutilsLogger:
        return get_logger("tom")

    def use_sim_time(self, value: bool) -> None:
        self.set_parameters([Parameter("use_sim_time", value=value)])

    def seconds(self) -> float:
        return self.clock.nanoseconds() / 1e9


class Sim:
    """Who tells the time."""

    def __init__(self, wire: Wire, key: str = "clock") -> None:
        self._clock = wire.bus("sim").publisher(key, ClockMessage)

    def tell(self, node: Node, seconds: float, clock: Clock | None = None) -> None:
        def shown() -> Any:
            self._clock.put(ClockMessage(TimeMessage.of(seconds)))
            return (clock or node.clock).nanoseconds() == seconds * 1e9

        wait_for(shown)


def readers(graph: Graph) -> list[str]:
    return [row.key for row in graph.endpoints() if row.kind == "sub"]


def test_a_node_shows_the_systems_time_unless_told(wire: Wire) -> None:
    node, told = Node(wire), Node(wire, "-p", "use_sim_time:=true")
    assert node.seconds() > 1e9
    assert told.seconds() == 0.0, "simulated time begins at zero"
    assert (node.source.ros_time_is_active, told.source.ros_time_is_active) == (False, True)


def test_time_passes_with_the_messages_while_nobody_spins(wire: Wire) -> None:
    node, sim = Node(wire, "-p", "use_sim_time:=true"), Sim(wire)
    for seconds in (1.0, 2.5, 0.5):
        sim.tell(node, seconds)


def test_the_parameter_switches_it_on_and_off(wire: Wire) -> None:
    node, sim = Node(wire), Sim(wire)
    node.use_sim_time(True)
    sim.tell(node, 3.0)
    graph = wire.bus().graph()
    wait_for(lambda: readers(graph) == ["clock"])
    node.use_sim_time(False)
    assert node.seconds() > 1e9
    wait_for(lambda: readers(graph) == [])
    node.use_sim_time(True)
    sim.tell(node, 4.0)
    node.source.close()
    assert node.seconds() > 1e9


def test_the_topic_can_be_another_one(wire: Wire) -> None:
    Sim(wire, "lab/clock").tell(Node(wire, "-p", "use_sim_time:=true", "-r", "/clock:=/lab/clock"), 5.0)


def test_more_clocks_get_the_time_and_lose_it(wire: Wire) -> None:
    node, sim, another = Node(wire, "-p", "use_sim_time:=true"), Sim(wire), ROSClock()
    sim.tell(node, 2.0)
    node.source.attach_clock(another)
    assert another.nanoseconds() == 2_000_000_000
    sim.tell(node, 3.0, another)
    node.source.detach_clock(another)
    sim.tell(node, 4.0)
    assert another.nanoseconds() == 3_000_000_000
    with pytest.raises(ValueError, match="only clocks of ROS_TIME"):
        node.source.attach_clock(Clock())


def test_what_is_no_time_is_told_and_changes_nothing(wire: Wire, capsys: pytest.CaptureFixture[str]) -> None:
    node, sim = Node(wire, "-p", "use_sim_time:=true"), Sim(wire)
    sim.tell(node, 2.0)
    wrong = wire.bus("wrong").publisher("clock", Twist)
    told: list[str] = []

    def is_told() -> bool:
        wrong.put(Twist())
        told.append(capsys.readouterr().err)
        return "[WARN]" in "".join(told)

    wait_for(is_told)
    assert "[tom]: no time on /clock: " in "".join(told)
    assert "".join(told).count("\n") == 1
    assert node.clock.now() == Time(seconds=2, clock_type=node.clock.clock_type)


def test_time_goes_on_when_a_callback_for_jumps_fails(wire: Wire, capsys: pytest.CaptureFixture[str]) -> None:
    node, sim = Node(wire, "-p", "use_sim_time:=true"), Sim(wire)

    def fail(_jump: object) -> None:
        raise RuntimeError("oh")

    threshold = JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1))
    node.clock.create_jump_callback(threshold, post_callback=fail)
    for seconds in (2.0, 1.0, 3.0):
        sim.tell(node, seconds)
    assert capsys.readouterr().err.count("RuntimeError: oh") == 1
