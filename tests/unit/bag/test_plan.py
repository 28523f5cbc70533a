"""What of a bag is played: nothing that moves a robot or speaks in another's name, unless it was asked for."""

import pytest

from holozen.bag.errors import BagError
from holozen.bag.plan import Plan, plan
from holozen.bag.reader import Channel
from holozen.graph import Endpoint

TWIST, ODOMETRY = "geometry_msgs/msg/Twist", "nav_msgs/msg/Odometry"


def channel(key: str, kind: str = "") -> Channel:
    return Channel(key, "application/json", "json", kind)


ODOM, TF, CMD = channel("odom", ODOMETRY), channel("tf"), channel("cmd_vel", TWIST)
SIM = [Endpoint("odom", "pub", ODOMETRY, "sim", "1"), Endpoint("cmd_vel", "sub", TWIST, "sim", "1")]


def keys(made: Plan) -> dict[str, str]:
    return {channel.key: key for channel, key in made.targets.items()}


def test_all_but_commands_is_played_where_nobody_else_is() -> None:
    made = plan([ODOM, TF, CMD], [])
    assert keys(made) == {"odom": "odom", "tf": "tf"}
    assert made.left_out == {"cmd_vel": "it moves robots; --commands plays it too"}


@pytest.mark.parametrize(
    "command",
    [
        CMD,
        channel("Fred/cmd_vel"),
        channel("joint_command"),
        channel("drive", TWIST),
        channel("drive", "geometry_msgs/msg/TwistStamped"),
    ],
)
def test_a_command_is_known_by_its_name_or_its_type(command: Channel) -> None:
    assert plan([command], []).targets == {}
    asked = plan([command], [], commands=True)
    assert asked.commands == {command.key}


def test_what_is_played_to_a_key_that_moves_a_robot_is_a_command() -> None:
    listener = [Endpoint("wheels", "sub", TWIST, "sim", "1")]
    for endpoints, target in (([], "cmd_vel"), (listener, "wheels")):
        with pytest.raises(BagError, match="it moves robots"):
            plan([TF], endpoints, remap={"tf": target})


def test_a_command_stays_one_under_another_name() -> None:
    with pytest.raises(BagError, match="cmd_vel as old/speed: it moves robots"):
        plan([CMD], [], remap={"cmd_vel": "old/speed"})


def test_a_key_that_somebody_publishes_is_left_out_and_can_be_played_elsewhere() -> None:
    made = plan([ODOM, TF], SIM)
    assert keys(made) == {"tf": "tf"}
    assert made.left_out == {"odom": "sim publishes it now; --remap odom:=NEW plays it elsewhere"}
    assert keys(plan([ODOM, TF], SIM, remap={"odom": "old/odom"})) == {"odom": "old/odom", "tf": "tf"}


def test_what_was_asked_for_by_name_and_must_not_be_played_is_an_error() -> None:
    with pytest.raises(BagError, match="odom: sim publishes it now"):
        plan([ODOM, TF], SIM, topics=["odom"])
    with pytest.raises(BagError, match="cmd_vel: it moves robots; --commands"):
        plan([ODOM, CMD], [], topics=["cmd_vel"])
    assert keys(plan([ODOM, TF, CMD], SIM, topics=["*"])) == {"tf": "tf"}


def test_commands_may_be_played_beside_other_sources() -> None:
    """The sim decides among them, by priority."""
    teleop = [*SIM, Endpoint("cmd_vel", "pub", TWIST, "teleop", "2")]
    assert keys(plan([CMD], teleop, commands=True)) == {"cmd_vel": "cmd_vel"}


def test_topics_choose_by_key_expression() -> None:
    fred = channel("Fred/odom")
    assert keys(plan([ODOM, TF, fred], [], topics=["**/odom"])) == {"odom": "odom", "Fred/odom": "Fred/odom"}


@pytest.mark.parametrize("wrong", [{"topics": ["odm"]}, {"remap": {"odm": "b"}}])
def test_a_key_that_is_not_in_the_bag_is_told_with_those_that_are(wrong: dict) -> None:  # type: ignore[type-arg]
    with pytest.raises(BagError, match="there is no 'odm' in the bag; there is odom, tf"):
        plan([ODOM, TF], [], **wrong)


@pytest.mark.parametrize("key", ["*/cmd_vel", "**", "a//b", "", "@holozen/x", "a$*", "a/"])
def test_a_key_of_a_hostile_bag_is_not_published_on(key: str) -> None:
    made = plan([channel(key)], [], commands=True)
    assert made.targets == {}
    assert made.left_out == {key: "this is no key to publish on"}
