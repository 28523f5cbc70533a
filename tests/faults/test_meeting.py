"""Processes meet over slow links, and where the holder of the meeting point sleeps or is not Zenoh."""

import json
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import pytest

from holozen.bus import Bus
from holozen.messages import Odometry
from holozen.testing import Process, Wire, wait_for
from holozen.testing.wire import command, free_port
from holozen.transport.connection import Connection

from .proxy import Proxy

DELAY = 0.5  # s one way
WITHIN = 5.0  # s to get in
STOPPED = ("hb_bot is stopped\n", "the robot at the root is stopped\n")
"""What `stop` prints: its name may come too late, since a robot is asked before it is discovered."""


@pytest.mark.alone
def test_a_process_gets_in_over_a_slow_link(wire: Wire, proxy: Proxy) -> None:
    router = wire.start("router")
    router.wait_for_line("listens")
    proxy.set(delay=DELAY)

    def gets_in(mode: str) -> None:
        begin = time.monotonic()
        with Bus("late", Connection(mode, connect=(proxy.endpoint,), listen=()), patience=WITHIN) as bus:
            wait_for(bus.connected)
            print(f"{mode}: {time.monotonic() - begin:.2f} s")

    with ThreadPoolExecutor() as pool:
        list(pool.map(gets_in, ("client", "peer")))


@pytest.mark.parametrize("mode", ["client", "peer"])
def test_over_a_slow_link_a_verb_sees_the_nodes_and_reports_what_it_waits_for_and_a_stop_reaches_the_robot(
    wire: Wire, proxy: Proxy, mode: str
) -> None:
    wire.start("sim").wait_for_line("listens on")
    proxy.set(delay=DELAY)
    where = ("--mode", mode, "--connect", proxy.endpoint)
    with (
        Process(command("node", "list", *where)) as listing,
        Process(command("stop", "--timeout", "15", *where)) as stop,
    ):
        assert listing.wait() == 0
        assert listing.out == "sim\n"
        waited = {"client": f"waiting for a Zenoh router at {proxy.endpoint}\n"}
        assert listing.err == waited.get(mode, f"waiting for an answer from {proxy.endpoint}\n")
        assert stop.wait() == 0
        assert stop.out in STOPPED


@pytest.mark.parametrize(("mode", "number"), [("client", signal.SIGINT), ("peer", signal.SIGTERM)])
def test_what_waits_for_an_answer_ends_at_once_on_a_signal(
    wire: Wire, proxy: Proxy, mode: str, number: signal.Signals
) -> None:
    wire.start("router").wait_for_line("listens")
    proxy.set(delay=3600)
    with Process(command("sim", "--mode", mode, "--connect", proxy.endpoint, "--listen", "tcp/127.0.0.1:0")) as sim:
        sim.wait_for_line("waiting for a")
        sim.signal(number)
        assert sim.wait() == 0
        assert "Traceback" not in sim.err


DEAF = """
import socket, sys, time
server = socket.create_server(("127.0.0.1", int(sys.argv[1])))
print("up", flush=True)
time.sleep(999)
"""


class Town:
    """Processes that meet at any of three meeting points, as they do by default at ports 7447 to 7449."""

    def __init__(self) -> None:
        self.ports = sorted(free_port() for _ in range(3))
        self.points = tuple(f"tcp/127.0.0.1:{port}" for port in self.ports)
        self.connection = Connection(connect=self.points, listen=self.points)
        self._ends = ExitStack()

    def __enter__(self) -> "Town":
        return self

    def __exit__(self, *_error: object) -> None:
        self._ends.close()

    def start(self, verb: str, *words: str) -> Process:
        """Start a verb here."""
        process = self._ends.enter_context(Process(command(verb, *words, *self.connection.arguments())))
        self._ends.callback(lambda: print(f"--- {process}\n{process.out}{process.err}"))
        return process

    def run(self, verb: str, *words: str) -> Process:
        """Run a verb here until it ends."""
        process = self.start(verb, *words)
        process.wait()
        return process

    def asleep(self, verb: str, *words: str) -> Process:
        """A process that has met others here, and is suspended, as after Ctrl-Z."""
        process = self.start(verb, *words)
        process.wait_for_line("goal")
        process.signal(signal.SIGSTOP)
        return process

    def deaf(self, port: int) -> Process:
        """A process that listens at a port and never answers."""
        process = self._ends.enter_context(Process([sys.executable, "-c", DEAF, str(port)]))
        process.wait_for_line("up")
        return process


@pytest.fixture
def town() -> Iterator[Town]:
    with Town() as town:
        yield town


@pytest.mark.parametrize("holders", ["two asleep", "foreign"])
def test_processes_meet_though_the_holders_of_the_first_points_do_not_answer(town: Town, holders: str) -> None:
    if holders == "foreign":
        town.deaf(town.ports[0])
    else:
        town.asleep("pose-service")
        town.asleep("pose-service")
    town.start("sim").wait_for_line("listens on")
    verbs = [("topic", "list"), ("topic", "echo", "odom", "--once", "--timeout", "5"), ("stop",)]
    topics, echo, stop = (town.start(*words) for words in verbs)
    assert (topics.wait(), topics.err) == (0, "")
    assert "odom" in topics.out.split()
    assert echo.wait() == 0
    assert stop.wait() == 0
    assert stop.out in STOPPED


def test_a_sleeper_that_wakes_up_meets_the_nodes_that_met_without_it(town: Town) -> None:
    sleeper = town.asleep("pose-service")
    town.start("sim").wait_for_line("listens on")
    sleeper.signal(signal.SIGCONT)
    wait_for(lambda: town.run("node", "list").out.split() == ["pose_service", "sim"], 20)


VERBS = [
    ["topic", "list"], ["topic", "pub", "cmd_vel", "{}"], ["service", "call", "resume"], ["list"], ["stop"], ["graph"],
    ["sim"], ["controller"],
]  # fmt: skip


def test_a_client_that_opens_while_the_port_changes_hands_tries_again(wire: Wire) -> None:
    """Its first handshake meets a process that ends in the middle of it."""
    with socket.create_server(("127.0.0.1", wire.port)) as dying:
        words = command("topic", "echo", "odom", "--once", "--mode", "client", "--connect", wire.endpoint)
        with Process(words) as echo:
            dying.accept()[0].close()
            dying.close()
            odom = wire.bus("sim", lasting=True).publisher("odom", Odometry)  # at once: it is waited for 5 s

            def has_ended() -> bool:
                odom.put(Odometry())
                return echo.returncode is not None

            wait_for(has_ended, 20)
            assert echo.returncode == 0, echo.err
            assert "pose:" in echo.out


def test_where_no_point_answers_a_verb_names_the_holder_and_fails(wire: Wire) -> None:
    with socket.create_server(("127.0.0.1", wire.port)):
        processes = [wire.start(*verb) for verb in VERBS]
        for process in processes:
            assert process.wait(30) == 1
            waiting, why = process.err.splitlines()
            assert waiting == f"waiting for an answer from {wire.endpoint}"
            assert f"{wire.endpoint} is held by " in why and "which does not answer; end it: kill" in why
            assert process.out == ""


MESSAGES = (
    "put", "delete", "declare_subscriber", "declare_queryable", "query", "reply",
    "liveliness_token", "liveliness_query", "declare_liveliness_subscriber",
)  # fmt: skip


@pytest.mark.parametrize("allowed", [["**"], ["**", "@holozen/**"]], ids=" ".join)
def test_an_access_control_list_has_to_allow_the_tokens_of_nodes(
    wire: Wire, tmp_path: Path, allowed: list[str]
) -> None:
    rule = {
        "id": "all",
        "permission": "allow",
        "flows": ["ingress", "egress"],
        "messages": MESSAGES,
        "key_exprs": allowed,
    }
    acl = {"enabled": True, "default_permission": "deny", "rules": [rule], "subjects": [{"id": "anyone"}],
           "policies": [{"rules": ["all"], "subjects": ["anyone"]}]}  # fmt: skip
    path = tmp_path / "router.json5"
    listen = {"endpoints": [wire.endpoint]}
    path.write_text(json.dumps({"mode": "router", "listen": listen, "access_control": acl}))
    client = ("--mode", "client", "--connect", wire.endpoint)
    with Process(command("router", "--config", str(path), "--cfg", "scouting/multicast/enabled:false")) as router:
        router.wait_for_line("listens at")
        with Process(command("sim", *client)) as sim:
            sim.wait_for_line("listens on")
            listed = subprocess.run(command("topic", "list", *client), capture_output=True, text=True, timeout=30)
            stop = subprocess.run(command("stop", *client), capture_output=True, text=True, timeout=30)
    assert stop.stdout in STOPPED
    if len(allowed) > 1:
        assert "odom" in listed.stdout.split()
        assert (stop.stderr, stop.returncode) == ("", 0)
    else:
        assert "it has to allow @holozen/**" in listed.stderr
        assert "other robots may not have been discovered" in stop.stderr
        assert "it has to allow @holozen/**" in stop.stderr
        assert (listed.stdout, stop.returncode) == ("", 1)
