"""`holozen topic pub` checks that what it writes arrives, is valid and is obeyed, or reports why not."""

import json
import os
import signal
import subprocess
import threading

import pytest

from holozen.messages import CommandStatus, Twist
from holozen.testing import Wire, wait_for
from holozen.testing.wire import command

from .processes import assert_one_line
from .robots import Robot, moves

AHEAD = '{"linear": {"x": 0.2}}'


def test_it_reports_the_number_of_subscribers(town: Wire, robot: Robot) -> None:
    """The sim, and the test that listens to commands."""
    done = town.run("topic", "pub", "cmd_vel", AHEAD, "--once")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "2 subscribers of cmd_vel\n")
    output = json.loads(town.run("topic", "pub", "cmd_vel", "{}", "-t", "2", "--json").stdout)
    assert output == {"key": "cmd_vel", "type": "geometry_msgs/msg/Twist", "subscribers": 2, "published": 2}


def test_it_waits_for_as_many_subscribers_as_requested(town: Wire, robot: Robot) -> None:
    pub = town.start("topic", "pub", "cmd_vel", AHEAD, "--once", "-w", "3")
    pub.wait_for_line("waiting for 3 subscribers to cmd_vel (2 so far)")
    other = town.bus("other").subscribe("cmd_vel", Twist)
    assert pub.wait() == 0
    assert other.recv().message == Twist.planar(0.2)


def test_it_gives_up_waiting_when_asked(town: Wire) -> None:
    done = town.run("topic", "pub", "nobody", "geometry_msgs/msg/Twist", AHEAD, "-1", "-w", "1", "--max-wait", "0.1")
    assert done.returncode == 1
    assert "no subscribers of nobody" in done.stderr


def test_fewer_subscribers_than_requested_are_not_enough(town: Wire, robot: Robot) -> None:
    done = town.run("topic", "pub", "cmd_vel", "{}", "-1", "-w", "9", "--max-wait", "0.2")
    assert done.returncode == 1
    assert "cmd_vel: 9 subscribers did not come in time, so nothing is published" in done.stderr


def test_it_needs_no_subscriber_where_it_does_not_wait(town: Wire) -> None:
    done = town.run("topic", "pub", "nobody", "geometry_msgs/msg/Twist", AHEAD, "--once", "--no-wait")
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ('{"linaer": {}}', "has no field 'linaer' (did you mean 'linear'?)"),
        ('{"linear": {"X": 1}}', "has no field 'linear.X'"),
        ('{"angular": {"zz": 1}}', "has no field 'angular.zz' (did you mean 'z'?)"),
        ('{"linear": {"x": "1"}}', "linear.x: '1' is not a valid float64"),
        ("linear: {x: .inf}", "linear.x is not a finite number; --force sends it all the same"),
    ],
)
def test_a_wrong_field_is_refused_with_the_closest_name(town: Wire, value: str, expected: str) -> None:
    assert_one_line(town.run("topic", "pub", "cmd_vel", value, "--once"), 1, "refused: ", expected)


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("cmd_vel", '{"linear": {"x": 1e308}}', "linear.x is 1e+308 m/s; at most 100"),
        ("Fred/cmd_vel", "twist: {angular: {y: -1001}}", "angular.y is -1001 rad/s; at most 1000"),
        ("joint_command", "{name: [j], velocity: [2e3]}", "velocity[0] of joint 'j' is 2000; at most 1000"),
    ],
)
def test_what_no_robot_can_mean_is_refused_and_not_sent(wire: Wire, key: str, value: str, expected: str) -> None:
    heard = wire.bus().subscribe_raw(key)
    for often in (("--once",), ("-r", "20")):
        words = ("topic", "pub", key, value, *often)
        assert_one_line(wire.run(*words), 1, f"{key}: refused: {expected}; --force sends it all the same")
    assert heard.try_recv() is None


def test_a_type_that_the_key_does_not_carry_is_refused(town: Wire) -> None:
    words = ("topic", "pub", "cmd_vel", "nav_msgs/msg/Odometry", "{}", "--once", "--no-wait")
    expected = (
        "cmd_vel: its type is geometry_msgs/msg/Twist or geometry_msgs/msg/TwistStamped, not nav_msgs/msg/Odometry"
    )
    assert_one_line(town.run(*words), 1, expected)
    assert town.run(*words, "--force").returncode == 0


@pytest.mark.parametrize("wire_name", ["json", "msgpack"])
def test_force_sends_what_the_sim_then_refuses_and_reports_it(town: Wire, robot: Robot, wire_name: str) -> None:
    words = ["{linear: {x: .nan}}", "-r", "20", "--force", "--wire", wire_name]
    pub = town.start("topic", "pub", "cmd_vel", *words)
    pub.wait_for_line("not obeyed: ")
    pub.signal(signal.SIGINT)
    assert pub.wait() == 0
    robot.stands()


@pytest.mark.parametrize("often", ["--once", "-t 2"])
def test_to_a_stopped_robot_it_fails_and_says_so(town: Wire, robot: Robot, often: str) -> None:
    assert town.run("stop").returncode == 0
    try:
        done = town.run("topic", "pub", "cmd_vel", *often.split(), AHEAD)
    finally:
        assert town.run("release").returncode == 0
    assert done.returncode == 1
    assert "not obeyed: stop@" in done.stderr and "has set the software stop" in done.stderr


def test_a_misspelt_key_is_refused_with_the_closest(town: Wire, robot: Robot) -> None:
    for key, meant in (("cmd_vl", "cmd_vel"), ("Fred/cmd_vle", "Fred/cmd_vel")):
        expected = f"holozen topic pub: '{key}' has no known type (did you mean '{meant}'?); known keys: cmd_vel, odom"
        assert_one_line(town.run("topic", "pub", key, AHEAD, "--once"), 1, expected)


def test_numbers_are_those_of_json_in_yaml_too(town: Wire) -> None:
    heard = town.bus("other").subscribe("cmd_vel", Twist)
    assert town.run("topic", "pub", "cmd_vel", "{linear: {x: 2e-1}}", "--once").returncode == 0
    assert heard.recv().message == Twist.planar(0.2)


def test_it_reports_when_another_one_drives_and_when_it_is_obeyed(town: Wire, robot: Robot) -> None:
    first = town.start("topic", "pub", "cmd_vel", AHEAD)
    robot.odom.next(lambda odom: moves(odom, 0.2, 0, 0))
    second = town.start("topic", "pub", "cmd_vel", '{"linear": {"y": 0.1}}')
    assert "drives" in second.wait_for_line("not obeyed: topic_pub@")
    first.signal(signal.SIGINT)
    second.wait_for_line("obeyed again")
    robot.odom.next(lambda odom: moves(odom, 0, 0.1, 0))
    second.signal(signal.SIGINT)
    assert (first.wait(), second.wait()) == (0, 0)
    robot.stands()


def test_a_forced_mistake_is_named_also_where_another_one_drives(town: Wire, robot: Robot) -> None:
    driver = town.start("topic", "pub", "cmd_vel", AHEAD)
    robot.odom.next(lambda odom: moves(odom, 0.2, 0, 0))
    done = town.run("topic", "pub", "cmd_vel", '{"linear": {"x": 1e308}}', "--once", "--force")
    assert "not obeyed: linear.x is 1e+308 m/s; at most 100" in done.stderr
    driver.signal(signal.SIGINT)
    assert driver.wait() == 0
    robot.stands()


def test_it_reports_that_the_sim_drives_slower_than_shown(town: Wire, robot: Robot) -> None:
    pub = town.start("topic", "pub", "cmd_vel", '{"linear": {"x": 99}}')
    assert "clamped" in pub.wait_for_line("over the limits of")
    pub.signal(signal.SIGINT)
    assert pub.wait() == 0
    robot.stands()


def test_lines_of_standard_input_are_published_and_the_robot_stops_at_their_end(town: Wire, robot: Robot) -> None:
    words = command("topic", "pub", "cmd_vel", "--stdin", *town.flags)
    with subprocess.Popen(words, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as pub:
        assert pub.stdin and pub.stderr
        seen = robot.odom

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
    assert seen
    robot.stands()


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


def test_any_type_is_published_with_its_fields(town: Wire) -> None:
    echo = town.start("topic", "echo", "scan", "--once", "--json")
    words = ["scan", "sensor_msgs/msg/LaserScan", "{ranges: [1, 2.5]}", "-r", "50"]
    for wire_name in ("json", "cdr"):
        with town.start("topic", "pub", *words, "--wire", wire_name):
            assert echo.wait() == 0
            assert json.loads(echo.out)["ranges"] == [1.0, 2.5]
        echo = town.start("topic", "echo", "scan", "--once", "--json")
    echo.close()
    expected = "holozen topic pub: scan: no type 'sensor_msgs/msg/LaserScn' (did you mean 'sensor_msgs/msg/LaserScan'?)"
    assert_one_line(town.run("topic", "pub", "scan", "sensor_msgs/msg/LaserScn", "--once"), 1, expected)


def test_lost_samples_are_counted_by_the_publishers_numbers(town: Wire) -> None:
    """A publisher of ours that loses five samples after each."""
    bus = town.bus("ours")
    publisher, skip = bus.publisher("holes", Twist), bus.stamps("holes")
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
    hz = town.start("topic", "hz", "ticks", "--timeout", "0.5")

    def reported() -> str:
        publisher.put(Twist())
        return hz.out

    wait_for(reported)
    hz.wait_for_line("no new messages on ticks")
    hz.signal(signal.SIGINT)
    assert hz.wait() == 0


def test_a_sim_that_receives_no_command_is_no_success(town: Wire) -> None:
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
        done = town.run("topic", "pub", "Deaf/cmd_vel", AHEAD, "--once")
        assert (done.returncode, "not obeyed: the sim has not received it" in done.stderr) == (1, True)
        done = town.run("teleop", "Deaf", "--script", "-", given="3s i\n")
        assert (done.returncode, "the sim has received none of the commands" in done.stderr) == (1, True)
    finally:
        end.set()
        sim.join()
