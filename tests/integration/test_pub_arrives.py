"""`holozen topic pub` checks that what it writes arrives, is valid and is obeyed, or reports why
not.
"""

import json
import os
import subprocess
import threading
from pathlib import Path

import pytest

from holozen.cli.publish import STEPS
from holozen.messages import (
    CommandStatus,
    JointState,
    Message,
    PoseStamped,
    TriggerReply,
    TriggerRequest,
    Twist,
    Wrench,
)
from holozen.testing import Process, Wire, wait_for
from holozen.testing.wire import command
from holozen.transport.graph import on_key

from .conftest import LATE, PATIENT, Done, Verb, in_time
from .processes import assert_one_line
from .robots import Robot, moves, record

AHEAD = '{"linear": {"x": 0.2}}'


def still(*joints: str) -> JointState:
    return JointState(name=[*joints], velocity=[0.0] * len(joints))


def test_it_reports_the_number_of_subscribers(verb: Verb, town: Wire, robot: Robot) -> None:
    """The sim, and the test that listens to commands."""

    def reported() -> bool:
        done = verb(town, "topic", "pub", "cmd_vel", AHEAD, "--once")
        return (done.returncode, done.stdout, done.stderr) == (0, "", "2 subscribers of cmd_vel\n")

    # a busy machine may discover one of them late, or make a single command too old
    wait_for(reported)
    twice = ("cmd_vel", "{}", "-t", "2", "-w", "2", "--json")
    assert json.loads(verb(town, "topic", "pub", *twice).stdout) == {
        "key": "cmd_vel",
        "type": "geometry_msgs/msg/Twist",
        "subscribers": 2,
        "published": 2,
    }


def test_a_goal_that_is_only_looked_at_is_reported(verb: Verb, wire: Wire) -> None:
    wire.start("topic", "echo", "Fred/goal_pose")
    mine = wire.bus("mine")
    wait_for(lambda: on_key(mine.endpoints(), "Fred/goal_pose", "sub"), what="the echo")
    why = "no controller reads it, only topic_echo; `holozen controller Fred --laps 0` drives there"

    def looked_at() -> Done | None:
        """None where a busy machine did not show the echo to the verb in time."""
        done = verb(wire, "topic", "pub", "Fred/goal_pose", "{}", "--once")
        return done if why in done.stderr else None

    done = wait_for(looked_at, what=why)
    assert done is not None and (done.returncode, done.stdout) == (1, "")
    assert done.stderr == f"1 subscriber of Fred/goal_pose\nFred/goal_pose: {why}\n"
    goals = mine.subscribe("Fred/goal_pose", PoseStamped)
    done = verb(wire, "topic", "pub", "Fred/goal_pose", "{}", "--once", "-w", "2")
    assert done.returncode == 0 and done.stderr.endswith("2 subscribers of Fred/goal_pose\n")
    assert goals.recv().message == PoseStamped()


def test_it_waits_for_as_many_subscribers_as_requested(town: Wire, robot: Robot) -> None:
    pub = town.start("topic", "pub", "cmd_vel", AHEAD, "--once", "-w", "4")
    pub.wait_for_line("waiting for 4 subscribers to cmd_vel (2 so far)")
    other = town.bus("other").subscribe("cmd_vel", Twist)
    pub.wait_for_line("waiting for 4 subscribers to cmd_vel (3 so far)")
    town.bus("fourth").subscribe("cmd_vel", Twist)
    assert pub.wait() == 0 or LATE.search(pub.err), pub.err
    assert other.recv().message == Twist.planar(0.2)


def test_it_gives_up_waiting_when_asked(verb: Verb, town: Wire) -> None:
    done = verb(
        town,
        "topic",
        "pub",
        "nobody",
        "geometry_msgs/msg/Twist",
        AHEAD,
        "-1",
        "-w",
        "1",
        "--max-wait",
        "0.1",
    )
    assert done.returncode == 1
    assert done.stderr.startswith("holozen topic pub: no subscribers of nobody")


def test_fewer_subscribers_than_requested_are_not_enough(
    verb: Verb, town: Wire, robot: Robot
) -> None:
    done = verb(town, "topic", "pub", "cmd_vel", "{}", "-1", "-w", "9", "--max-wait", "0.2")
    assert done.returncode == 1
    assert "cmd_vel: 9 subscribers did not come in time, so nothing is published" in done.stderr


def test_it_needs_no_subscriber_where_it_does_not_wait(verb: Verb, town: Wire) -> None:
    for flags in (("--no-wait",), ("-w", "0")):
        done = verb(
            town, "topic", "pub", "nobody", "geometry_msgs/msg/Twist", AHEAD, "--once", *flags
        )
        assert (done.returncode, done.stderr) == (0, "")


def test_a_wrong_field_is_refused_with_the_closest_name(verb: Verb, town: Wire) -> None:
    for value, expected in (
        ('{"linaer": {}}', "has no field 'linaer' (did you mean 'linear'?)"),
        ('{"angular": {"zz": 1}}', "has no field 'angular.zz' (did you mean 'z'?)"),
        ('{"linear": {"x": "1"}}', "linear.x: '1' is not a valid float64"),
        ("linear: {x: .inf}", "linear.x is not a finite number; --force sends it all the same"),
    ):
        done = verb(town, "topic", "pub", "cmd_vel", value, "--once")
        assert_one_line(done, 1, "refused: ", expected)


def test_what_no_robot_can_mean_is_refused_and_not_sent(verb: Verb, wire: Wire) -> None:
    bus = wire.bus()
    for key, value, expected in (
        ("cmd_vel", '{"linear": {"x": 1e308}}', "linear.x is 1e+308 m/s; at most 100"),
        ("Fred/cmd_vel", "twist: {angular: {y: -1001}}", "angular.y is -1001 rad/s; at most 1000"),
        (
            "joint_command",
            "{name: [j], velocity: [2e3]}",
            "velocity[0] of joint 'j' is 2000; at most 1000",
        ),
    ):
        heard = bus.subscribe_raw(key)
        often = ("--once",) if key != "cmd_vel" else ("-r", "20")
        done = verb(wire, "topic", "pub", key, value, *often)
        assert_one_line(done, 1, f"{key}: refused: {expected}; --force sends it all the same")
        assert heard.try_recv() is None


def test_a_type_that_the_key_does_not_carry_is_refused(verb: Verb, town: Wire) -> None:
    words = ("topic", "pub", "cmd_vel", "nav_msgs/msg/Odometry", "{}", "--once", "--no-wait")
    expected = (
        "cmd_vel: its type is geometry_msgs/msg/Twist or geometry_msgs/msg/TwistStamped, "
        "not nav_msgs/msg/Odometry"
    )
    assert_one_line(verb(town, *words), 1, expected)
    assert verb(town, *words, "--force").returncode == 0


def test_force_sends_what_the_sim_then_refuses_and_reports_it(town: Wire, robot: Robot) -> None:
    for wire_name in ("json", "cdr"):
        words = ["{linear: {x: .nan}}", "-r", "20", "--force", "--wire", wire_name]
        pub = town.start("topic", "pub", "cmd_vel", *words)
        pub.wait_for_line("not obeyed: ")
        assert pub.interrupt() == 0
        robot.stands()


def test_a_robot_that_stands_between_slow_commands_has_obeyed_them(
    verb: Verb, town: Wire, robot: Robot
) -> None:
    slowly = ("cmd_vel", AHEAD, "-r", "1", "--times", "1")
    done = in_time(lambda: verb(town, "topic", "pub", *slowly))
    assert (done.returncode, "not obeyed" in done.stderr) == (0, False)


def test_to_a_stopped_robot_it_fails_and_says_so(verb: Verb, town: Wire, robot: Robot) -> None:
    robot.bus.call("stop", TriggerRequest(), TriggerReply)
    try:
        ended = [
            verb(town, "topic", "pub", "cmd_vel", *often, AHEAD)
            for often in (["--once"], ["-t", "2"])
        ]
    finally:
        robot.bus.call("release", TriggerRequest(), TriggerReply)
    for done in ended:
        assert done.returncode == 1
        assert (
            f"not obeyed: the robot is stopped by {robot.bus.source}" in done.stderr
            and "; `holozen release` lets it drive again" in done.stderr
        )


def test_of_a_paused_sim_it_says_so_instead_of_to_try_again(
    verb: Verb, town: Wire, robot: Robot
) -> None:
    """What drove before the pause counts until the sim plays, as time stands still."""
    person = town.bus("person", lasting=True)
    commands = person.publisher("cmd_vel", Twist, "INTERACTIVE_HIGH", dead_man=False)

    def driven() -> bool:
        commands.put(Twist.planar(0.2))
        return robot.last_status().obeyed == person.source

    wait_for(driven)
    try:
        assert verb(town, "sim", "pause").returncode == 0
        wait_for(driven)
        person.close()
        often = ("cmd_vel", AHEAD, "-t", "5", "-r", "10")
        done = in_time(lambda: verb(town, "topic", "pub", *often))
    finally:
        assert verb(town, "sim", "play").returncode == 0
    assert (done.returncode, done.stderr.splitlines()[-1].startswith("not obeyed: ")) == (
        1,
        True,
    ), done.stderr
    assert done.stderr.endswith("; the sim is paused; `holozen sim play` continues it\n")
    assert verb(town, "service", "call", "resume").returncode == 0


def test_a_single_command_to_a_paused_sim_says_that_only_steps_move_the_robot(
    verb: Verb, town: Wire, robot: Robot
) -> None:
    assert verb(town, "sim", "pause").returncode == 0
    try:
        done, stops = (
            in_time(lambda value=value: verb(town, "topic", "pub", "cmd_vel", value, "--once"))  # type: ignore[misc]
            for value in (AHEAD, "{}")
        )
    finally:
        assert verb(town, "sim", "play").returncode == 0
    assert (done.returncode, done.stderr.splitlines()[-1]) == (0, f"cmd_vel: {STEPS}")
    assert "paused" not in stops.stderr


def test_a_misspelt_key_is_refused_with_the_closest(verb: Verb, town: Wire, robot: Robot) -> None:
    for key, meant in (("cmd_vl", "cmd_vel"), ("Fred/cmd_vle", "Fred/cmd_vel")):
        expected = (
            f"holozen topic pub: '{key}' has no known type (did you mean '{meant}'?); "
            "known keys: cmd_vel, odom"
        )
        assert_one_line(verb(town, "topic", "pub", key, AHEAD, "--once"), 1, expected)


def test_numbers_are_those_of_json_in_yaml_too(verb: Verb, wire: Wire) -> None:
    heard = wire.bus("other").subscribe("cmd_vel", Twist)  # the only one, for which it waits
    assert verb(wire, "topic", "pub", "cmd_vel", "{linear: {x: 2e-1}}", "--once").returncode == 0
    assert heard.recv().message == Twist.planar(0.2)


def test_it_reports_when_another_one_drives_and_that_it_has_to_let_go_then(
    town: Wire, patient: Robot
) -> None:
    robot = patient
    first = town.start("topic", "pub", "cmd_vel", AHEAD)
    robot.odom.next(lambda odom: moves(odom, 0.2, 0, 0))
    second = town.start("topic", "pub", "cmd_vel", '{"linear": {"y": 0.1}}')
    assert "drives" in second.wait_for_line("not obeyed: topic_pub@")
    assert first.interrupt() == 0
    assert f"nothing for {PATIENT:g} s" in second.wait_for_line("not obeyed: let go first: ")
    robot.odom.next(lambda odom: moves(odom, 0, 0, 0))
    assert second.interrupt() == 0
    third = town.start("topic", "pub", "cmd_vel", '{"linear": {"y": 0.1}}')
    robot.odom.next(lambda odom: moves(odom, 0, 0.1, 0))
    assert third.interrupt() == 0
    robot.stands()


def test_a_forced_mistake_is_named_also_where_another_one_drives(
    verb: Verb, town: Wire, robot: Robot
) -> None:
    driver = town.start("topic", "pub", "cmd_vel", AHEAD)
    robot.odom.next(lambda odom: moves(odom, 0.2, 0, 0))
    mistake = ("cmd_vel", '{"linear": {"x": 1e308}}', "--once", "--force")

    def named() -> bool:
        # the status tells of the last refusal alone, which a busy machine makes one of the driver's
        why = "not obeyed: linear.x is 1e+308 m/s; at most 100"
        return why in verb(town, "topic", "pub", *mistake).stderr

    wait_for(named)
    assert driver.interrupt() == 0
    robot.stands()


def test_it_reports_that_the_sim_drives_slower_than_shown(town: Wire, robot: Robot) -> None:
    pub = town.start("topic", "pub", "cmd_vel", '{"linear": {"x": 99}}')
    assert "clamped" in pub.wait_for_line("over the limits of")
    assert pub.interrupt() == 0
    robot.stands()


def test_lines_of_standard_input_are_published_and_the_robot_stops_at_their_end(
    town: Wire, robot: Robot
) -> None:
    words = command("topic", "pub", "cmd_vel", "--stdin", *town.flags)
    with subprocess.Popen(words, stdin=subprocess.PIPE, text=True) as pub:
        assert pub.stdin

        def type_line(line: str, driven: tuple[float, ...]) -> None:
            def driving() -> bool:
                assert pub.stdin
                print(line, file=pub.stdin, flush=True)
                return moves(robot.newest(), *driven)

            wait_for(driving)

        type_line(AHEAD, (0.2, 0, 0))
        type_line("linear: {y: 0.1}", (0, 0.1, 0))
        pub.stdin.close()
        assert pub.wait() == 0
    robot.stands()


@pytest.mark.parametrize(
    ("key", "kind", "lines", "stops"),
    [
        (
            "joint_command",
            JointState,
            [
                "{name: [a, b], velocity: [1, 2]}",
                "{name: [c], effort: [1]}",
                "{name: [d], position: [1]}",
            ],
            [still("a", "b"), still("c")],
        ),
        ("Ann/gazebo_ros_force", Wrench, ["{force: {x: 1}}"], [Wrench()]),
    ],
    ids=["joints", "force"],
)
def test_at_the_end_it_stops_whatever_it_moved(
    wire: Wire, key: str, kind: type[Message], lines: list[str], stops: list[Message]
) -> None:
    heard = record(wire.bus("robot"), key, kind)
    done = wire.run("topic", "pub", key, "--stdin", given="\n".join(lines))
    assert done.returncode == 0, done.stderr
    wanted = sorted(map(repr, 5 * stops))
    wait_for(
        lambda: sorted(map(repr, heard.messages()[len(lines) :])) == wanted,
        what=f"{wanted} in the end",
    )


def test_ctrl_c_stops_the_joints(wire: Wire) -> None:
    heard = record(wire.bus("robot"), "joint_command", JointState)
    pub = wire.start("topic", "pub", "joint_command", "{name: [a], velocity: [1]}", "-r", "50")
    assert heard.next() == JointState(name=["a"], velocity=[1.0])
    assert pub.interrupt() == 0
    wait_for(lambda: heard.messages()[-1] == still("a"), what="the stop")


def test_a_wrong_line_ends_it_with_its_number(town: Wire, robot: Robot) -> None:
    done = town.run("topic", "pub", "cmd_vel", "--stdin", given=f"{AHEAD}\n\n[]\n{AHEAD}\n")
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("holozen topic pub: cmd_vel: line 3 refused: ")
    robot.stands()


def test_a_line_that_is_no_text_ends_it_too(wire: Wire) -> None:
    words = command("topic", "pub", "cmd_vel", "--stdin", "--no-wait", *wire.flags)
    strict = {**os.environ, "PYTHONIOENCODING": "utf-8:strict"}
    done = subprocess.run(words, input=b"{}\n\xff\n", capture_output=True, timeout=60, env=strict)
    assert (done.returncode, done.stderr.count(b"\n")) == (1, 1)
    assert done.stderr.startswith(b"holozen topic pub: cmd_vel: line 2 refused: ")


def test_any_type_is_published_with_its_fields(verb: Verb, town: Wire) -> None:
    echo = town.start("topic", "echo", "scan", "--once", "--json")
    words = ["scan", "sensor_msgs/msg/LaserScan", "{ranges: [1, 2.5]}", "-r", "50"]
    for wire_name in ("json", "cdr"):
        with town.start("topic", "pub", *words, "--wire", wire_name):
            assert echo.wait() == 0
            assert json.loads(echo.out)["ranges"] == [1.0, 2.5]
        echo = town.start("topic", "echo", "scan", "--once", "--json")
    echo.close()
    expected = (
        "holozen topic pub: scan: no type 'sensor_msgs/msg/LaserScn' (did you mean "
        "'sensor_msgs/msg/LaserScan'?)"
    )
    assert_one_line(
        verb(town, "topic", "pub", "scan", "sensor_msgs/msg/LaserScn", "--once"), 1, expected
    )


def test_lost_samples_are_counted_by_the_publishers_numbers(town: Wire) -> None:
    """A publisher of ours loses five samples after each; Zenoh itself drops none."""
    bus = town.bus("ours")
    publisher, skip = bus.publisher("holes", Twist, block=True), bus.stamps("holes")
    hz = town.start("topic", "hz", "holes", "--json")

    def reported() -> str:
        publisher.put(Twist())
        for _ in range(5):
            skip()  # as if a sample had been sent and lost
        return hz.out

    wait_for(reported)
    report = json.loads(hz.out.splitlines()[0])
    assert report["lost"] == 5 * (report["window"] - 1)


def test_the_timeout_of_hz_is_for_the_first_messages_alone(town: Wire) -> None:
    publisher = town.bus("ours").publisher("ticks", Twist)

    def begun() -> Process | None:
        """None where a busy machine brought none within the timeout."""
        hz = town.start("topic", "hz", "ticks", "--timeout", "0.5")

        def reported() -> bool:
            publisher.put(Twist())
            return bool(hz.out) or hz.returncode is not None

        wait_for(reported)
        return hz if hz.out else None

    hz = wait_for(begun)
    assert hz
    hz.wait_for_line("no new messages on ticks")
    assert hz.interrupt() == 0


def test_a_sim_that_receives_no_command_is_no_success(
    verb: Verb, town: Wire, tmp_path: Path
) -> None:
    """Its status goes on, but the commands do not get through, as in a flood of others."""
    bus, end = town.bus("deaf"), threading.Event()
    bus.subscribe("Deaf/cmd_vel", Twist)
    status = bus.publisher("Deaf/cmd_vel_status", CommandStatus)

    def live() -> None:
        while not end.wait(0.05):
            status.put(CommandStatus(name="Deaf"))

    sim = threading.Thread(target=live)
    sim.start()
    try:
        done = verb(town, "topic", "pub", "Deaf/cmd_vel", AHEAD, "--once")
        assert (done.returncode, "not obeyed: the sim has not received it" in done.stderr) == (
            1,
            True,
        )
        (tmp_path / "script").write_text("2s i\n")
        teleop = town.start("teleop", "Deaf", "--script", str(tmp_path / "script"))
        assert teleop.wait() == 1
        assert "the sim has received no command" in teleop.err
    finally:
        end.set()
        sim.join()
