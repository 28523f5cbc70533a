"""Processes meet over slow links, and where others sleep or are not Zenoh."""

import json
import signal
import socket
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import pytest

from holozen.bus import Bus
from holozen.messages import Odometry
from holozen.testing import Process, Wire, wait_for
from holozen.testing.process import run
from holozen.testing.wire import command
from holozen.transport.connection import Connection

from .proxy import Proxy

DELAY = 0.5  # s one way
WITHIN = 5.0  # s to get in
STOPPED = ("hb_bot is stopped\n", "the robot at the root is stopped\n")
"""What `stop` prints: its name may come too late, since a robot is asked before it is discovered.
"""


@pytest.mark.alone
def test_a_process_gets_in_over_a_slow_link(wire: Wire, proxy: Proxy) -> None:
    router = wire.start("router")
    router.wait_for_line("listens")
    proxy.set(delay=DELAY)

    def gets_in(mode: str) -> None:
        begin = time.monotonic()
        with Bus(
            "late", Connection(mode, connect=(proxy.endpoint,), listen=()), patience=WITHIN
        ) as bus:
            wait_for(bus.connected)
            print(f"{mode}: {time.monotonic() - begin:.2f} s")

    with ThreadPoolExecutor() as pool:
        list(pool.map(gets_in, ("client", "peer")))


@pytest.mark.alone
def test_over_a_slow_link_a_verb_sees_the_nodes_and_reports_what_it_waits_for_and_a_stop_reaches_the_robot(  # noqa: E501
    wire: Wire, proxy: Proxy
) -> None:
    wire.start("sim", "--rtf", "0.2").wait_for_line("listens on")
    proxy.set(delay=DELAY)
    waited = {"client": "a Zenoh router at", "peer": "an answer from"}
    with ExitStack() as ends:
        listings, stops = (
            {
                mode: ends.enter_context(
                    Process(command(*verb, "--mode", mode, "--connect", proxy.endpoint))
                )
                for mode in waited
            }
            for verb in (("node", "list"), ("stop", "--timeout", "15"))
        )
        for mode, listing in listings.items():
            assert listing.wait() == 0
            assert listing.out == "sim\n"
            assert listing.err == f"waiting for {waited[mode]} {proxy.endpoint}\n"
        for stop in stops.values():
            assert stop.wait() == 0
            assert stop.out in STOPPED


def test_what_waits_for_an_answer_ends_at_once_on_a_signal(wire: Wire, proxy: Proxy) -> None:
    wire.start("router").wait_for_line("listens")
    proxy.set(delay=3600)
    where = ("--connect", proxy.endpoint, "--listen", "tcp/127.0.0.1:0")
    with (
        Process(command("sim", "--rtf", "0.2", "--mode", "client", *where)) as client,
        Process(command("sim", "--rtf", "0.2", "--mode", "peer", *where)) as peer,
    ):
        for sim, number in ((client, signal.SIGINT), (peer, signal.SIGTERM)):
            sim.wait_for_line("waiting for a")
            sim.signal(number)
            assert sim.wait() == 0
            assert "Traceback" not in sim.err


def notes(err: str) -> list[str]:
    """What a verb wrote on standard error, but for whom it waited, as it does on a busy machine."""
    return [line for line in err.splitlines() if not line.startswith("waiting for ")]


DEAF = """
import socket, sys, time
server = socket.create_server(("127.0.0.1", int(sys.argv[1])))
print("up", flush=True)
time.sleep(999)
"""


def asleep(wire: Wire) -> Process:
    """A process that has met others here, and is suspended, as after Ctrl-Z."""
    process = wire.start("pose-service")
    process.wait_for_line("goal")
    process.signal(signal.SIGSTOP)
    return process


@pytest.mark.parametrize("others", ["two asleep", "foreign"])
def test_processes_meet_though_others_do_not_answer(wire: Wire, others: str) -> None:
    if others == "foreign":
        foreign = Process([sys.executable, "-c", DEAF, str(wire.port)])
        foreign.wait_for_line("up")
    else:
        asleep(wire)
        asleep(wire)
    wire.start("sim", "--rtf", "0.2").wait_for_line("listens on")
    verbs = [("topic", "list"), ("topic", "echo", "odom", "--once", "--timeout", "20"), ("stop",)]
    topics, echo, stop = (wire.start(*words) for words in verbs)

    def listed() -> bool:
        """Or again, where a busy machine did not let the sim answer in time."""
        nonlocal topics
        topics.wait()
        if "odom" in topics.out.split():
            return True
        topics = wire.start(*verbs[0])
        return False

    wait_for(listed, what=lambda: f"odom; {topics.out}{topics.err}")
    assert (topics.returncode, notes(topics.err)) == (0, [])
    assert echo.wait() == 0
    assert stop.wait() == 0
    assert stop.out in STOPPED
    if others == "foreign":
        foreign.close()


def test_a_sleeper_that_wakes_up_meets_the_nodes_that_met_without_it(wire: Wire) -> None:
    sleeper = asleep(wire)
    wire.start("sim", "--rtf", "0.2").wait_for_line("listens on")
    sleeper.signal(signal.SIGCONT)
    wait_for(lambda: wire.run("node", "list").stdout.split() == ["pose_service", "sim"], 20)


VERBS = [["topic", "list"], ["stop"]]


def test_a_client_that_opens_while_the_port_changes_hands_tries_again(wire: Wire) -> None:
    """Its first handshake meets a process that ends in the middle of it."""
    with socket.create_server(("127.0.0.1", wire.port)) as dying:
        words = command(
            "topic", "echo", "odom", "--once", "--mode", "client", "--connect", wire.endpoint
        )
        with Process(words) as echo:
            dying.accept()[0].close()
            dying.close()
            # at once: it is waited for 5 s
            odom = wire.bus("sim", lasting=True).publisher("odom", Odometry)

            def has_ended() -> bool:
                odom.put(Odometry())
                return echo.returncode is not None

            wait_for(has_ended, 20)
            assert echo.returncode == 0, echo.err
            assert "pose:" in echo.out


def test_where_nobody_answers_a_verb_names_who_is_there_and_fails() -> None:
    with ExitStack() as ends:
        # each on a wire of its own, else they meet each other
        wires = [ends.enter_context(Wire()) for _ in VERBS]
        hung = [asleep(wire) for wire in wires]
        started = [wire.start(*verb) for wire, verb in zip(wires, VERBS, strict=True)]
        for wire, sleeper, process in zip(wires, hung, started, strict=True):
            assert process.wait(30) == 1
            waiting, why = process.err.splitlines()
            group = f"the group 224.0.0.224:{wire.port} on loopback"
            assert waiting == f"waiting for an answer from {group}"
            assert f"does not answer; continue it: kill -CONT {sleeper.pid}" in why
            assert process.out == ""


MESSAGES = (
    "put",
    "delete",
    "declare_subscriber",
    "declare_queryable",
    "query",
    "reply",
    "liveliness_token",
    "liveliness_query",
    "declare_liveliness_subscriber",
)


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
    acl = {
        "enabled": True,
        "default_permission": "deny",
        "rules": [rule],
        "subjects": [{"id": "anyone"}],
        "policies": [{"rules": ["all"], "subjects": ["anyone"]}],
    }
    path = tmp_path / "router.json5"
    listen = {"endpoints": [wire.endpoint]}
    path.write_text(json.dumps({"mode": "router", "listen": listen, "access_control": acl}))
    client = ("--mode", "client", "--connect", wire.endpoint)
    with Process(
        command("router", "--config", str(path), "--cfg", "scouting/multicast/enabled:false")
    ) as router:
        router.wait_for_line("listens at")
        with Process(command("sim", "--rtf", "0.2", *client)) as sim, ThreadPoolExecutor() as pool:
            sim.wait_for_line("listens on")
            listed, stop = pool.map(lambda verb: run(command(*verb, *client), 60), VERBS)
    assert stop.stdout in STOPPED
    if len(allowed) > 1:
        assert "odom" in listed.stdout.split()
        assert (notes(stop.stderr), stop.returncode) == ([], 0)
    else:
        assert "it has to allow @holozen/**" in listed.stderr
        assert "other robots may not have been discovered" in stop.stderr
        assert "it has to allow @holozen/**" in stop.stderr
        assert (listed.stdout, stop.returncode) == ("", 1)
