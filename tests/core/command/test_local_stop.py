"""A stop of this machine needs no network: only the socket of whoever serves the robot."""

import os
import socket
import stat
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from holozen.command import local_stop
from holozen.command.local_stop import HANGS, TURNS, LocalStop, LocalStops, Served
from holozen.command.outcome import UNKNOWN_CALLER
from holozen.testing import wait_for

Make = Callable[..., LocalStops]


@pytest.fixture(params=["short", "long"])
def make(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Iterator[Make]:
    """Makes servers below a folder of the test, in a path also longer than a socket's address may
    be.
    """
    monkeypatch.setenv(
        "HOLOZEN_STATE", str(tmp_path / ("x" * 100 if request.param == "long" else "x"))
    )
    made: list[LocalStops] = []

    def make(*robots: str, network: str = "here", stands: bool = True, **more: Any) -> LocalStops:
        served = [Served(robot, robot or "hb_bot") for robot in robots]
        write = more.get("write", lambda robot, by: "")
        made.append(
            LocalStops("1a", [network, "too"], lambda: served, write, stands=stands, reporter="sim")
        )
        return made[-1]

    yield make
    for one in made:
        one.close()


def stop_here(networks: list[str], robots: list[str], by: str) -> list[LocalStop]:
    """All answers, for which a busy machine may take long."""
    with local_stop.stop_here(networks, robots, by) as answers:
        return answers.read(60.0)


def obey(server: LocalStops, orders: list[tuple[list[str], str]], end: threading.Event) -> None:
    while not end.wait(0.001):
        for order in server.take():
            orders.append(([one.robot for one in order.robots], order.by))
            order.message = "the disk is full"


def test_each_process_stops_its_robots_in_this_network_and_says_what_came_of_it(
    make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(local_stop, "HELD_UP", 60.0)
    servers = make("Fred", "Bob"), make(""), make("Fred", network="elsewhere")
    end, orders = threading.Event(), [list[tuple[list[str], str]]() for _ in servers]
    loops = [
        threading.Thread(target=obey, args=(server, seen, end))
        for server, seen in zip(servers, orders, strict=True)
    ]
    for loop in loops:
        loop.start()
    try:
        assert sorted(stop_here(["here"], ["Fred"], "Ann")) == [
            LocalStop("Fred", "Fred", "1a", True, "the disk is full")
        ]
        assert [one.robot for one in stop_here(["here"], ["hb_bot"], "Ann")] == [""]
        assert sorted(one.robot for one in stop_here(["here", "far"], [], "Ann")) == [
            "",
            "Bob",
            "Fred",
        ]
        assert stop_here(["far"], [], "Ann") == []
    finally:
        end.set()
        for loop in loops:
            loop.join()
    assert orders == [
        [(["Fred"], "Ann"), (["Fred", "Bob"], "Ann")],
        [([""], "Ann"), ([""], "Ann")],
        [],
    ]


def test_a_process_that_hangs_is_stopped_all_the_same_and_keeps_the_stop(make: Make) -> None:
    written = list[tuple[str, str]]()
    hung = make("Fred", write=lambda robot, by: written.append((robot, by)))
    turning = make("Kiwi", stands=False)
    assert sorted(stop_here(["here"], [], "Ann")) == [
        LocalStop("Fred", "Fred", "1a", True, HANGS),
        LocalStop("Kiwi", "Kiwi", "1a", False, TURNS),
    ]
    assert written == [("Fred", "Ann")]
    # once they go on
    assert [order.by for server in (hung, turning) for order in server.take()] == ["Ann", "Ann"]


def test_a_stop_that_is_obeyed_while_it_is_written_is_confirmed(make: Make) -> None:
    one: LocalStops = make("Kiwi", stands=False, write=lambda _robot, _by: [*one.take()])
    assert stop_here(["here"], [], "Ann") == [LocalStop("Kiwi", "Kiwi", "1a", True, "")]


def test_more_answers_than_a_socket_holds_come_all_the_same(
    make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A caller that is held up reads none until all have been written."""
    monkeypatch.setattr(local_stop, "HELD_UP", 0.0)
    monkeypatch.setattr(local_stop, "ATTEMPTS", 10_000)
    names, written = [f"bot{number:02}" for number in range(30)], list[str]()
    for name in names:
        make(name, write=lambda robot, _by: written.append(robot))
    with local_stop.stop_here(["here"], [], "Ann") as answers:
        wait_for(lambda: sorted(written) == names)
        assert sorted(one.robot for one in answers.read(30.0)) == names


def test_a_stop_by_nobody_is_kept_as_a_stop(make: Make) -> None:
    written = list[str]()
    make("Fred", write=lambda _robot, by: written.append(by))
    stop_here(["here"], [], "")
    assert written == [UNKNOWN_CALLER]


def test_nobody_else_can_reach_the_socket_and_none_is_left_behind(
    make: Make, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    one = make("Fred")
    (path,) = (folder := Path(os.environ["HOLOZEN_STATE"], "local")).iterdir()
    assert [stat.S_IMODE(each.stat().st_mode) for each in (folder, path)] == [0o700, 0o600]
    for dead in (f"1-2-{path.stem.split('-')[2]}.stop", "1-2.reply"):
        killed = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        with killed, monkeypatch.context() as there:
            there.chdir(folder)
            killed.bind(dead)  # and nobody removes it
            os.utime(dead, (0, 0))
    stop_here(["here"], [], "Ann")
    one.close()
    assert [*folder.iterdir()] == []
    folder.chmod(0o777)
    make("Fred").close()
    assert stop_here(["here"], [], "Ann") == []
    assert capfd.readouterr().err.count("it is not a folder of yours with mode 0700") == 2
