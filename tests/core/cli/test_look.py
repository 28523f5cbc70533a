"""The verbs that look: topic list, info and echo, service list and call, node list, against real
publishers.
"""

import json
import threading
import time
from argparse import ArgumentTypeError
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest
import zenoh

from holozen.bus import Bus
from holozen.cli import main
from holozen.cli.plot import chosen_field
from holozen.messages import Clock, NextGoalReply, NextGoalRequest, Odometry, TFMessage, Twist
from holozen.testing import Wire, wait_for
from holozen.transport.errors import ServiceError
from holozen.transport.pubsub import Publisher

Run = Callable[..., tuple[int, str, str]]


def goal(request: NextGoalRequest) -> NextGoalReply:
    if request.request_goal > 3:
        raise ServiceError("goal 4: the list holds goals 0 to 3")
    return NextGoalReply(float(request.request_goal), 2.5)


@pytest.fixture
def sim(wire: Wire) -> Iterator[Bus]:
    """A node that writes Fred/odom, reads cmd_vel and serves next_goal."""
    bus = wire.bus("sim", lasting=True)
    odom: Publisher[Odometry] = bus.publisher("Fred/odom", Odometry)
    bus.subscribe("cmd_vel", Twist)
    bus.serve("next_goal", NextGoalRequest, NextGoalReply, goal).start()
    done = threading.Event()

    def publish() -> None:
        while not done.wait(0.01):
            odom.put(Odometry(child_frame_id="base"))

    with ThreadPoolExecutor() as pool:
        pool.submit(publish)
        yield bus
        done.set()


def test_echo_refuses_another_type_than_the_publishers_announce(sim: Bus, run: Run) -> None:
    error = (
        "holozen topic echo: Fred/odom: its type is nav_msgs/msg/Odometry, not "
        "geometry_msgs/msg/Twist; "
    )
    for words in (["geometry_msgs/msg/Twist"], ["--type", "geometry_msgs/Twist"]):
        code, out, err = run("topic", "echo", "Fred/odom", "--once", *words)
        assert (code, out, err.count("\n")) == (1, "", 1) and err.startswith(error)
    assert (
        run(
            "topic", "echo", "Fred/odom", "nav_msgs/Odometry", "--once", "--field", "child_frame_id"
        )[0]
        == 0
    )


def test_topics_are_listed_once_with_their_types(sim: Bus, run: Run) -> None:
    sim.subscribe("Fred/odom", Odometry)
    sim.subscribe("**/odom", Odometry)
    assert run("topic", "list") == (0, "Fred/odom\ncmd_vel\n", "")
    assert (
        run("topic", "list", "-t")[1]
        == "Fred/odom [nav_msgs/msg/Odometry]\ncmd_vel [geometry_msgs/msg/Twist]\n"
    )


def test_names_from_the_wire_cannot_move_the_cursor(wire: Wire, run: Run) -> None:
    foreign = wire.bus()
    foreign.node = "evil\x1b[2J\nnode"  # as no Bus is named, but any program can name itself
    foreign.announce_node()
    foreign.publisher("evil\x1b[2J\nkey", Twist)
    foreign.serve("evil\x1b[2J\nservice", NextGoalRequest, NextGoalReply, goal)
    assert run("topic", "list")[1] == "evil?[2J?key\n"
    assert run("service", "list")[1] == "evil?[2J?service\n"
    assert run("node", "list")[1] == "evil?[2J?node\n"
    assert f"  evil?[2J?node ({foreign.id[:6]})\n" in run("topic", "info", "evil\x1b[2J\nkey")[1]


def test_a_type_is_that_of_one_key(sim: Bus, run: Run) -> None:
    for verb in ("type", "info"):
        code, out, err = run("topic", verb, "*/odom")
        assert (code, out) == (1, "")
        assert "'*/odom': name one key; `holozen topic list` lists them\n" in err


def test_info_shows_type_writers_and_readers_also_those_of_an_expression(
    sim: Bus, run: Run, wire: Wire
) -> None:
    reader = wire.bus("pose_service")
    reader.subscribe("**/odom", Odometry)
    code, out, err = run("topic", "info", "/Fred/odom")
    assert (code, err) == (0, "")
    assert out.splitlines() == [
        "Type: nav_msgs/msg/Odometry",
        "Publisher count: 1",
        f"  sim ({sim.id[:6]})",
        "Subscription count: 1",
        f"  pose_service ({reader.id[:6]})",
    ]


def test_info_of_an_unknown_key_names_those_known(sim: Bus, run: Run) -> None:
    code, out, err = run("topic", "info", "odmo")
    assert (code, out) == (1, "")
    assert err == "holozen topic info: unknown key 'odmo'; known: Fred/odom, cmd_vel\n"


def test_echo_shows_a_message_of_a_key_or_an_expression(sim: Bus, run: Run) -> None:
    code, out, _ = run("topic", "echo", "Fred/odom", "--once")
    assert code == 0
    assert "child_frame_id: base\n" in out
    assert out.endswith("---\n")
    assert (
        json.loads(run("topic", "echo", "Fred/odom", "--once", "--json")[1])["child_frame_id"]
        == "base"
    )
    output = json.loads(run("topic", "echo", "*/odom", "--once", "--json")[1])
    assert (output["key"], output["value"]["child_frame_id"]) == ("Fred/odom", "base")
    assert run("topic", "echo", "*/odom", "--once")[1].startswith("# Fred/odom\nheader:\n")


def test_echo_of_a_silent_key_ends_with_its_timeout(sim: Bus, run: Run, wire: Wire) -> None:
    expected = "holozen topic echo: no messages on odom within 0.1 s (did you mean 'Fred/odom'?)\n"
    assert run("topic", "echo", "odom", "--timeout", "0.1") == (1, "", expected)


@pytest.mark.parametrize("verb", ["echo", "hz"])
def test_a_silent_key_is_reported_with_the_closest_one(
    sim: Bus, run: Run, wire: Wire, verb: str
) -> None:
    code, _, err = run("topic", verb, "Fred/odomm", "--timeout", "0.1")
    assert (code, err.count("\n")) == (1, 1)
    assert err.endswith("no messages on Fred/odomm within 0.1 s (did you mean 'Fred/odom'?)\n")


@pytest.mark.parametrize(
    ("filter", "expected"),
    [
        (
            "m.pose.pose.positoin.x > 1",
            "; no field 'positoin' (did you mean 'position'?); there are position, orientation",
        ),
        (
            "poes.pose.position.x > 1",
            "; no field 'poes' (did you mean 'pose'?); there are header, child_frame_id, pose",
        ),
        ("m.pose.pose.position.x > 1 and len(m.child_frame_id) > 0", ""),
    ],
)
def test_a_filter_of_a_missing_field_is_reported(
    sim: Bus, run: Run, filter: str, expected: str
) -> None:
    start = "holozen topic echo: no message that passes the filter on Fred/odom within 0.3 s"

    def is_reported() -> bool:
        """False where a busy machine had no message within that time."""
        code, _, err = run("topic", "echo", "Fred/odom", "--timeout", "0.3", "--filter", filter)
        assert (code, err.count("\n")) == (1, 1)
        assert err.startswith(start)
        return err.startswith(start + (expected or "\n"))

    wait_for(is_reported)


def test_a_waiting_echo_suggests_the_closest_key(sim: Bus, wire: Wire) -> None:
    echo = wire.start("topic", "echo", "Fred/odomm")
    echo.wait_for_line("waiting for Fred/odomm; no messages yet (did you mean 'Fred/odom'?)")


def test_an_echo_of_a_key_that_only_a_named_robot_has_names_that(wire: Wire, run: Run) -> None:
    bus = wire.bus("sim")
    bus.publisher("Fred/tf", TFMessage)
    bus.publisher("clock", Clock)
    expected = "holozen topic echo: no messages on tf within 0.1 s (did you mean 'Fred/tf'?)\n"
    assert run("topic", "echo", "tf", "--timeout", "0.1") == (1, "", expected)
    assert "unknown key 'tf' (did you mean 'Fred/tf'?); known: " in run("topic", "info", "tf")[2]


def test_a_plot_of_a_key_that_no_node_has_names_the_nearest(sim: Bus, run: Run, wire: Wire) -> None:
    expected = "holozen plot: no messages on Fred/odomm (did you mean 'Fred/odom'?)\n"
    assert run("plot", "Fred/odomm.x", "--once", "-w", "0.1", "--json") == (1, "", expected)
    plot = wire.start("plot", "Fred/odomm.x", "--json")
    plot.wait_for_line("holozen plot: waiting for Fred/odomm (did you mean 'Fred/odom'?)")


def test_without_nodes_a_verb_explains_how_to_start_some(run: Run, wire: Wire) -> None:
    for words, start in [
        ("topic echo odom --timeout 0.1", "holozen topic echo: no messages on odom within 0.1 s"),
        (
            "topic pub cmd_vel {} --once --max-wait 0.1",
            "holozen topic pub: no subscribers of cmd_vel",
        ),
        ("plot odom.x --json --once -w 0.1", "holozen plot: no messages on odom"),
        ("topic hz odom --timeout 0.1", "holozen topic hz: no messages on odom within 0.1 s"),
    ]:
        expected = f"{start}; no nodes found at {wire.endpoint}; `holozen up` starts a robot\n"
        assert run(*words.split()) == (1, "", expected)
    wire.terminal("plot", "odom.x").wait_for_text("waiting for odom; no nodes found at")


def test_an_unknown_service_is_reported_with_the_closest(sim: Bus, run: Run) -> None:
    code, _, err = run("service", "call", "Fred/next_goal", "--timeout", "0.1")
    assert (code, err.count("\n")) == (1, 1)
    assert err.endswith("lists the servers (did you mean 'next_goal'?)\n")


def test_echo_of_a_wrong_key_is_one_line(run: Run) -> None:
    code, out, err = run("topic", "echo", "a//b")
    assert (code, out) == (1, "")
    assert err.startswith("holozen topic echo: key 'a//b': ")
    assert err.count("\n") == 1


def test_services_are_listed_and_called(sim: Bus, run: Run) -> None:
    assert run("service", "list") == (0, "next_goal\n", "")
    assert run("service", "list", "-t")[1] == "next_goal [holozen/srv/NextGoal]\n"
    assert run("service", "call", "next_goal", "request_goal: 2") == (
        0,
        "x_goal: 2.0\ny_goal: 2.5\ntheta_goal: 0.0\nend_of_list: 0\n",
        "",
    )
    assert json.loads(run("service", "call", "next_goal", "--json")[1])["y_goal"] == 2.5


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (
            ("next_goal", "request_goal: 4"),
            "holozen service call: goal 4: the list holds goals 0 to 3\n",
        ),
        (
            ("next_goal", "{gaol: 4}"),
            "holozen service call: next_goal: refused: holozen/srv/NextGoal_Request has no field",
        ),
        (
            ("get_pose", "--timeout", "0.05"),
            "holozen service call: no reply from 'get_pose' within 0.05 s",
        ),
        (
            ("nonsense",),
            "holozen service call: 'nonsense' has no known type; known: next_goal, get_pose, ",
        ),
    ],
)
def test_a_call_that_fails_is_one_line(
    sim: Bus, run: Run, words: tuple[str, ...], expected: str
) -> None:
    code, out, err = run("service", "call", *words)
    assert (code, out) == (1, "")
    assert err.startswith(expected)
    assert err.count("\n") == 1


def test_flags_of_ros2_that_change_nothing_are_taken(sim: Bus, run: Run) -> None:
    for words in [
        "topic echo Fred/odom --once --qos-reliability best_effort --qos-durability=volatile "
        "--qos-profile sensor_data",
        "topic pub cmd_vel {} --once --qos-depth 1 --keep-alive 0.1 --spin-time 1",
        "topic list --no-daemon --include-hidden-topics",
        "topic hz Fred/odom --once --spin-time 0.5",
        "service list --no-daemon --include-hidden-services",
        "service call next_goal --spin-time 1",
        "node list -a --no-daemon",
        "param list --no-daemon --include-hidden-nodes",
    ]:
        assert run(*words.split())[0] == 0


def test_help_lists_the_flags_that_change_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["topic", "echo", "--help"])
    assert (
        "They have no effect here."
        in capsys.readouterr().out.partition("accepted for compatibility with ros2:")[2]
    )


def test_nodes_are_listed(sim: Bus, run: Run, wire: Wire) -> None:
    wire.bus("teleop", lasting=True)
    wire.bus("topic_echo")
    assert run("node", "list") == (0, "sim\nteleop\n", "")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("topic list", "no topics: no nodes found at {}; `holozen up` starts a robot\n"),
        ("service list", "no services: no nodes found at {}; `holozen up` starts a robot\n"),
        ("node list", "no nodes found at {}; `holozen up` starts a robot\n"),
        ("graph", "no nodes found at {}; `holozen up` starts a robot\n"),
    ],
)
def test_without_nodes_the_lists_are_empty_and_report_it(
    run: Run, wire: Wire, words: str, expected: str
) -> None:
    assert run(*words.split()) == (0, "", expected.format(wire.endpoint))


def test_publishing_what_is_no_message_never_reaches_the_wire(run: Run) -> None:
    for value in ('{"linear":{"x":NaN}}', '{"linaer":{}}', "[]"):
        code, out, err = run("topic", "pub", "cmd_vel", value)
        assert (code, out) == (1, "")
        assert err.startswith("holozen topic pub: cmd_vel: refused: ")
        assert err.count("\n") == 1
    assert (
        "has no known type; known keys: cmd_vel, odom" in run("topic", "pub", "nonsense", "{}")[2]
    )


def test_a_wildcard_is_not_published_to(run: Run) -> None:
    for key in ("*/cmd_vel", "**/cmd_vel", "a$*/cmd_vel", "cmd_vel?x"):
        code, out, err = run("topic", "pub", key, "{}")
        assert (code, out) == (1, "")
        assert (
            err
            == f"holozen topic pub: {key!r}: write to one key; a wildcard would move every robot\n"
        )


def test_a_foreign_service_is_called_as_it_is_or_by_its_type(wire: Wire, run: Run) -> None:
    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply("tea", query.payload, encoding="application/json")

    queryable = wire.bus("foreign").session.declare_queryable("tea", answer)
    assert run("service", "call", "tea", "{sugar: 2}", "--any") == (0, "sugar: 2\n", "")
    assert (
        run("service", "call", "tea", "std_srvs/srv/SetBool", "{data: true}", "--json")[1]
        == '{"data": true}\n'
    )
    code, _, err = run("service", "call", "tea", "std_srvs/srv/SetBool", "{dta: true}")
    assert code == 1
    assert "dta" in err
    queryable.undeclare()


@pytest.mark.parametrize(
    "value",
    [
        "{header: auto, twist: {linear: {x: 0.1}}}",
        "{header: {stamp: now}, twist: {linear: {x: 0.1}}}",
    ],
)
def test_a_stamp_of_now_is_another_one_each_time(run: Run, wire: Wire, value: str) -> None:
    tap = wire.bus("reader").subscribe_raw("cmd_vel", 100)
    before = time.time()
    assert (
        run(
            "topic",
            "pub",
            "-t",
            "2",
            "-r",
            "100",
            "cmd_vel",
            "geometry_msgs/msg/TwistStamped",
            value,
        )[0]
        == 0
    )
    stamps = [json.loads(tap.recv().payload)["header"]["stamp"] for _ in range(2)]
    first, second = (stamp["sec"] + stamp["nanosec"] * 1e-9 for stamp in stamps)
    assert before - 1e-3 <= first < second <= time.time() + 1e-3


def test_a_key_without_a_field_is_answered_with_a_field_of_it() -> None:
    for word, field in [
        ("odom", "odom.twist.twist.linear.x"),
        ("a/odom/twist", "a/odom.twist.twist.linear.x"),
        ("Fred/cmd_vel", "Fred/cmd_vel.linear.x"),
        ("what", "odom.twist.twist.linear.x"),
    ]:
        with pytest.raises(ArgumentTypeError, match=rf"write KEY.FIELD, such as {field}$"):
            chosen_field(word)
