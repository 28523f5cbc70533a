"""What peers tell of themselves, judged: clocks, versions, and two that share a key."""

import json

import pytest

from holozen.doctor.finding import ERROR, OK, WARNING
from holozen.doctor.peers import Peer, clocks, read, twins, versions
from holozen.doctor.traffic import judged
from holozen.graph import Endpoint
from holozen.messages import CommandSource, CommandStatus, Odometry, TFMessage, Twist

KEY = "@holozen/abc/about"
TOLD = {"node": "sim", "version": "0.1.0", "host": "there", "pid": 7, "time": 102.0}


def peer(
    session: str = "abc", offset: float = 0.0, error: float = 0.001, host: str = "there", version: str = "1"
) -> Peer:
    return Peer(session, "sim", version, host, 7, offset, error)


def test_a_clock_is_measured_by_half_of_the_round_trip() -> None:
    found = read(KEY, json.dumps(TOLD).encode(), before=100.0, now=101.0)
    assert found == Peer("abc", "sim", "0.1.0", "there", 7, offset=1.5, error=0.5)


@pytest.mark.parametrize("payload", [b"", b"{}", b"[]", b"\xff", b'{"time": "x"}', b"[" * 100_000, b"null"])
def test_a_reply_that_is_none_is_left_out(payload: bytes) -> None:
    assert read(KEY, payload, 0, 1) is None


@pytest.mark.parametrize(
    ("offset", "error", "level"), [(0.01, 0.001, OK), (-0.2, 0.01, WARNING), (-2.0, 0.1, ERROR), (0.6, 0.2, WARNING)]
)
def test_a_clock_of_another_machine_is_judged_beyond_what_the_measure_may_err(
    offset: float, error: float, level: str
) -> None:
    (finding,) = clocks([peer(offset=offset, error=error)], here="here")
    assert finding.level == level
    assert finding.text.startswith(f"that of there is {offset:+.3f} s from ours (give or take {error:.3f} s)")


def test_the_best_measure_of_a_machine_counts_and_ours_needs_none() -> None:
    all_of_them = [peer(offset=9, error=0.5), peer(offset=0.0, error=0.001), peer(offset=9, host="here")]
    (finding,) = clocks(all_of_them, here="here")
    assert finding.level == OK


def test_other_versions_and_those_who_do_not_answer_are_told() -> None:
    nodes = [Endpoint("", "node", "", "sim", session) for session in ("same", "other", "mute")]
    peers = {"same": peer("same"), "other": peer("other", version="0.0.9")}
    other, mute, same = sorted(versions(nodes, peers, ours="1"), key=lambda finding: finding.text, reverse=True)
    assert (other.level, other.text) == (WARNING, "sim (pid 7 on there) is holozen 0.0.9, this is 1")
    assert (mute.level, "does not answer" in mute.text) == (WARNING, True)
    assert (same.level, same.text) == (OK, "1 of this version: sim (pid 7 on there)")


def test_many_may_command_and_read_but_one_publishes_and_serves() -> None:
    rows = [
        Endpoint(key, kind, ros, "sim", session)
        for session in ("a", "b")
        for key, kind, ros in (("cmd", "pub", Twist.ROS), ("odom", "sub", Odometry.ROS), ("tf", "pub", TFMessage.ROS))
    ]
    assert list(twins(rows, {})) == []
    keys = ("odom", "a/odom", "b/odom", "c/odom")
    rows = [Endpoint(key, "pub", Odometry.ROS, "sim", session) for session in ("a", "b") for key in keys]
    rows += [Endpoint("stop", "srv", "t", "sim", session) for session in ("a", "b")]
    (finding,) = twins(rows, {"b": peer("b")})
    told = "sim (a) and sim (pid 7 on there) share a/odom, b/odom, c/odom and 2 more keys, which one alone should have"
    assert (finding.level, finding.text) == (ERROR, told)


def source(name: str, priority: str, rate: float = 20.0) -> CommandSource:
    return CommandSource(name, priority, rate)


@pytest.mark.parametrize(
    ("sources", "level"),
    [
        ([source("a", "DATA"), source("b", "DATA")], ERROR),
        ([source("a", "DATA"), source("b", "DATA_LOW"), source("c", "DATA_LOW")], WARNING),
        ([source("teleop", "INTERACTIVE_HIGH"), source("b", "DATA")], WARNING),
        ([source("a", "DATA"), source("b", "DATA", rate=1.0)], None),
        ([source("a", "DATA")], None),
        ([], None),
    ],
)
def test_sources_that_command_at_once_are_an_error_if_neither_wins(
    sources: list[CommandSource], level: str | None
) -> None:
    found = list(judged("cmd_vel", CommandStatus(sources=sources)))
    assert [finding.level for finding in found] == ([level] if level else [])


def test_a_stop_is_told_with_what_frees_the_robot() -> None:
    (finding,) = judged("Fred/cmd_vel", CommandStatus(stopped="stop@1"))
    assert (finding.check, finding.level, finding.mend) == ("Fred/cmd_vel", WARNING, "holozen release Fred")
