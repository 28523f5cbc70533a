"""`holozen topic` beside a sim that runs: list, info, echo, hz, pub, and their errors."""

import json
import os
import re

import pytest
import zenoh

from holozen.cli.publish import STOPS
from holozen.messages import TriggerReply, TriggerRequest
from holozen.testing import Process, Wire, wait_for
from holozen.testing.wire import command

from .conftest import LATE, Verb, comes_to
from .processes import assert_one_line
from .robots import Robot, moves, planar

# What is reported where a busy machine lets nothing come for a second.
WAITS = "waiting for odom; no messages yet"
SLOW = "no new messages"
TOPICS = {
    "clock": "rosgraph_msgs/msg/Clock",
    "cmd_vel": "geometry_msgs/msg/Twist",
    "cmd_vel_status": "holozen/msg/CommandStatus",
    "joint_command": "sensor_msgs/msg/JointState",
    "joint_states": "sensor_msgs/msg/JointState",
    "link_states": "gazebo_msgs/msg/LinkStates",
    "model_states": "gazebo_msgs/msg/ModelStates",
    "odom": "nav_msgs/msg/Odometry",
    "simulation_status": "holozen/msg/SimulationStatus",
    "tf": "tf2_msgs/msg/TFMessage",
}


def test_list_names_every_topic_once(verb: Verb, town: Wire, robot: Robot) -> None:
    comes_to(sorted(TOPICS), lambda: verb(town, "topic", "list").stdout.split())
    comes_to(
        [f"{key} [{kind}]" for key, kind in sorted(TOPICS.items())],
        lambda: verb(town, "topic", "list", "-t").stdout.splitlines(),
    )
    hidden = "simulate_steps/_action/feedback"
    every = ("topic", "list", "--include-hidden-topics")
    wait_for(lambda: hidden in verb(town, *every).stdout.split())


def test_info_shows_the_type_and_the_endpoints(verb: Verb, town: Wire, robot: Robot) -> None:
    def shown() -> list[str]:
        """Without sessions, who is obeyed, and the order of the subscribers."""
        lines = verb(town, "topic", "info", "cmd_vel").stdout.splitlines()
        words = [line.partition("(")[0].strip() for line in lines if not line.startswith("Obeyed")]
        return [*words[:4], *sorted(words[4:])]

    expected = ["Type: geometry_msgs/msg/Twist", "Publisher count: 1", "test"]
    comes_to([*expected, "Subscription count: 2", "sim", "test"], shown)
    wait_for(lambda: "\nObeyed: " in verb(town, "topic", "info", "cmd_vel").stdout)


def test_echo_prints_as_ros_does(verb: Verb, town: Wire, robot: Robot) -> None:
    done = verb(town, "topic", "echo", "/odom", "--once")
    lines = done.stdout.splitlines()
    assert lines[:3] == ["header:", "  stamp:", lines[2]]
    assert lines[2].startswith("    sec: ")
    assert "child_frame_id: footprint_link" in lines
    assert lines[-1] == "---"
    assert lines.count("---") == 1


def test_echo_as_json_is_one_object_a_line(town: Wire, robot: Robot) -> None:
    def echoed() -> Process | None:
        """None where a busy machine made it wait for the first."""
        echo = town.start("topic", "echo", "odom", "--json")
        wait_for(lambda: echo.out.count("\n") >= 3)
        assert echo.interrupt() == 130
        return None if WAITS in echo.err else echo

    echo = wait_for(echoed)
    assert echo is not None
    odoms = [json.loads(line) for line in echo.out.splitlines()[:3]]
    assert {odom["child_frame_id"] for odom in odoms} == {"footprint_link"}
    assert echo.err == ""


def test_echo_follows_a_key_expression(town: Wire, robot: Robot) -> None:
    echo = town.start("topic", "echo", "**", "--json")
    wait_for(
        lambda: all(
            part in echo.out for part in ('"clock"', '"transforms"', '"child_frame_id"', '"effort"')
        )
    )
    echo.terminate()


def test_echo_waits_and_reports_it(town: Wire, robot: Robot) -> None:
    echo = town.start("topic", "echo", "cmd_vel")
    echo.wait_for_line("waiting for cmd_vel; no messages yet")

    def shown() -> bool:
        robot.put(0.1)
        return "x: 0.1" in echo.out

    wait_for(shown)


def test_echo_shows_what_foreign_nodes_put(town: Wire, robot: Robot) -> None:
    puts = (
        (b"\xff\xfe\x00\x01", "zenoh/bytes", "4 bytes of zenoh/bytes: ff fe 00 01"),
        (
            b'{"a":[{"b":1},{"c":[1,2]}],"d":{}}',
            "application/json",
            "a:\n  - b: 1\n  - c: [1, 2]\nd: {}",
        ),
        (b"\x1b[2Jcleared", "text/plain", '"\\u001b[2Jcleared"'),
    )
    echo = town.start("topic", "echo", "foreign")
    publisher = robot.bus.session.declare_publisher(
        "foreign", congestion_control=zenoh.CongestionControl.BLOCK
    )
    wait_for(lambda: publisher.matching_status.matching)
    for payload, encoding, _ in puts:
        publisher.put(payload, encoding=encoding)
    shown = "".join(f"{text}\n---\n" for _, _, text in puts)
    wait_for(lambda: echo.out == shown, what=lambda: f"{shown!r}; {echo.out!r}")


def test_echo_shows_that_a_key_was_deleted(wire: Wire) -> None:
    session = wire.bus("foreign").session
    shown = {
        "foreign --once": "(deleted)\n---\n",
        "* --once --json": '{"key": "foreign", "value": {"deleted": true}}\n',
        "foreign --field x --timeout 1": "",
    }
    echoes = {flags: wire.start("topic", "echo", *flags.split()) for flags in shown}

    def ended() -> bool:
        session.delete("foreign")
        return all(echo.returncode is not None for echo in echoes.values())

    wait_for(ended)
    assert {flags: echo.out for flags, echo in echoes.items()} == shown


def test_a_reader_that_has_seen_enough_ends_it_quietly(town: Wire, robot: Robot) -> None:
    reading, writing = os.pipe()
    with open(reading, "rb") as reader:
        with open(writing, "wb") as output:
            process = town.start("topic", "echo", "odom", stdout=output)
        reader.readline()
    assert process.wait() == 0
    assert all(line.startswith(WAITS) for line in process.err.splitlines()), process.err


def test_hz_shows_the_rate(town: Wire, robot: Robot) -> None:
    hz = town.start("topic", "hz", "odom")

    def shown() -> list[float]:
        return [float(rate) for rate in re.findall(r"^average rate: (\S+)", hz.out, re.M)]

    # a busy machine loses time, and catches up
    wait_for(lambda: any(5 < rate < 75 for rate in shown()), what=lambda: f"50 Hz; {shown()}")
    assert hz.interrupt() == 0
    assert all(line.startswith(SLOW) for line in hz.err.splitlines()), hz.err


def test_hz_of_a_silent_key_reports_it(town: Wire, robot: Robot) -> None:
    hz = town.start("topic", "hz", "nothing")
    hz.wait_for_line("no new messages on nothing")


def test_pub_drives_until_ctrl_c_and_stops_the_robot_then(town: Wire, robot: Robot) -> None:
    pub = town.start("topic", "pub", "cmd_vel", '{"linear": {"x": 0.3}}')
    robot.odom.next(lambda odom: moves(odom, 0.3, 0, 0))
    robot.pass_time(0.7)
    robot.odom.next(lambda odom: moves(odom, 0.3, 0, 0))
    robot.knows("topic_pub")
    assert pub.interrupt() == 0
    robot.stands()
    robot.wait_for_stop_command()


@pytest.mark.parametrize(
    ("words", "driven"),
    [
        (["linear:\n  y: 0.2\nangular:\n  z: -0.5"], (0, 0.2, -0.5)),
        (['{"twist": {"linear": {"x": 0.2}}}', "--wire", "cdr"], (0.2, 0, 0)),
    ],
)
def test_pub_takes_json_and_yaml_twist_and_twist_stamped(
    town: Wire, robot: Robot, words: list[str], driven: tuple[float, ...]
) -> None:
    with Process(command("topic", "pub", "cmd_vel", *words, *town.flags)):
        robot.odom.next(lambda odom: moves(odom, *driven))


def held_up(robot: Robot) -> int:
    """The commands so far that a busy machine has held up, each of which is sent again."""
    refused = robot.status().refused
    return refused.get("late", 0) + refused.get("old", 0)


@pytest.mark.parametrize(
    ("words", "count"), [(["-1"], 1), (["--times", "5", "--rate", "100"], 5 + STOPS)]
)
def test_pub_sends_as_often_as_requested_and_stops_after_more_than_one(
    verb: Verb, town: Wire, robot: Robot, words: list[str], count: int
) -> None:
    commands, late = robot.commands.from_now(), held_up(robot)
    done = verb(town, "topic", "pub", "cmd_vel", '{"linear": {"x": 0.3}}', *words)
    assert done.returncode == 0 or LATE.search(done.stderr), done.stderr
    wait_for(lambda: len(commands.messages()) >= count, what="that many commands")
    robot.stands()
    sent = [planar(command)[0] for command in commands.messages()]
    if count == 1:  # and again for each that a busy machine held up
        assert 1 <= len(sent) <= 1 + held_up(robot) - late and set(sent) == {0.3}
    else:
        assert sent == [0.3] * 5 + [0.0] * STOPS


def test_pub_refuses_what_is_no_command_with_a_reason(verb: Verb, town: Wire, robot: Robot) -> None:
    commands = robot.commands.from_now()
    for value, reason in (
        ('{"linear":{"x":NaN}}', "linear.x is not a finite number"),
        ('{"linear":{"x":1e999}}', "linear.x is not a finite number"),
        ('{"linaer":{}}', "has no field 'linaer' (did you mean 'linear'?)"),
        ("", "None is not a mapping of fields"),
        ("!!python/object/apply:os.system ['true']", " is not valid JSON or YAML: "),
        ("[" * 5000, ""),
    ):
        done = verb(town, "topic", "pub", "cmd_vel", value)
        assert_one_line(done, 1, "holozen topic pub: cmd_vel: refused: ", reason)
    robot.newest()
    assert commands.all() == []


def test_a_wrong_word_is_one_error_line(verb: Verb, town: Wire) -> None:
    for words, code, reason in [
        (
            ["pub", "*/cmd_vel", "{}"],
            1,
            "'*/cmd_vel': write to one key; a wildcard would move every robot",
        ),
        (["pub", "speed", "{}"], 1, "'speed' has no known type; known keys: cmd_vel, odom, "),
        (["pub", "cmd_vel", "{}", "--rate", "0"], 2, "'0': use a number from 0.01 to 10000 Hz"),
        (["echo"], 2, "key"),
        (["shout"], 2, "'shout'"),
        (["list", "--cfg", "nonsense"], 2, "'nonsense': write PATH:VALUE"),
        (["list", "--cfg", "no/such/path:1"], 1, "no/such/path"),
        (["list", "--config", "nowhere.json5"], 1, "nowhere.json5"),
    ]:
        assert_one_line(verb(town, "topic", *words), code, reason)


MAP, KEPT = b'{"info": {"width": 3}}', "nav_msgs/msg/OccupancyGrid"


def test_echo_shows_first_what_a_latched_key_holds(verb: Verb, wire: Wire) -> None:
    """With a service of the same name beside the publisher, as the sim has for
    robot_description.
    """
    writer, server = wire.bus("writer"), wire.bus("server")
    publisher = writer.publisher_raw("map", KEPT, "application/json")
    publisher.put_bytes(MAP)
    server.serve(
        "map", TriggerRequest, TriggerReply, lambda _: TriggerReply(message="no map")
    ).start()
    for flags in ((), ("--qos-durability", "transient_local")):
        done = verb(wire, "topic", "echo", "map", "--once", "--timeout", "10", "--json", *flags)
        assert (done.returncode, json.loads(done.stdout)["info"]["width"]) == (0, 3), done.stderr
    done = verb(
        wire, "topic", "echo", "map", "--once", "--timeout", "0.5", "--qos-durability", "volatile"
    )
    assert done.returncode == 1
    assert "no messages on map" in done.stderr


def test_echo_goes_on_after_what_was_latched(wire: Wire) -> None:
    publisher = wire.bus("writer").publisher_raw("Fred/map", KEPT, "application/json")
    publisher.put_bytes(MAP)
    process = wire.start("topic", "echo", "*/map", "--field", "info.width")
    wait_for(lambda: process.out, what="the first message")
    publisher.put_bytes(MAP.replace(b"3", b"4"))
    wait_for(lambda: "4" in process.out, what="the next message")
    assert [line for line in process.out.splitlines() if line.isdigit()] == ["3", "4"]


def test_echo_of_any_key_asks_for_its_last_message_where_that_is_wanted(
    verb: Verb, wire: Wire
) -> None:
    wire.bus("writer").publisher_raw("note", "std_msgs/msg/String", "application/json").put_bytes(
        b'{"data": "hi"}'
    )
    transient = ("--qos-durability", "transient_local")
    done = verb(wire, "topic", "echo", "note", "--once", "--timeout", "10", "--json", *transient)
    assert json.loads(done.stdout) == {"data": "hi"}, done.stderr
    assert verb(wire, "topic", "echo", "note", "--once", "--timeout", "0.5").returncode == 1
