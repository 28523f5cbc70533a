"""`topic info` of a command key shows the sources obeyed, held and stopped; of others the
endpoints.
"""

import json
import threading
from collections.abc import Callable, Iterator

import pytest

from holozen.bus import Bus
from holozen.cli import keys
from holozen.messages import CommandSource, CommandStatus, Odometry, Twist
from holozen.testing import Wire
from holozen.testing.process import PATIENCE

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def sim(wire: Wire) -> Iterator[Bus]:
    bus = wire.bus("sim", lasting=True)
    bus.subscribe("Fred/cmd_vel", Twist)
    yield bus


@pytest.fixture
def teleop(wire: Wire) -> Bus:
    bus = wire.bus("teleop")
    bus.publisher("Fred/cmd_vel", Twist, priority="INTERACTIVE_HIGH")
    return bus


def publish(sim: Bus, status: CommandStatus) -> None:
    sim.publisher("Fred/cmd_vel_status", CommandStatus).put(status)


def test_each_source_is_reported_with_its_priority_rate_and_whether_it_is_obeyed(
    sim: Bus, teleop: Bus, run: Run
) -> None:
    sources = [
        CommandSource(teleop.source, "INTERACTIVE_HIGH", 20.0, obeyed=True),
        CommandSource("anonymous (DATA)", "DATA", 49.96, held=True),
    ]
    publish(
        sim,
        CommandStatus(
            obeyed=teleop.source, priority="INTERACTIVE_HIGH", held=True, sources=sources
        ),
    )
    assert run("topic", "info", "Fred/cmd_vel")[1].splitlines() == [
        "Type: geometry_msgs/msg/Twist",
        "Publisher count: 2",
        f"  teleop ({teleop.id[:6]})  person  20.0 Hz  obeyed",
        "  anonymous (DATA)  script  50.0 Hz  held",
        "Subscription count: 1",
        f"  sim ({sim.id[:6]})",
        f"Obeyed: {teleop.source}; the controller, and scripts that were overruled, wait for "
        "`resume`",
    ]
    output = json.loads(run("topic", "info", "Fred/cmd_vel", "--json")[1])
    assert [(row["source"], row["obeyed"], row["held"]) for row in output["publishers"]] == [
        (teleop.source, True, False),
        ("anonymous (DATA)", False, True),
    ]
    assert output["status"]["obeyed"] == teleop.source


def test_a_software_stop_is_reported_with_its_source(sim: Bus, run: Run) -> None:
    publish(sim, CommandStatus(stopped="stop@a1b2c3"))
    assert (
        run("topic", "info", "Fred/cmd_vel")[1].splitlines()[-1]
        == "Obeyed: none; stopped by stop@a1b2c3"
    )


def test_a_key_without_a_status_has_no_line_of_it(sim: Bus, teleop: Bus, run: Run) -> None:
    lines = run("topic", "info", "Fred/cmd_vel")[1].splitlines()
    assert lines[-1] == f"  sim ({sim.id[:6]})"


def test_a_status_that_is_none_is_passed_over(sim: Bus, run: Run) -> None:
    publisher = sim.publisher("Fred/cmd_vel_status", CommandStatus)
    for wrong in (b"[]", b"{", b'{"sources": [{}]}', b'{"sources": 3}', b"\xff"):
        publisher.put_bytes(wrong)
        code, out, _ = run("topic", "info", "Fred/cmd_vel")
        assert (code, out.splitlines()[0]) == (0, "Type: geometry_msgs/msg/Twist")


def test_verbose_shows_priority_encoding_and_delivery(
    wire: Wire, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(keys, "ENOUGH", 1)
    monkeypatch.setattr(keys, "LISTEN", PATIENCE)
    publisher = wire.bus("sim").publisher("odom", Odometry, priority="DATA_LOW")
    done = threading.Event()

    def talk() -> None:
        while not done.wait(0.01):
            publisher.put(Odometry())

    talker = threading.Thread(target=talk)
    talker.start()
    try:
        out = run("topic", "info", "odom", "-v")[1]
    finally:
        done.set()
        talker.join()
    assert out.splitlines()[2].endswith(")  DATA_LOW  application/json  DROP when full")
