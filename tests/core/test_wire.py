"""The table of the wire is consistent, and only names that Zenoh takes literally name a robot."""

import string

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from holozen import wire
from holozen.messages import (
    Header,
    JointState,
    Odometry,
    PoseStamped,
    Time,
    Twist,
    TwistStamped,
    Vector3,
    Wrench,
)
from holozen.transport.samples import PRIORITIES

LETTERS = string.ascii_letters


def test_a_letter_then_letters_digits_underscores_and_dashes_name_a_robot() -> None:
    for name in ["F", "Fred", "hb_bot", "robot-2", "x" * 64, "Z9_-"]:
        assert wire.robot_name(name) == name


def test_any_other_name_is_refused_and_quoted_in_one_line() -> None:
    rows = [
        "",
        "*",
        "**",
        "$*",
        "a/b",
        "a/",
        "/a",
        "Fred\n",
        "\nFred",
        "Fr ed",
        "9lives",
        "_x",
        "-x",
        "x" * 65,
        "é",
        "a.b",
        "a?b",
        "a#b",
        "@a",
        "\u0661",
        "F\0",
    ]
    for name in rows:
        with pytest.raises(ValueError) as error:
            wire.robot_name(name)
        assert repr(name) in str(error.value)
        assert "\n" not in str(error.value)
        assert "such as Fred" in str(error.value)


@given(st.text(LETTERS + string.digits + "_-*$/@?#\n .", min_size=1, max_size=70))
def test_a_robot_that_may_have_its_name_is_reached_by_no_other_key(name: str) -> None:
    try:
        key = wire.key_for("cmd_vel", wire.robot_name(name))
    except ValueError:
        return
    assert not zenoh.KeyExpr(key).includes(zenoh.KeyExpr("*/cmd_vel"))
    assert zenoh.KeyExpr("*/cmd_vel").includes(zenoh.KeyExpr(key))


def test_the_robot_at_the_root_has_the_bare_key_and_a_named_one_its_own() -> None:
    assert wire.key_for("cmd_vel") == "cmd_vel"
    assert wire.key_for("cmd_vel", "Fred") == "Fred/cmd_vel"


def test_a_row_is_found_with_and_without_a_robots_name() -> None:
    assert wire.topic("odom") is wire.topic("Fred/odom") is wire.TOPICS[1]
    assert wire.service("next_goal") is wire.service("Fred/next_goal") is wire.SERVICES[0]
    assert wire.topic("next_goal") is None
    assert wire.service("odom") is None
    assert wire.topic("modo") is None


def test_commands_refuse_unknown_fields_and_telemetry_ignores_them() -> None:
    strict = {row.key for row in wire.TOPICS if wire.is_command(f"Fred/{row.key}", row.type_names)}
    assert strict == {"cmd_vel", "joint_command", "gazebo_ros_force", "goal_pose"}
    assert wire.is_command("drive", (Twist.ROS,))  # a plugin may name the key of its commands
    assert not wire.is_command("ground_truth", (Odometry.ROS,))


def test_a_stop_is_for_what_was_moved_and_what_ends_by_itself_has_none() -> None:
    stopped = JointState(name=["a", "b"], velocity=[0.0, 0.0])
    for command, stop in [
        (Twist.planar(1.0), Twist()),
        (TwistStamped(Header(Time(7), "base_link"), Twist.planar(1.0)), TwistStamped()),
        (Wrench(force=Vector3(1.0)), Wrench()),
        (JointState(name=["a", "b"], velocity=[1.0, 0.0]), stopped),
        (JointState(name=["a", "b"], effort=[1.0, 2.0]), stopped),
        (JointState(name=["a", "b"], position=[1.0, 2.0]), None),
        (PoseStamped(), None),
    ]:
        fields = wire.stop(command, command.ROS)
        assert (None if fields is None else type(command)(**fields)) == stop


def test_each_key_is_in_the_table_once() -> None:
    keys = [row.key for row in (*wire.TOPICS, *wire.SERVICES)]
    assert len(keys) == len(set(keys))


def test_each_topic_has_a_type_an_end_and_a_rate_that_outruns_its_silence() -> None:
    for row in wire.TOPICS:
        assert [kind.ROS for kind in row.types] == [*row.type_names]
        assert row.writers or row.readers
        assert not set(row.writers) & set(row.readers)
        # one lost message is no silence
        assert row.rate * row.silence > 2 or row.rate == row.silence == 0


def test_the_rules_name_their_own_numbers() -> None:
    for key in ("cmd_vel", "odom"):
        row = wire.topic(key)
        assert row is not None
        assert row.rule.startswith(f"{row.silence:g} s")
    assert wire.TOPICS[0].silence == wire.COMMAND_SILENCE == 0.5


def test_a_person_beats_a_script_and_a_script_the_controller() -> None:
    ranks = [
        PRIORITIES.index(name)
        for name in (wire.PRIORITY_OF["teleop"], "DATA", wire.PRIORITY_OF["controller"])
    ]
    assert ranks == sorted(set(ranks))
    assert tuple(wire.PRIORITY_OF) == wire.TOPICS[0].writers


def test_the_priorities_are_counted_as_zenoh_counts_them() -> None:
    assert [int(getattr(zenoh.Priority, name)) for name in PRIORITIES] == list(range(1, 8))
