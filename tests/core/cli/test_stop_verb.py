"""`holozen stop` and `holozen release` reach every robot there is, and report only what was
confirmed.
"""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from holozen import cli
from holozen.bus import Bus
from holozen.cli import stop as stop_module
from holozen.command import local_stop
from holozen.command.local_stop import HANGS, TURNS, LocalStops, Served
from holozen.messages import CommandStatus, TriggerReply, TriggerRequest
from holozen.testing import Process, Wire, wait_for
from holozen.testing.process import PATIENCE
from holozen.testing.wire import command
from holozen.transport.connection import GROUP
from holozen.transport.errors import BusError, ServiceError
from holozen.transport.services import Server
from holozen.wire import key_for

Run = Callable[..., tuple[int, str, str]]
LONG = ("--timeout", f"{0.8 * PATIENCE:g}")


class Robots:
    """Robots that only remember that they were called; `refusals` are their replies before they
    obey.
    """

    def __init__(self, wire: Wire) -> None:
        self.wire, self.refusals, self.message = wire, list[str](), "whatever"
        self.called = set[tuple[str, str]]()  # keys, and the sims whose they are
        self.first_called = threading.Event()
        self._servers = list[Server]()

    def add(
        self, *keys: str, wire: str = "json", hangs: bool = False, bus: Bus | None = None
    ) -> Bus:
        """A sim of its own, or that of a `bus`, that serves these keys, or holds them and does not
        answer.
        """
        bus = bus or self.wire.bus("sim", wire=wire)
        for key in keys:
            server = bus.serve(key, TriggerRequest, TriggerReply, self._answer(key, bus.id))
            self._servers.append(server)
            if not hangs:
                server.start()
        return bus

    def _answer(self, key: str, sim: str) -> Callable[[TriggerRequest], TriggerReply]:
        def answer(_request: TriggerRequest) -> TriggerReply:
            if self.refusals:
                raise ServiceError(self.refusals.pop())
            self.called.add((key, sim))
            self.first_called.set()
            return TriggerReply(True, self.message)

        return answer

    @contextmanager
    def joined_later(self, key: str, patch: pytest.MonkeyPatch) -> Iterator[None]:
        """A sim with this key joins once another one was called. All count as found soon after it
        was called too, however late that is on a busy machine.
        """
        bus = self.wire.bus("late")  # a busy machine takes long to open one
        patch.setattr(stop_module, "QUIET", PATIENCE)

        def join() -> None:
            self.first_called.wait()
            self.add(key, bus=bus)
            wait_for(lambda: (key, bus.id) in self.called, what="a call of the late one")
            patch.setattr(stop_module, "QUIET", 0.5)

        late = threading.Thread(target=join)
        late.start()
        try:
            yield
        finally:
            self.first_called.set()
            late.join()

    def drop_tokens(self) -> None:
        """Go on serving, but announce nothing."""
        for server in self._servers:
            server.ends.pop().undeclare()

    def keys(self) -> set[str]:
        return {key for key, _ in self.called}


@contextmanager
def repeated(bus: Bus, status: CommandStatus, after: float = 0.0) -> Iterator[None]:
    """The status of the robot at the root, published all the time `after` so many seconds."""
    publisher, end = bus.publisher("cmd_vel_status", CommandStatus), threading.Event()

    def publish() -> None:
        end.wait(after)
        while not end.wait(0.02):
            publisher.put(status)

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        yield
    finally:
        end.set()
        thread.join()


@pytest.fixture
def run(run: Run) -> Run:
    """The verb waits long for what a busy machine does late, unless a test says how long."""
    return lambda *words: run(*words, *([] if "--timeout" in words else LONG))


@pytest.fixture
def robots(wire: Wire) -> Robots:
    return Robots(wire)


def test_without_a_name_all_robots_are_stopped_whatever_their_sims_speak(
    robots: Robots, run: Run
) -> None:
    robots.add("stop", "Fred/stop", "Fred/release", "Fred/resume", "next_goal")
    robots.add("Ann/stop")
    robots.add("lab/Bob/stop", wire="cdr")
    code, out, err = run("stop")
    assert (code, err) == (0, "")
    names = ("Ann", "Fred", "lab/Bob", "the robot at the root")
    assert sorted(out.splitlines()) == [f"{name} is stopped" for name in names]
    assert robots.keys() == {"Ann/stop", "Fred/stop", "lab/Bob/stop", "stop"}


def test_all_are_stopped_although_the_reader_has_gone(robots: Robots) -> None:
    robots.add("Ann/stop", "Bob/stop")
    robots.refusals.append("not yet")  # so that the other one is confirmed, and printed, before it
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        command("stop", *LONG, *robots.wire.flags),
        stdout=writer,
        stderr=subprocess.PIPE,
        timeout=60,
    )
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, b"")
    assert robots.keys() == {"Ann/stop", "Bob/stop"}


def test_one_that_is_met_later_than_others_is_stopped_too(
    robots: Robots, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    robots.add("Ann/stop")
    with robots.joined_later("Fred/stop", monkeypatch):
        assert run("stop")[0] == 0
    assert robots.keys() == {"Ann/stop", "Fred/stop"}


def test_one_that_is_named_and_met_later_is_stopped(
    robots: Robots, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stop_module, "NOTICE", PATIENCE)
    robots.add("Ann/stop")
    bus = robots.wire.bus("late")  # a busy machine takes long to open one
    late = threading.Timer(0.6, robots.add, ["Fred/stop"], {"bus": bus})
    late.start()
    assert run("stop", "Fred")[0] == 0
    late.join()
    assert robots.keys() == {"Fred/stop"}


@pytest.mark.parametrize(
    ("names", "place"), [(["Fred"], "Fred"), ([], "")], ids=["named", "at the root"]
)
def test_a_robot_whose_token_is_lost_among_forged_ones_is_stopped(
    robots: Robots, run: Run, names: list[str], place: str
) -> None:
    key = key_for("stop", place)
    robots.add(key)
    robots.drop_tokens()
    foreign = robots.wire.bus("foreign")
    _forged = [
        foreign.announce("srv", TriggerReply.ROS, f"forged{number}/stop") for number in range(100)
    ]
    line = f"{place or 'the robot at the root'} is stopped"
    # On a busy machine it may be met too late.
    wait_for(lambda: line in run("stop", *names, "--timeout", "1")[1].splitlines())
    assert robots.keys() == {key}


def test_it_looks_for_robots_until_its_timeout(
    robots: Robots, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Among thousands of tokens, those of robots come late."""
    for limit in ("NOTICE", "QUIET"):
        monkeypatch.setattr(stop_module, limit, 0.1)
    robots.add("next_goal")
    late = threading.Timer(0.6, robots.add, ["Fred/stop"])
    late.start()
    assert run("stop", "--timeout", "20")[:2] == (0, "Fred is stopped\n")
    late.join()


def test_release_reports_the_sims_reply(robots: Robots, run: Run) -> None:
    robots.add("Fred/stop", "Fred/release")
    assert run("release") == (0, "Fred is released: whatever\n", "")
    robots.message = "the robot was not stopped"
    assert run("release") == (0, "Fred was not stopped\n", "")
    assert robots.keys() == {"Fred/release"}


def test_as_json_it_is_one_object_a_robot(robots: Robots, run: Run) -> None:
    robots.add("stop", "Fred/stop")
    code, out, err = run("stop", "--json")
    rows = sorted((json.loads(line) for line in out.splitlines()), key=lambda row: row["robot"])
    reported = [
        {"robot": name, "verb": "stop", "confirmed": True, "message": "whatever"}
        for name in ("", "Fred")
    ]
    assert (code, rows, err) == (0, reported, "")


def test_those_that_are_named_are_stopped_and_no_other_and_one_at_the_root_by_its_name(
    robots: Robots, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stop_module, "NAMING", PATIENCE)
    bus = robots.add("stop", "Fred/stop", "Ann/stop", "Bob/stop")
    with repeated(bus, CommandStatus(name="hb_bot")):
        assert run("stop", "Fred", "/Ann")[::2] == (0, "")
        assert robots.keys() == {"Ann/stop", "Fred/stop"}
        robots.called.clear()
        unknown = "holozen stop: there is no robot 'bot'; there are: hb_bot, Ann, Bob, Fred\n"
        assert run("stop", "hb_bot", "bot") == (1, "hb_bot is stopped\n", unknown)
        assert robots.keys() == {"stop"}
        names = ("Ann", "Bob", "Fred", "hb_bot")
        assert sorted(run("stop")[1].splitlines()) == [f"{name} is stopped" for name in names]
        robots.add("hb_bot/stop")
        robots.called.clear()
        code, out, err = run("stop", "hb_bot", "--json")
        assert (code, err) == (0, "")
        assert [json.loads(line)["robot"] for line in out.splitlines()] == ["hb_bot", "hb_bot"]
        assert robots.keys() == {"stop", "hb_bot/stop"}, "both have the name"


def test_the_robot_at_the_root_is_waited_for_where_its_name_comes_late(
    robots: Robots, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stop_module, "QUIET", 0.0)
    monkeypatch.setattr(stop_module, "NOTICE", PATIENCE)
    with repeated(robots.add("stop", "lab/Fred/stop"), CommandStatus(name="hb_bot"), after=1.0):
        assert run("stop", "hb_bot") == (0, "hb_bot is stopped\n", "")
    assert robots.keys() == {"stop"}


def test_one_that_does_not_answer_holds_up_no_other_and_is_reported(
    robots: Robots, run: Run
) -> None:
    robots.add("Ann/stop", hangs=True)
    robots.add("Fred/stop")

    def is_reported() -> bool:
        """False where a busy machine met one of them too late."""
        code, out, err = run("stop", "--timeout", "0.8")
        assert code == 1 and "Ann" not in out
        return (out, err) == (
            "Fred is stopped\n",
            "holozen stop: Ann did not confirm within 0.8 s; it may move\n",
        )

    def is_reported_as_json() -> bool:
        code, out, _ = run("stop", "Ann", "--timeout", "0.8", "--json")
        assert code == 1 and '"confirmed": true' not in out
        return '"confirmed": false' in out

    wait_for(is_reported)
    wait_for(is_reported_as_json)


def test_where_two_sims_serve_one_robot_both_have_to_confirm(robots: Robots, run: Run) -> None:
    robots.add("Fred/stop")
    robots.add("Fred/stop")
    assert run("stop") == (0, "Fred is stopped\n", "")
    assert len(robots.called) >= 2  # on a busy machine they are asked again
    robots.add("Fred/stop", hangs=True)
    # On a busy machine it may be met too late.
    wait_for(lambda: run("stop", "--timeout", "0.8")[:2] == (1, ""), 30)


@pytest.mark.parametrize("names", [(), ("Fred",)], ids=["all", "named"])
def test_a_sim_that_is_met_after_another_confirmed_the_same_robot_is_asked_too(
    robots: Robots, run: Run, names: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    robots.add("Fred/stop")
    with robots.joined_later("Fred/stop", monkeypatch):
        assert run("stop", *names) == (0, "Fred is stopped\n", "")
    assert len(robots.called) == 2


def test_a_robot_that_refuses_is_asked_again(robots: Robots, run: Run) -> None:
    robots.refusals += ["not now", "not yet"]
    robots.add("Fred/stop")
    assert run("stop") == (0, "Fred is stopped\n", "")
    robots.refusals += ["never"] * 10_000

    def is_reported() -> bool:
        """False where a busy machine met it too late."""
        code, out, err = run("stop", "--timeout", "0.3")
        assert (code, out) == (1, "")
        return err == "holozen stop: Fred did not confirm within 0.3 s (never); it may move\n"

    wait_for(is_reported)


@pytest.mark.parametrize("payload", [b"[]", b"{", b'{"success": 1, "message": ""}', b"\xff"])
def test_a_reply_that_is_none_confirms_nothing(wire: Wire, run: Run, payload: bytes) -> None:
    bus = wire.bus("sim")
    token = bus.announce("srv", TriggerReply.ROS, "Fred/stop")
    queries = bus.session.declare_queryable(
        "Fred/stop", lambda query: query.reply("Fred/stop", payload, encoding="application/json")
    )

    def is_reported() -> bool:
        """False where a busy machine met it too late."""
        code, out, err = run("stop", "--timeout", "0.3")
        assert (code, out, err.count("\n")) == (1, "", 1)
        return err.startswith("holozen stop: Fred did not confirm within 0.3 s")

    wait_for(is_reported)
    token.undeclare()
    queries.undeclare()


def test_a_name_that_does_not_exist_names_those_that_do(
    robots: Robots, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stop_module, "NOTICE", 0.5)
    robots.add("Fred/stop", "stop")
    long = "x" * 1000  # with its service no key
    reason = (
        f"there is no robot '**', 'Frd', 'a//b', '{long}'; there are: the robot at the root, Fred"
    )
    wrong = ("Frd", "**", "a//b", long)
    assert run("stop", *wrong) == (1, "", f"holozen stop: {reason}\n")
    assert robots.called == set()
    assert run("stop", *wrong, "/Fred/") == (1, "Fred is stopped\n", f"holozen stop: {reason}\n")
    assert robots.keys() == {"Fred/stop"}


def test_without_a_robot_it_reports_that(robots: Robots, run: Run) -> None:
    code, out, err = run("stop", "--timeout", "0.1")
    assert (code, out) == (1, "")
    assert err.startswith(f"holozen stop: no nodes found at {robots.wire.endpoint}; ")
    robots.add("next_goal")

    def is_reported() -> bool:
        """False where a busy machine met the node too late."""
        code, _, err = run("release", "--timeout", "0.3")
        assert (code, err.count("\n")) == (1, 1)
        return err.startswith(
            "holozen release: no robot was found (where an access control list is in force, "
        )

    wait_for(is_reported)


def test_without_a_router_it_reports_that(capsys: pytest.CaptureFixture[str]) -> None:
    code = cli.main(
        ["stop", "--mode", "client", "--connect", "tcp/127.0.0.1:1", "--timeout", "0.1"]
    )
    out, err = capsys.readouterr()
    assert (code, out, err.count("\n")) == (1, "", 1)
    assert err.startswith("holozen stop: no robot was reached: cannot open Zenoh: ")


@contextmanager
def hanging(wire: Wire, robot: str, *, stands: bool = True) -> Iterator[threading.Event]:
    """A process of this machine whose loop does not go on, and which the network does not show. It
    answers once the event is set.
    """
    bus, answers = wire.bus("sim"), threading.Event()

    def robots() -> list[Served]:
        answers.wait()
        return [Served(robot, robot)]

    server = LocalStops(bus.id, bus.networks, robots, None, stands=stands, reporter="sim")
    try:
        yield answers
    finally:
        answers.set()
        server.close()


@pytest.fixture
def by_socket(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Processes of this machine meet by sockets of the test's own, and answer late."""
    monkeypatch.setenv("HOLOZEN_STATE", str(tmp_path))
    monkeypatch.setattr(local_stop, "ANSWERS", 0.0)


def test_what_this_machine_answers_late_counts_as_the_network_does(
    wire: Wire, run: Run, by_socket: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = f"Fred is stopped: {HANGS}\n"
    with hanging(wire, "Fred") as answers:
        answers.set()
        assert run("stop", "Fred") == (0, said, "")
        assert run("stop", "Fred", "Bob", "--timeout", "3")[:2] == (1, said)

        def refuse(*_: object, **_more: object) -> None:
            raise BusError("the network is gone")

        monkeypatch.setattr(stop_module, "Bus", refuse)  # at once, as where no socket can be had
        elsewhere = "holozen stop: robots elsewhere were not reached: the network is gone\n"
        assert run("stop", "Fred") == (0, said, elsewhere)


def test_a_robot_of_this_machine_that_cannot_confirm_is_a_failure(
    wire: Wire, run: Run, by_socket: None
) -> None:
    reason = f"holozen stop: Kiwi did not confirm within 3 s ({TURNS}); it may move\n"
    with hanging(wire, "Kiwi", stands=False) as answers:
        answers.set()
        for names in ([], ["Kiwi"]):
            code, out, err = run("stop", *names, "--timeout", "3")
            assert (code, out) == (1, "") and err.endswith(reason), err


def test_a_process_of_this_machine_that_does_not_answer_is_named_unless_others_are_meant(
    robots: Robots, run: Run, by_socket: None
) -> None:
    robots.add("Ann/stop")
    reason = f"process {os.getpid()} of this machine did not answer within 3 s; what it drives"
    with hanging(robots.wire, "Fred"):
        code, out, err = run("stop", "--timeout", "3")
        assert (code, out) == (1, "Ann is stopped\n")
        assert err == f"holozen stop: {reason} may move\n"
        assert run("stop", "Ann") == (0, "Ann is stopped\n", "")
    # it has ended
    assert run("stop") == (0, "Ann is stopped\n", "")


DEAF = """
import socket, sys, time
deaf = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
deaf.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
deaf.bind((sys.argv[1], int(sys.argv[2])))
print("up", flush=True)
time.sleep(3600)
"""


def test_a_process_that_is_there_and_does_not_answer_is_named(run: Run, wire: Wire) -> None:
    with Process([sys.executable, "-c", DEAF, GROUP, str(wire.port)]) as deaf:
        deaf.wait_for_line("up")
        code, out, err = run("stop", "--timeout", "0.5")
    assert (code, out, err.count("\n")) == (1, "", 1)
    assert err.startswith("holozen stop: no robot was reached: ")
    assert "does not answer" in err
    assert f"(pid {deaf.pid}) in the group" in err
    assert "it hangs, or others keep it busy" in err
