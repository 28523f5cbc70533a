"""`holozen ros2`, with nodes of zenoh-ros2-sdk as the other side."""

import itertools
import threading
import time
from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy
import pytest

from holozen.messages import (
    CommandStatus,
    Odometry,
    TFMessage,
    TransformStamped,
    TriggerReply,
    TriggerRequest,
    Twist,
    codec,
)
from holozen.ros.gateway import rmw_zenoh as rmw
from holozen.ros.gateway.rmw_zenoh import Ages, Attachment
from holozen.ros.generated import find
from holozen.testing import Wire, wait_for
from holozen.transport.actions import ActionServer, Goal, State

if TYPE_CHECKING:
    from .conftest import Theirs

TWIST, ODOM = "geometry_msgs/msg/Twist", "nav_msgs/msg/Odometry"
FIBONACCI = "example_interfaces/action/Fibonacci"


def joined(wire: Wire, *words: str) -> Any:
    process = wire.start("ros2", *words)
    process.wait_for_line("joins ROS 2's domain 0")
    return process


def test_a_ros_node_sees_reads_drives_and_stops_our_robot(wire: Wire, theirs: "Theirs") -> None:
    wire.start("sim").wait_for_line("listens on cmd_vel", 60)
    joined(wire)
    odom: list[Any] = []
    theirs.subscriber("/odom", ODOM, odom.append)
    wait_for(lambda: odom, what="odometry")
    expected = {
        "/odom": [ODOM],
        "/tf": ["tf2_msgs/msg/TFMessage"],
        "/cmd_vel": [TWIST],
        "/clock": ["rosgraph_msgs/msg/Clock"],
        "/robot_description": ["std_msgs/msg/String"],
    }
    wait_for(
        lambda: theirs.topics().items() >= expected.items(),
        what=lambda: f"our topics in {theirs.topics()}",
    )

    description = theirs.latched("/robot_description", "std_msgs/msg/String")
    assert '<link name="base' in description.data

    status = wire.bus().latest("cmd_vel_status", CommandStatus)
    commands = theirs.publisher("/cmd_vel", TWIST, "their_teleop")
    vector = theirs.type("geometry_msgs/msg/Vector3")
    forward = {"linear": vector(x=0.3, y=0.0, z=0.0), "angular": vector(x=0.0, y=0.0, z=0.0)}

    def drives(what: Any) -> bool:
        commands.publish(**forward)
        return bool(what())

    wait_for(
        lambda: drives(lambda: odom[-1].twist.twist.linear.x > 0.25), what="the robot to drive"
    )

    def obeyed() -> bool:
        found = status.read()[0]
        return (
            found is not None
            and found.obeyed.startswith("ros2/their_teleop@")
            and found.priority == "DATA"
        )

    wait_for(lambda: drives(obeyed), what=lambda: f"it to be obeyed: {status.read()[0]}")

    def is_listed() -> bool:
        lines = wire.run("topic", "list", "-v").stdout.splitlines()
        return any("cmd_vel " in line and "1 publisher" in line for line in lines)

    wait_for(is_listed, what="their publisher in our list")
    wait_for(lambda: abs(odom[-1].twist.twist.linear.x) < 0.01, what="the watchdog to stop it")

    wait_for(lambda: "/stop" in theirs.services(), what="our service")
    stop = theirs.trigger("/stop")
    assert [stop.call().success, stop.call().success] == [True, True]
    begin = len(odom)
    wait_for(lambda: drives(lambda: len(odom) > begin + 50), 20, "a second of odometry")
    assert abs(odom[-1].twist.twist.linear.x) < 0.01


def test_their_topics_are_listed_and_read_here(wire: Wire, theirs: "Theirs") -> None:
    joined(wire)
    chatter = theirs.publisher("/chatter", "std_msgs/msg/String")
    wait_for(lambda: " * chatter [std_msgs/msg/String]" in wire.run("topic", "list", "-v").stdout)
    echo = wire.start("topic", "echo", "chatter")

    def heard() -> bool:
        chatter.publish(data="grüße")
        return "data: grüße" in echo.out

    wait_for(heard)


def test_a_service_of_theirs_is_called_from_here(wire: Wire, theirs: "Theirs") -> None:
    joined(wire)
    theirs.serve_trigger("/dock", "docked")
    assert wire.bus().call("dock", TriggerRequest(), TriggerReply, timeout=10.0) == TriggerReply(
        True, "docked"
    )
    assert wire.run("service", "type", "/dock").stdout.strip() == "std_srvs/srv/Trigger"


def test_a_service_that_is_ours_is_not_replaced_by_theirs(wire: Wire, theirs: "Theirs") -> None:
    wire.bus("sim").serve(
        "stop", TriggerRequest, TriggerReply, lambda _: TriggerReply(True, "ours")
    ).start()
    gateway = joined(wire)
    theirs.serve_trigger("/stop", "theirs")
    gateway.wait_for_line("ros2: /stop is not forwarded: sim serves stop here")
    assert wire.bus().call("stop", TriggerRequest(), TriggerReply).message == "ours"


def test_nodes_of_humble_have_keys_without_hashes(wire: Wire, theirs: "Theirs") -> None:
    theirs.humble = True
    joined(wire, "--humble")
    odom = wire.bus("sim").publisher("odom", Odometry)
    reader = wire.bus().subscribe("cmd_vel", Twist)
    heard: list[Any] = []
    theirs.subscriber("/odom", ODOM, heard.append)
    commands, vector = theirs.publisher("/cmd_vel", TWIST), theirs.type("geometry_msgs/msg/Vector3")
    theirs.serve_trigger("/dock", "docked")

    def both() -> bool:
        odom.put(Odometry(child_frame_id="ours"))
        commands.publish(linear=vector(x=0.3, y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=0.0))
        return bool(heard) and reader.try_recv() is not None

    wait_for(both)
    assert heard[0].child_frame_id == "ours"
    assert wire.bus().call("dock", TriggerRequest(), TriggerReply, timeout=10.0).message == "docked"


def test_a_node_of_humble_is_reported_without_the_flag(wire: Wire, theirs: "Theirs") -> None:
    gateway = joined(wire)
    theirs.humble = True
    wire.bus().subscribe("cmd_vel", Twist)
    theirs.publisher("/cmd_vel", TWIST, "old_teleop")
    gateway.wait_for_line(
        "ros2: /cmd_vel is not forwarded: old_teleop is of ROS 2 Humble; see --humble"
    )


def test_a_latched_topic_reaches_a_late_subscriber_also_one_that_asks_as_soon_as_it_is_shown(
    wire: Wire, theirs: "Theirs"
) -> None:
    static = wire.bus("statics").publisher("tf_static", TFMessage)
    static.put(TFMessage([TransformStamped(child_frame_id="scanner")]))
    session, shown = wire.bus().session, threading.Event()
    token = "@ros2_lv/*/*/*/*/MP/*/*/*/%tf_static/**"
    with session.liveliness().declare_subscriber(token, lambda _: shown.set()):
        joined(wire)
        assert shown.wait(20)
    last = "*/tf_static/**/@adv/pub/**?_anyke"
    assert [reply for reply in session.get(last, timeout=5.0) if reply.ok]
    found = theirs.latched("/tf_static", "tf2_msgs/msg/TFMessage")
    assert found.transforms[0].child_frame_id == "scanner"


def test_a_ros_node_is_a_client_of_our_actions(wire: Wire, theirs: "Theirs") -> None:
    fibonacci, begun, feedback = find(FIBONACCI), list[Goal](), list[Any]()
    server = ActionServer(
        wire.bus("maths"), "fibonacci", fibonacci, lambda _: "", lambda _, goal: begun.append(goal)
    )
    server.start()
    gateway = joined(wire)
    wait_for(lambda: "/fibonacci/_action/feedback" in theirs.topics())
    parts = {f"/fibonacci/_action/{part}" for part in ("send_goal", "get_result")}
    wait_for(lambda: parts <= theirs.services().keys())
    theirs.subscriber(
        "/fibonacci/_action/feedback", f"{FIBONACCI}_FeedbackMessage", feedback.append
    )
    send = theirs.client("/fibonacci/_action/send_goal", f"{FIBONACCI}_SendGoal")
    result = theirs.client("/fibonacci/_action/get_result", f"{FIBONACCI}_GetResult")
    late = b"\0\1\0\0" + bytes(16 * [6]) + (3).to_bytes(4, "little")
    (reply,) = send.querier.get(payload=late, attachment=sample(1, time.time() - 1.0).packed())
    gateway.wait_for_line("ros2: /fibonacci/_action/send_goal: it was sent more than 0.5 s from")
    assert not reply.ok.payload.to_bytes()[4] and not begun, (
        "it is rejected: it may have waited on its way"
    )
    identity = theirs.type("unique_identifier_msgs/msg/UUID")(uuid=numpy.full(16, 7, numpy.uint8))
    asked = {"goal_id": identity, "goal": theirs.type(f"{FIBONACCI}_Goal")(order=3)}
    # one that a busy machine held up is rejected, as the one above
    wait_for(lambda: (reply := send.call(**asked)) and reply.accepted, what="the goal to begin")
    (goal,) = begun
    assert goal.request.order == 3

    def heard() -> bool:
        server.feedback(goal, fibonacci.Feedback(sequence=[0, 1]))
        return bool(feedback)

    wait_for(heard, what="feedback")
    assert list(feedback[0].feedback.sequence) == [0, 1]
    server.finish(goal, State.SUCCEEDED, fibonacci.Result(sequence=[0, 1, 1]))
    found = result.call(goal_id=identity)
    assert (found.status, list(found.result.sequence)) == (State.SUCCEEDED, [0, 1, 1])


def test_beside_our_robot_no_odometry_of_theirs_comes_in(wire: Wire, theirs: "Theirs") -> None:
    ours, reader = (
        wire.bus("sim").publisher("odom", Odometry),
        wire.bus("reader").subscribe("odom", Odometry),
    )
    gateway = joined(wire)
    wait_for(lambda: "/odom" in theirs.topics(), what="our odom, before theirs comes")
    other = theirs.publisher("/odom", ODOM, "their_robot")
    gateway.wait_for_line("ros2: /odom is not forwarded: sim publishes odom here")
    robots: list[str] = []

    def heard() -> bool:
        wrong = codec.encode(Odometry(child_frame_id="theirs"), "cdr")
        other.pub.put(wrong, attachment=sample(len(robots), time.time()).packed())
        ours.put(Odometry(child_frame_id="ours"))
        robots.extend(
            received.message.child_frame_id
            for received in iter(reader.try_recv, None)
            if received.message
        )
        return len(robots) >= 5

    wait_for(heard, what="our odometry")
    assert set(robots) == {"ours"}


def test_a_command_that_waited_on_its_way_is_left_out(wire: Wire, theirs: "Theirs") -> None:
    gateway = joined(wire)
    reader = wire.bus().subscribe("cmd_vel", Twist)
    commands = theirs.publisher("/cmd_vel", TWIST)

    def heard(number: int, sent: float, x: float) -> bool:
        commands.pub.put(
            codec.encode(Twist.planar(x=x), "cdr"), attachment=sample(number, sent).packed()
        )
        return reader.try_recv() is not None

    wait_for(lambda: heard(1, time.time(), 0.1))
    now = time.time()
    wait_for(
        lambda: heard(1, time.time(), 0.1) and time.time() > now + 2 * rmw.PACE,
        what="it to keep pace",
    )
    heard(1, now - 1.0, 0.2)
    gateway.wait_for_line(
        "ros2: /cmd_vel is not forwarded: a command was under way for more than 0.5 s"
    )
    wait_for(lambda: heard(2, time.time(), 0.3))
    later = [
        received.message.linear.x for received in iter(reader.try_recv, None) if received.message
    ]
    assert 0.2 not in later


def test_a_release_or_play_that_waited_on_its_way_ends_no_stop_or_pause(
    wire: Wire, theirs: "Theirs"
) -> None:
    wire.start("sim").wait_for_line("listens on cmd_vel", 60)
    joined(wire)
    wire.bus().call("stop", TriggerRequest(), TriggerReply)
    wait_for(lambda: "/release" in theirs.services(), what="our service")
    release = theirs.trigger("/release")

    def asked(sent: float) -> TriggerReply:
        (reply,) = release.querier.get(payload=b"\0\1\0\0\0", attachment=sample(1, sent).packed())
        found = reply.ok.payload.to_bytes()
        answer: TriggerReply = codec.decode(
            found, "application/cdr;std_srvs/srv/Trigger_Response", (TriggerReply,)
        )
        return answer

    late = asked(time.time() - 1.0)
    assert (late.success, late.message[:40]) == (False, "it was sent more than 0.5 s from this ma")
    assert (
        wire.bus("other")
        .call("stop", TriggerRequest(), TriggerReply)
        .message.startswith("stopped by test@")
    )
    wait_for(lambda: asked(time.time()).success, what="a release of now to count")
    play = {"payload": b"\0\1\0\0\1", "attachment": sample(1, time.time() - 1.0).packed()}
    session = wire.bus("theirs").session
    reply, *_ = wait_for(
        lambda: list(session.get("0/set_simulation_state/**", **play)), what="our service"
    )
    assert b"it was sent more than 0.5 s" in reply.ok.payload.to_bytes()


def test_first_commands_that_waited_are_left_out_until_their_publisher_keeps_pace(
    wire: Wire, theirs: "Theirs"
) -> None:
    """By its clock they are 3 s old, as after a cut link; the clock of a machine may also be wrong
    by that.
    """
    gateway = joined(wire)
    reader = wire.bus().subscribe("cmd_vel", Twist)
    commands = theirs.publisher("/cmd_vel", TWIST)
    wait_for(lambda: commands.pub.matching_status.matching, what="the route")
    burst = time.time() - 3.0
    for number in range(20):
        commands.pub.put(
            codec.encode(Twist.planar(x=0.2), "cdr"), attachment=sample(number, burst).packed()
        )
        burst += 0.01  # less than shows a pace, however this process is held up
    gateway.wait_for_line(
        "ros2: /cmd_vel is not forwarded: a first command has a time of sending more than 0.5 s "
        "from"
    )
    assert reader.try_recv() is None
    numbers = itertools.count(20)
    came: list[float] = []

    def stopped() -> bool:
        commands.pub.put(
            codec.encode(Twist(), "cdr"), attachment=sample(next(numbers), burst).packed()
        )
        came.extend(
            received.message.linear.x
            for received in iter(reader.try_recv, None)
            if received.message
        )
        return bool(came)

    wait_for(stopped, what="a stop, which is forwarded at any age")
    assert set(came) == {0.0}

    def heard() -> bool:
        sent = time.time() - 1.0
        commands.pub.put(
            codec.encode(Twist.planar(x=0.3), "cdr"),
            attachment=sample(next(numbers), sent).packed(),
        )
        came.extend(
            received.message.linear.x
            for received in iter(reader.try_recv, None)
            if received.message
        )
        return any(came)

    wait_for(heard, what="the commands of a publisher that keeps pace")
    assert set(came) == {0.0, 0.3}


def test_a_second_one_ends(wire: Wire) -> None:
    processes = [joined(wire), wire.start("ros2")]
    wait_for(lambda: any(process.returncode is not None for process in processes))
    (ended,) = (process for process in processes if process.returncode is not None)
    assert ended.returncode == 1
    assert "another `holozen ros2` runs here" in ended.err.splitlines()[-1]


def test_nothing_goes_round_between_the_two_sides(wire: Wire, theirs: "Theirs") -> None:
    """A topic that both sides write and read."""
    joined(wire)
    there: list[Any] = []
    here = wire.bus("here")
    ours = here.publisher("go", Twist)
    reader = here.subscribe("go", Twist)
    theirs.subscriber("/go", TWIST, there.append)
    publisher = theirs.publisher("/go", TWIST)
    vector = theirs.type("geometry_msgs/msg/Vector3")

    def both() -> bool:
        ours.put(Twist.planar(x=1.0))
        publisher.publish(linear=vector(x=2.0, y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=0.0))
        seen.extend(
            received.message.linear.x
            for received in iter(reader.try_recv, None)
            if received.message
        )
        return 2.0 in seen and any(message.linear.x == 1.0 for message in there)

    seen: list[float] = []
    wait_for(both)
    marks = itertools.count(1000)  # of which each side gets one at most; a busy link drops some

    def marked() -> bool:
        ours.put(Twist.planar(x=float(next(marks))))
        came = [message.linear.x for message in there]
        seen.extend(
            received.message.linear.x
            for received in iter(reader.try_recv, None)
            if received.message
        )
        return all(sum(x >= 1000 for x in side) > 20 for side in (came, seen))

    wait_for(marked, what="our marks on both sides")
    for side in ([message.linear.x for message in there], seen):
        found = Counter(x for x in side if x >= 1000)
        assert max(found.values()) == 1, "none comes back"


def sample(number: int, sent: float) -> Attachment:
    return Attachment(number, round(sent * 1e9), bytes(16))


THEIRS = 1_700_000_000.0  # s; a clock of another machine, which disagrees with ours
CLOCK = 3000.0  # s; ours


def ages_of(ages: Ages, *samples: tuple[float, float]) -> list[float]:
    """The ages of samples, each with the times since the first at which it was sent and read."""
    found = [
        ages.of(sample(i, THEIRS + sent), 50.0 + read, CLOCK + read)
        for i, (sent, read) in enumerate(samples)
    ]
    return [round(age, 6) for age in found]


def test_age_needs_no_clock_in_common_and_finds_what_waited() -> None:
    ages = Ages()
    ages_of(ages, (0.0, 0.0))
    assert not ages.kept_pace
    assert ages.of(sample(2, THEIRS + 0.65), 50.65, CLOCK) == pytest.approx(0.0, abs=1e-6)
    assert ages.of(sample(3, THEIRS + 0.7), 51.5, CLOCK) == pytest.approx(0.8, abs=1e-6)
    assert ages.of(sample(4, THEIRS + 1.6), 51.6, CLOCK) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("apart", [0.02, 0.05, 0.2, 1.0])
@pytest.mark.parametrize("ahead", [0.0, -1000.0, 1000.0])
def test_first_commands_that_waited_together_are_old(apart: float, ahead: float) -> None:
    """Those of a publisher whose link was cut, and which may be dead; we are held up meanwhile."""
    ages = Ages()
    for i in range(100):
        sent, read = CLOCK + i * apart, 100 * apart + 3.0 + i * 0.001 + 0.3 * (i >= 50)
        assert ages.of(sample(i, sent + ahead), read, CLOCK + read) > 0.5, f"sample {i}"
    assert not ages.kept_pace


def test_a_publisher_is_measured_again_once_it_keeps_pace_after_a_burst() -> None:
    burst = [(i * 0.05, 5.0 + i * 0.001) for i in range(100)]
    live = [(5.05 + i * 0.05, 5.05 + i * 0.05) for i in range(30)]
    found = ages_of(Ages(), *burst, *live)
    assert min(found[: len(burst) + 5]) > 0.5
    assert max(found[-10:]) == 0.0


def test_a_single_command_is_new_where_the_clocks_agree() -> None:
    assert Ages().of(sample(1, CLOCK), 50.0, CLOCK + 0.1) == pytest.approx(0.1)
    assert Ages().of(sample(1, CLOCK), 50.0, CLOCK + 3.0) == pytest.approx(3.0)
    assert Ages().of(sample(1, CLOCK), 50.0, CLOCK - 3.0) == pytest.approx(3.0)


def test_a_sender_whose_clock_was_set_is_neither_old_for_ever_nor_new_because_of_that() -> None:
    for clock in (1000.0, THEIRS + 10.0):
        ages = Ages()
        ages_of(ages, (0.0, 0.0), (0.65, 0.65))
        assert ages.kept_pace
        assert ages.of(sample(3, clock), 55.4, 9000.0) == abs(9000.0 - clock)  # it waited for 5 s
        assert ages.of(sample(4, clock + 5.0), 55.41, 9000.0) > 0.5
        assert ages.of(sample(5, clock + 5.66), 56.07, 9000.65) == pytest.approx(0.0)


@pytest.mark.parametrize("wrong", [b"", bytes(32), bytes(34), bytes(16) + b"\x0f" + bytes(16)])
def test_another_attachment_is_none(wrong: bytes) -> None:
    assert rmw.attachment(wrong) is None


@pytest.mark.parametrize(
    "wrong",
    [
        "@ros2_lv/0/a/0/0/NN/%/%/talker",
        "@ros2_lv/0/a/0/x/MP/%/%/talker/%chatter/std_msgs::msg::dds_::String_/RIHS01_0/::,10:,:,:,,",
        f"@ros2_lv/0/a/0/{'9' * 5000}/MP/%/%/talker/%chatter/std_msgs::msg::dds_::String_/RIHS01_0/::,10:,:,:,,",  # noqa: E501
        "@ros2_lv/0/a/0/1/XX/%/%/talker/%chatter/std_msgs::msg::dds_::String_/RIHS01_0/::,10:,:,:,,",
        "@ros2_lv/0/a/0/1/MP/%/%/talker/%**/std_msgs::msg::dds_::String_/RIHS01_0/::,10:,:,:,,",
        "@ros2_lv/0/a/0/1/MP/%/%/talker/%chatter/String/RIHS01_0/::,10:,:,:,,",
        "@ros2_lv/0",
    ],
)
def test_a_token_that_names_no_endpoint_is_none(wrong: str) -> None:
    assert rmw.Form(0).parse(wrong) is None


def test_a_token_is_that_of_the_design() -> None:
    """The example of rmw_zenoh's design.md, its service too."""
    token = (
        "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/10/MP/%/%/talker"
        "/%robot1%chatter/std_msgs::msg::dds_::String_/RIHS01_df/::,10:,:,:,,"
    )
    endpoint = rmw.Form(0).parse(token)
    assert endpoint == rmw.Endpoint(
        "pub",
        "robot1/chatter",
        "std_msgs/msg/String",
        "RIHS01_df",
        "talker",
        "aac3178e146ba6f1fc6e6a4085e77f21",
        10,
    )
    assert rmw.Form(2).token(endpoint, 0) == token
    assert rmw.Form(2).key(endpoint) == "2/robot1/chatter/std_msgs::msg::dds_::String_/RIHS01_df"
