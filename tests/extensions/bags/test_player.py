"""What of a bag is played, where to and when."""

import itertools
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from functools import partial

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holozen.bags import BagError, Channel, Message
from holozen.bags.player import LOOK, PAUSE, STEP, Pace, Plan, Player, meaning, plan
from holozen.transport.graph import Endpoint

A = Channel("a", "", "", "")
MS = 1_000_000  # ns


def messages(*times: int) -> list[Message]:
    """Messages at these ms."""
    return [Message(A, at * MS, b"%d" % at) for at in times]


class Pressed:
    """Keys that are pressed one a look; then nothing for ever."""

    def __init__(self, *keys: str) -> None:
        self.keys, self.looks = list(keys), 0

    def read(self, timeout: float) -> str:
        self.looks += 1
        key = self.keys.pop(0) if self.keys else "wait"
        if key != "wait":
            return key
        time.sleep(timeout)
        return ""


class Played:
    """A player and what it did."""

    def __init__(
        self, *keys: str, rate: float = 1.0, slow: float = 0.0, paused: bool = False
    ) -> None:
        self.done: list[str] = []
        self.slow = slow  # s that it takes to publish
        self.stop, self.keys = threading.Event(), Pressed(*keys)
        hold = partial(self.done.append, "hold")
        self.player = Player(self._publish, hold, self.keys.read, self.stop, rate, paused=paused)
        self.end_after = 10**9

    def _publish(self, message: Message) -> bool:
        self.done.append(message.payload.decode())
        time.sleep(self.slow)
        if len(self.done) >= self.end_after:
            self.stop.set()
        return True


def test_a_terminal_that_does_not_control_the_process_has_no_keys() -> None:
    """As under setsid."""
    leader, terminal = os.openpty()
    code = (
        "import threading\nfrom holozen.bags.player import keys\nwith keys(threading.Event()) "
        "as key:\n print([key(0)])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        stdin=terminal,
        start_new_session=True,
        capture_output=True,
        text=True,
        timeout=60,
    )
    os.close(terminal)
    os.close(leader)
    assert (done.returncode, done.stdout, done.stderr) == (0, "['']\n", "")


@given(st.floats(0.01, 1000), st.integers(0, 2**62), st.floats(0, 1e6), st.integers(0, 10**13))
def test_a_message_is_due_by_its_distance_from_the_origin_and_the_rate(
    rate: float, at: int, now: float, later: int
) -> None:
    pace = Pace(rate)
    pace.jump(at, now)
    assert pace.due(at) == now
    assert pace.due(at + later) == pytest.approx(now + later / 1e9 / rate)
    assert pace.position(now) == at
    assert pace.position(now + 2.0) == pytest.approx(at + 2e9 * rate)


def test_all_messages_are_played_in_order_and_none_before_its_time() -> None:
    played, begun = Played(), time.monotonic()
    assert played.player.play(messages(1000, 1010, 1030, 1030, 1060))
    assert time.monotonic() - begun >= 0.06
    assert played.done == ["1000", "1010", "1030", "1030", "1060"]
    assert (played.player.count, played.player.position) == (5, 1060 * MS)


def noting(times: list[float], now: list[float]) -> Callable[[Message], bool]:
    """Publishes nothing, but notes when."""

    def publish(_: Message) -> bool:
        times.append(now[0])
        return True

    return publish


def test_a_message_from_before_is_played_at_once() -> None:
    played = Played()
    assert played.player.play(messages(5000, 100, 5001))
    assert played.done == ["5000", "100", "5001"]


def test_a_rate_makes_a_long_bag_short() -> None:
    played = Played(rate=1e6)
    assert played.player.play(messages(0, 3_600_000, 7_200_000))
    assert len(played.done) == 3


def test_an_event_ends_it_between_two_messages() -> None:
    played = Played(rate=1e6)
    played.end_after = 3
    assert not played.player.play(messages(*range(100)))
    assert played.done == ["0", "1", "2"]


def test_a_pause_holds_the_robots_and_each_step_plays_one_message() -> None:
    played = Played("", PAUSE, STEP, STEP)
    played.end_after = 4
    assert not played.player.play(messages(0, 3_600_000, 7_200_000, 10_800_000))
    assert played.done == ["0", "hold", "3600000", "7200000"]


def test_one_that_begins_paused_plays_by_steps_until_it_goes_on_from_there() -> None:
    played = Played("wait", STEP, STEP, PAUSE, paused=True)
    begun = time.monotonic()
    assert played.player.play(messages(0, 3_600_000, 3_600_100))
    assert time.monotonic() - begun >= 0.1 + LOOK
    assert played.done == ["0", "3600000", "3600100"]


def test_a_step_without_a_pause_does_nothing() -> None:
    played = Played("", STEP, STEP)
    assert played.player.play(messages(0, 10, 20))
    assert played.done == ["0", "10", "20"]


def test_after_a_pause_it_goes_on_where_it_was() -> None:
    played = Played("", PAUSE, "wait", "wait", PAUSE)
    begun = time.monotonic()
    assert played.player.play(messages(0, 100))
    assert time.monotonic() - begun >= 0.1 + 2 * LOOK
    assert played.done == ["0", "hold", "100"]


def test_after_a_suspension_it_goes_on_from_where_it_was_at_its_pace(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The clock goes on by 60 s while a key is waited for."""
    now, gaps, times = [0.0], list[float](), list[float]()
    monkeypatch.setattr(time, "monotonic", lambda: now[0])

    def wait(timeout: float) -> str:
        now[0] += 60.0 if 0.2 < now[0] < 60.0 else timeout
        return ""

    stop = threading.Event()
    player = Player(noting(times, now), lambda: None, wait, stop, on_gap=gaps.append)
    assert player.play(messages(*range(0, 1000, 100)))
    assert times[:3] == pytest.approx([0.0, 0.1, 0.2], abs=0.001)
    assert gaps == pytest.approx([60.0])
    assert [b - a for a, b in itertools.pairwise(times[3:])] == pytest.approx([0.1] * 6, abs=0.001)


def test_a_suspension_in_a_pause_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    now, gaps, times, pressed = [0.0], list[float](), list[float](), ["", PAUSE, "", PAUSE]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])

    def wait(timeout: float) -> str:
        now[0] += 60.0 if len(pressed) == 2 else min(timeout, 0.01)
        return pressed.pop(0) if pressed else ""

    player = Player(noting(times, now), lambda: None, wait, threading.Event(), on_gap=gaps.append)
    assert player.play(messages(0, 100))
    assert times[1] == pytest.approx(60.1, abs=0.03)
    assert gaps == []


def test_keys_are_looked_at_also_when_every_message_is_late() -> None:
    played = Played(rate=1e6, slow=0.0002)
    assert played.player.play(messages(*range(1000)))
    assert played.keys.looks > 2


def test_space_pauses_and_the_right_arrow_steps() -> None:
    for pressed, expected in [
        (b" ", PAUSE),
        (b"s", STEP),
        (b"\x1b[C", STEP),
        (b"\x1bOC", STEP),
        (b"x", ""),
        (b"\x1b[A", ""),
        (b"", ""),
    ]:
        assert meaning(pressed) == expected


TWIST, ODOMETRY = "geometry_msgs/msg/Twist", "nav_msgs/msg/Odometry"


def channel(key: str, kind: str = "") -> Channel:
    return Channel(key, "application/json", "json", kind)


ODOM, TF, CMD = channel("odom", ODOMETRY), channel("tf"), channel("cmd_vel", TWIST)
SIM = [Endpoint("odom", "pub", ODOMETRY, "sim", "1"), Endpoint("cmd_vel", "sub", TWIST, "sim", "1")]


def keys(made: Plan) -> dict[str, str]:
    return {channel.key: key for channel, key in made.targets.items()}


def test_all_but_commands_is_played_where_no_other_publisher_is() -> None:
    made = plan([ODOM, TF, CMD], [])
    assert keys(made) == {"odom": "odom", "tf": "tf"}
    assert made.left_out == {"cmd_vel": "it moves robots; --commands plays it too"}


def test_a_command_is_known_by_its_name_or_its_type() -> None:
    for command in [
        CMD,
        channel("Fred/cmd_vel"),
        channel("joint_command"),
        channel("drive", TWIST),
        channel("drive", "geometry_msgs/msg/TwistStamped"),
    ]:
        assert plan([command], []).targets == {}
        asked = plan([command], [], commands=True)
        assert asked.commands.keys() == {command.key}


def test_what_is_played_to_a_key_that_moves_a_robot_is_a_command() -> None:
    listener = [Endpoint("wheels", "sub", TWIST, "sim", "1")]
    for endpoints, target in (([], "cmd_vel"), (listener, "wheels")):
        with pytest.raises(BagError, match="it moves robots"):
            plan([TF], endpoints, remap={"tf": target})


def test_a_command_stays_one_under_another_name() -> None:
    with pytest.raises(BagError, match="cmd_vel as old/speed: it moves robots"):
        plan([CMD], [], remap={"cmd_vel": "old/speed"})


def test_a_key_with_a_publisher_is_left_out_and_can_be_played_elsewhere() -> None:
    made = plan([ODOM, TF], SIM)
    assert keys(made) == {"tf": "tf"}
    assert made.left_out == {"odom": "sim publishes it now; --remap odom:=NEW plays it elsewhere"}
    assert keys(plan([ODOM, TF], SIM, remap={"odom": "old/odom"})) == {
        "odom": "old/odom",
        "tf": "tf",
    }


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
    assert keys(plan([ODOM, TF, fred], [], topics=["**/odom"])) == {
        "odom": "odom",
        "Fred/odom": "Fred/odom",
    }


def test_a_key_that_is_not_in_the_bag_is_reported_with_the_recorded_ones() -> None:
    with pytest.raises(BagError, match="there is no 'odm' in the bag; it has odom, tf"):
        plan([ODOM, TF], [], topics=["odm"])
    with pytest.raises(BagError, match="there is no 'odm' in the bag; it has odom, tf"):
        plan([ODOM, TF], [], remap={"odm": "b"})


def test_a_key_of_a_hostile_bag_is_not_published_on() -> None:
    for key in ["*/cmd_vel", "**", "a//b", "", "@holozen/x", "a$*", "a/"]:
        made = plan([channel(key)], [], commands=True)
        assert made.targets == {}
        assert made.left_out == {key: "this is not a key to publish on"}
    assert plan([channel(70_000 * "a")], []).left_out == {
        70_000 * "a": "a key has at most 1000 characters"
    }
