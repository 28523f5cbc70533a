"""What the doctor concludes from ports, nodes, clocks and commands."""

import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from holozen.doctor.diagnosis import (
    ERROR,
    OK,
    WARNING,
    Peer,
    ask_peers,
    clocks,
    commands,
    duplicates,
    open_ports,
    packages,
    read_peer,
)
from holozen.doctor.diagnosis import versions as versions_of
from holozen.messages import CommandSource, CommandStatus, Odometry, TFMessage, Twist
from holozen.transport.graph import Endpoint

ABOUT = {"node": "sim", "version": "0.1.0", "host": "there", "pid": 7, "time": 102.0}


def peer(
    session: str = "abc",
    offset: float = 0.0,
    error: float = 0.001,
    host: str = "there",
    version: str = "1",
) -> Peer:
    return Peer(session, "sim", version, host, 7, offset, error)


def test_in_this_environment_no_package_is_missing() -> None:
    assert [finding.level for finding in packages()] == [OK, OK, OK]


def test_what_scripts_venv_does_not_install_is_not_promised_of_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    lock = (Path(__file__).parents[3] / "requirements.lock").read_text()
    monkeypatch.setattr("holozen.doctor.diagnosis.version", lambda _: "")
    _, engine, *missing, optional = packages()
    assert (engine.level, engine.text.startswith("the sim runs on ")) == (OK, True)
    assert len(missing) > 5
    assert (optional.level, optional.text.partition(":")[0]) == (OK, "optional"), (
        "nobody asked for these"
    )
    assert "`holozen bag plot`" in optional.text and optional.fix.endswith(
        " install matplotlib mujoco-core"
    )
    for finding in missing:
        name = finding.text.partition(" ")[0]
        assert ("scripts/venv" in finding.fix) == (f"{name}==" in lock), finding


def test_a_clock_is_measured_by_half_of_the_round_trip() -> None:
    found = read_peer("@holozen/abc/about", json.dumps(ABOUT).encode(), before=100.0, now=101.0)
    assert found == Peer("abc", "sim", "0.1.0", "there", 7, offset=1.5, error=0.5)
    for payload in [b"", b"{}", b"[]", b"\xff", b'{"time": "x"}', b"[" * 100_000, b"null"]:
        assert read_peer("@holozen/abc/about", payload, 0, 1) is None
    for name in ("pid", "time"):
        for number in (math.nan, math.inf):
            assert (
                read_peer("@holozen/abc/about", json.dumps(ABOUT | {name: number}).encode(), 0, 1)
                is None
            )


def test_the_best_measure_of_the_clock_of_another_machine_is_judged_within_its_error() -> None:
    for offset, error, level in [
        (0.01, 0.001, OK),
        (-0.2, 0.01, WARNING),
        (-2.0, 0.1, ERROR),
        (0.6, 0.2, WARNING),
    ]:
        worse, ours = peer(offset=9, error=0.5), peer(offset=9, host="here")
        (finding,) = clocks([worse, peer(offset=offset, error=error), ours], here="here")
        assert finding.level == level
        text = f"the clock of there is {offset:+.3f} s from ours (give or take {error:.3f} s)"
        assert finding.text.startswith(text)


def test_nodes_of_other_versions_and_nodes_that_do_not_answer_are_named() -> None:
    nodes = [Endpoint("", "node", "", "sim", session) for session in ("same", "other", "mute")]
    peers = {"same": peer("same"), "other": peer("other", version="0.0.9")}
    other, mute, same = versions_of([nodes[1], nodes[2], nodes[0]], peers, ours="1")
    assert (other.level, other.text) == (
        WARNING,
        "sim (pid 7 on there) has holozen 0.0.9, this is 1",
    )
    assert (mute.level, "does not answer" in mute.text) == (WARNING, True)
    assert (same.level, same.text) == (OK, "1 of this version: sim (pid 7 on there)")


def test_a_node_that_listens_beyond_loopback_is_a_warning() -> None:
    payload = json.dumps(ABOUT | {"exposed": ["tcp/0.0.0.0:7447"]}).encode()
    exposed = read_peer("@holozen/abc/about", payload, 100.0, 100.2)
    assert exposed is not None
    (finding,) = open_ports([exposed, peer()])
    assert (finding.level, finding.check) == (WARNING, "network")
    assert finding.text.startswith(
        "sim (pid 7 on there) listens at tcp/0.0.0.0:7447, and asks for no password or "
        "certificate: whoever can reach it can drive"
    )


def test_many_may_command_and_read_but_one_publishes_and_serves() -> None:
    rows = [
        Endpoint(key, kind, ros, "sim", session)
        for session in ("a", "b")
        for key, kind, ros in (
            ("cmd", "pub", Twist.ROS),
            ("odom", "sub", Odometry.ROS),
            ("tf", "pub", TFMessage.ROS),
        )
    ]
    assert list(duplicates(rows, {})) == []
    keys = ("odom", "a/odom", "b/odom", "c/odom")
    rows = [
        Endpoint(key, "pub", Odometry.ROS, "sim", session) for session in ("a", "b") for key in keys
    ]
    rows += [Endpoint("stop", "srv", "t", "sim", session) for session in ("a", "b")]
    (finding,) = duplicates(rows, {"b": peer("b")})
    text = "sim (a) and sim (pid 7 on there) share a/odom, b/odom, c/odom and 2 more keys"
    assert (finding.level, finding.text) == (ERROR, f"{text}; only one node should have each")


def source(name: str, priority: str, rate: float = 20.0) -> CommandSource:
    return CommandSource(name, priority, rate=rate)


def test_sources_that_command_at_once_are_an_error_if_none_takes_precedence() -> None:
    for sources, level in [
        ([source("a", "DATA"), source("b", "DATA")], ERROR),
        ([source("a", "DATA"), source("b", "DATA_LOW"), source("c", "DATA_LOW")], WARNING),
        ([source("teleop", "INTERACTIVE_HIGH"), source("b", "DATA")], WARNING),
        ([source("a", "DATA"), source("b", "DATA", rate=1.0)], None),
        ([source("a", "DATA")], None),
        ([], OK),
    ]:
        found = list(commands("cmd_vel", CommandStatus(sources=sources)))
        assert [finding.level for finding in found] == ([level] if level else [])


def test_what_keeps_a_robot_that_nothing_commands_is_reported() -> None:
    (finding,) = commands("Fred/cmd_vel", CommandStatus(held=True), ["controller"])
    assert (finding.level, finding.fix) == (
        WARNING,
        "holozen controller Fred --resume, or r in the teleop",
    )
    overruled = CommandSource("script@1", "DATA", held=True)
    (finding,) = commands("cmd_vel", CommandStatus(held=True, sources=[overruled]))
    assert finding.level == WARNING
    (finding,) = commands("cmd_vel", CommandStatus(), ["teleop", "controller"])
    assert (
        "now; controller, teleop could; if the controller is held: holozen controller --resume"
        in finding.text
    )


def test_a_node_whose_tokens_are_known_before_it_can_answer_is_asked_again() -> None:
    class NewLink:
        """Its nodes can answer from the fifth query on."""

        queries = 0

        def ask_all(self, _key: str, _timeout: float) -> list[SimpleNamespace]:
            self.queries += 1
            reply = SimpleNamespace(key="@holozen/abc/about", payload=json.dumps(ABOUT).encode())
            return [reply] if self.queries >= 5 else []

    bus: Any = NewLink()
    assert ask_peers(bus, ["abc"]).keys() == {"abc"}


def test_a_teleop_that_has_ended_and_a_robot_without_a_controller_are_no_warning() -> None:
    (finding,) = commands("cmd_vel", CommandStatus(held=True))
    assert (finding.level, finding.fix) == (OK, "")
    assert "a controller after holozen controller --resume" in finding.text


def test_a_stopped_robot_is_reported_with_what_releases_it() -> None:
    finding, _ = commands("Fred/cmd_vel", CommandStatus(stopped="stop@1"))
    assert (finding.check, finding.level, finding.fix) == (
        "Fred/cmd_vel",
        WARNING,
        "holozen release Fred",
    )
