"""Robots come and go while the sim runs; the teleop and the controller drive them, and they leave
no trace.
"""

import json
import os
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from holozen import entities
from holozen.bus import Bus
from holozen.messages import Clock
from holozen.messages import simulation_interfaces as si
from holozen.robot.files.xacro import expand_xacro
from holozen.testing import Process, Wire, wait_for
from holozen.transport.errors import ServiceError
from holozen.transport.graph import Endpoint, Graph

from .conftest import SPAWN, Verb
from .robots import Robot, distance, place

REPO = Path(__file__).parents[2]
HB_BOT = str(REPO / "urdf" / "hb_bot.urdf.xacro")


@pytest.fixture(scope="module")
def only_sim(town: Wire) -> Process:
    sim = town.start("sim", "--empty")
    sim.wait_for_line("no robot yet")
    return sim


@pytest.fixture
def sim(town: Wire, only_sim: Process) -> Process:
    """The file's sim, without any robot."""
    bus = town.bus()
    for name in entities.names(bus, notice=20):
        entities.delete(bus, name)
    bus.close()
    return only_sim


@pytest.fixture
def wire(town: Wire) -> Wire:
    """The file's wire."""
    return town


def keys(endpoints: list[Endpoint]) -> set[str]:
    """What the sim stands on."""
    return {endpoint.key for endpoint in endpoints if endpoint.node == "sim"}


def all_keys(bus: Bus, graph: Graph) -> set[str]:
    """Once what it announces last is there."""

    def look() -> set[str]:
        found = keys(graph.settled(bus.connected))
        return found if any("simulate_steps" in key for key in found) else set()

    return wait_for(look, what="all keys of the sim")


def patiently(words: tuple[str, ...]) -> tuple[str, ...]:
    """The words of a verb, which waits longer than usual for a sim to spawn."""
    return (*SPAWN, *words[1:]) if words[0] == "spawn" else words


def done(verb: Verb, wire: Wire, *words: str) -> str:
    """What a verb prints that ends well."""
    ended = verb(wire, *patiently(words))
    assert (ended.returncode, ended.stderr) == (0, "")
    return ended.stdout


def refused(verb: Verb, wire: Wire, *words: str) -> str:
    """The one line of a verb that ends badly."""
    ended = verb(wire, *patiently(words))
    assert (ended.returncode, ended.stdout, ended.stderr.count("\n")) == (1, "", 1), ended
    return ended.stderr


def test_a_robot_is_spawned_under_a_name_driven_listed_and_deleted(
    verb: Verb, wire: Wire, sim: Process
) -> None:
    assert (
        done(verb, wire, "spawn", HB_BOT, "--name", "Fred", "-x", "1", "-Y", "1.5")
        == "Fred listens on Fred/cmd_vel\n"
    )
    fred = Robot(wire.bus(), "Fred")
    start = fred.stands()
    assert place(start) == pytest.approx((1, 0, 1.5), abs=1e-3)
    assert (start.header.frame_id, start.child_frame_id) == ("Fred/odom", "Fred/footprint_link")
    fred.drive(0.5, until=lambda odom: distance(odom, start) > 0.3)
    fred.stop()
    (output,) = [json.loads(line) for line in done(verb, wire, "list", "--json").splitlines()]
    assert output["name"] == "Fred"
    assert output["pose"]["position"]["y"] > 0.29
    assert "Fred" in done(verb, wire, "delete", "Fred")
    assert verb(wire, "list").stdout == ""


def test_a_robot_without_a_height_stands_on_the_ground_and_with_one_falls(
    verb: Verb, wire: Wire, sim: Process
) -> None:
    done(verb, wire, "spawn", HB_BOT, "--name", "low")
    done(verb, wire, "spawn", HB_BOT, "--name", "high", "-x", "5", "-z", "0.5")
    low, high = Robot(wire.bus(), "low"), Robot(wire.bus("other"), "high")
    assert low.odom.messages()[0].pose.pose.position.z == pytest.approx(-0.04, abs=1e-3)
    high.odom.next(lambda odom: abs(odom.pose.pose.position.z + 0.04) < 2e-3)


def test_the_teleop_and_the_controller_work_on_a_robot_that_came_later(
    verb: Verb, wire: Wire, sim: Process, tmp_path: Path
) -> None:
    done(verb, wire, "spawn", HB_BOT, "--name", "Fred")
    fred = Robot(wire.bus(), "Fred")
    terminal = wire.terminal("teleop", "Fred")
    terminal.wait_for_text("listening sim")
    odom = fred.odom.from_now()
    terminal.hold_until(
        "i", lambda: any(each.twist.twist.linear.x > 0.4 for each in odom.messages())
    )
    fred.stands()
    terminal.type("\x03")
    assert terminal.process.wait() == 0
    fred.resume()
    (tmp_path / "goals.txt").write_text("0.3 0 0\n")
    goals = ("--goals", f"{tmp_path}/goals.txt")
    with wire.start("pose-service", *goals), wire.start("controller", "Fred") as controller:
        controller.wait_for_line("lap 1 goal 0: ", within=60)


def test_a_repeated_name_an_unknown_robot_and_a_wrong_file_are_reported_with_the_known_ones(
    verb: Verb, wire: Wire, sim: Process, tmp_path: Path
) -> None:
    done(verb, wire, "spawn", HB_BOT, "--name", "Fred")
    wrong = tmp_path / "wrong.urdf"
    wrong.write_text('<robot name="r"><link name="a"/><link name="b"/></robot>')
    taken = refused(verb, wire, "spawn", HB_BOT, "--name", "Fred")
    assert "there is an entity 'Fred' already; the entities are Fred" in taken
    assert "there is no entity 'Ann'; the entities are Fred" in refused(verb, wire, "delete", "Ann")
    assert f"{wrong}, line 1: <robot name='r'> has 2 root links" in refused(
        verb, wire, "spawn", str(wrong)
    )
    assert "no such" in refused(verb, wire, "spawn", str(tmp_path / "none.urdf")).lower()
    assert verb(wire, "spawn", HB_BOT, "--name", "a/*").returncode == 2
    assert [line.split()[0] for line in done(verb, wire, "list").splitlines()] == ["Fred"]


def test_a_second_robot_at_the_root_is_refused_with_what_helps(
    verb: Verb, wire: Wire, sim: Process
) -> None:
    root = ("--namespace", "/")
    done(verb, wire, "spawn", HB_BOT, *root)
    taken = (
        "cmd_vel is the key of 'hb_bot'; delete that one, or use a namespace; --namespace "
        "NAME (-robot_namespace NAME)"
    )
    for more in ((), ("--replace",)):
        told = refused(verb, wire, "spawn", HB_BOT, "--name", "Other", "-x", "5", *root, *more)
        assert told == f"holozen spawn: {taken} gives one\n"
    assert "--replace takes its place, --name gives another" in refused(
        verb, wire, "spawn", HB_BOT, *root, "-x", "5"
    )
    done(verb, wire, "spawn", HB_BOT, "--name", "Other", "-x", "5", "--namespace", "lab")
    done(verb, wire, "spawn", HB_BOT, "--name", "hb_bot", "--replace", *root)


def test_a_name_that_is_none_is_refused_by_the_sim_too(
    verb: Verb, wire: Wire, sim: Process
) -> None:
    """A robot called `*` would drive them all; a look-alike letter would pass for another
    robot's.
    """
    bus, text = wire.bus(), expand_xacro(Path(HB_BOT))
    for name in ("*", "**", "$*", "a/b", "..", "F\0", "Fred\n", "\u0391nn", "x" * 5000):
        request = si.SpawnEntityRequest(name, resource_string=text)
        with pytest.raises(ServiceError, match="use a letter, then") as refusal:
            bus.call("spawn_entity", request, si.SpawnEntityReply, timeout=20)
        assert str(refusal.value).isprintable() and len(str(refusal.value)) < 1000, name
    assert verb(wire, "list").stdout == ""


def test_a_robot_that_is_replaced_stays_where_it_was_and_stands(
    verb: Verb, wire: Wire, sim: Process
) -> None:
    done(verb, wire, "spawn", HB_BOT, "--name", "Fred", "-x", "2")
    fred = Robot(wire.bus(), "Fred")
    fred.drive(0.5)
    done(verb, wire, "spawn", HB_BOT, "--name", "Fred", "--replace")
    after = fred.stands()
    assert place(after)[0] > 2
    assert distance(after, fred.pass_time(0.5)) < 1e-6


def test_a_robot_is_not_spawned_into_another_nor_is_one_deleted_for_it(
    verb: Verb, wire: Wire, sim: Process
) -> None:
    done(verb, wire, "spawn", HB_BOT, "--name", "Fred")
    told = refused(verb, wire, "spawn", HB_BOT, "--name", "Ann", "-x", "0.6")
    assert (
        "no room for 'Ann' at x 0.6 y 0: it would be inside 'Fred'; the nearest free place is "
        in told
    )
    assert told.endswith("; -x, -y and -z choose the place\n")
    done(verb, wire, "spawn", HB_BOT, "--name", "Ann", "-x", "5")
    assert "inside 'Ann'" in refused(
        verb, wire, "spawn", HB_BOT, "--name", "Fred", "--replace", "-x", "5.5"
    )
    told = refused(verb, wire, "spawn", HB_BOT, "--count", "2", "--grid", "1", "-y", "5")
    assert re.search(
        r"1 of 2 were spawned, without (bot[01]): there is no room for '\1' at .*; .* --grid more "
        r"than 1 m",
        told,
    )
    ann, fred, bot = [line.split()[0] for line in done(verb, wire, "list").splitlines()]
    # one of the two requests came first
    assert (ann, fred) == ("Ann", "Fred") and bot in ("bot0", "bot1")


def test_a_robot_deleted_while_it_drives_leaves_no_key_alive(
    verb: Verb, wire: Wire, sim: Process
) -> None:
    bus = wire.bus()
    graph = bus.graph()
    before = all_keys(bus, graph)
    done(verb, wire, "spawn", HB_BOT, "--name", "Fred")
    fred = Robot(bus, "Fred")
    fred.drive(0.5)
    done(verb, wire, "delete", "Fred")
    odoms = fred.odom.from_now()
    wait_for(lambda: keys(graph.endpoints()) == before)
    clock = bus.latest("clock", Clock)
    wait_for(lambda: clock.count > 20)
    assert odoms.messages() == []


def test_many_robots_in_a_row_leave_no_key_and_little_memory_and_the_sim_keeps_its_step(
    wire: Wire, sim: Process, trials: Callable[[int, int], int]
) -> None:
    count = trials(50, 200)
    bus = wire.bus()
    graph, text = bus.graph(), expand_xacro(Path(HB_BOT))
    before, clock = all_keys(bus, graph), bus.latest("clock", Clock)

    def spawn_and_delete(name: str) -> None:
        bus.call(
            "spawn_entity",
            si.SpawnEntityRequest(name, resource_string=text),
            si.SpawnEntityReply,
            timeout=20,
        )
        bus.call("delete_entity", si.DeleteEntityRequest(name), si.DeleteEntityReply, timeout=20)

    for number in range(5):  # what is made once
        spawn_and_delete(f"first_{number}")
    memory = resident(sim)
    for number in range(count):
        spawn_and_delete(f"robot_{number}")
    assert resident(sim) - memory < 7e6 + 65e3 * count
    wait_for(lambda: keys(graph.endpoints()) == before)
    reported = clock.count
    wait_for(lambda: clock.count > reported + 50)  # it still publishes the time, 50 times a second
    assert bus.call("get_entities", si.GetEntitiesRequest(), si.GetEntitiesReply).entities == []


def resident(process: Process) -> int:
    """The memory of a process, in bytes."""
    pages = int(Path(f"/proc/{process.pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def test_a_topic_that_the_robots_file_names_is_published_to_by_its_readers_type(
    verb: Verb, wire: Wire, sim: Process, tmp_path: Path
) -> None:
    text = expand_xacro(Path(HB_BOT)).replace("<commandTopic>cmd_vel<", "<commandTopic>go<")
    (tmp_path / "r.urdf").write_text(text)
    assert (
        done(verb, wire, "spawn", str(tmp_path / "r.urdf"), "--name", "Fred")
        == "Fred listens on Fred/go\n"
    )
    fred = Robot(wire.bus(), "Fred")
    pub = wire.start("topic", "pub", "Fred/go", '{"linear": {"x": 0.3}}')
    fred.odom.next(lambda odom: odom.twist.twist.linear.x > 0.29)
    pub.terminate()
    fred.stands()


def test_a_fleet_is_spawned_on_a_grid(verb: Verb, wire: Wire, sim: Process) -> None:
    reported = done(verb, wire, "spawn", HB_BOT, "--count", "5", "--grid", "1.5", "-x", "1")
    assert reported == "bot0 .. bot4 listen on bot0/cmd_vel .. bot4/cmd_vel\n"
    lines = [line.split() for line in done(verb, wire, "list").splitlines()]
    assert [(name, x, y) for name, _, x, _, y, *_ in lines] == [
        ("bot0", "1.000", "0.000"),
        ("bot1", "2.500", "0.000"),
        ("bot2", "4.000", "0.000"),
        ("bot3", "1.000", "1.500"),
        ("bot4", "2.500", "1.500"),
    ]
    assert "5 of these exist already, such as bot0; --name gives another name" in refused(
        verb, wire, "spawn", HB_BOT, "--count", "6"
    )
    assert done(
        verb, wire, "spawn", HB_BOT, "--count", "1", "--name", "Ann", "-x", "-5"
    ).startswith("Ann0 .. Ann0 ")
    assert verb(wire, "spawn", HB_BOT, "--count", "2", "--replace").returncode == 2
    Robot(wire.bus(), "bot4").drive(0.3)
