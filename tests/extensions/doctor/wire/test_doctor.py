"""Each finding of the doctor, made to happen for real."""

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from holozen import cli
from holozen.bus import Bus
from holozen.messages import Clock, Odometry, Twist
from holozen.testing import Process, Wire, wait_for
from holozen.testing.wire import command, free_port
from holozen.transport import graph
from tests.integration.conftest import Verb

REPO = Path(__file__).parents[4]
HOLD = """
import socket, sys, time
held = socket.create_server(("127.0.0.1", int(sys.argv[1])))
print("up", flush=True)
time.sleep(999)
"""
Rows = list[dict[str, str]]


def doctor(verb: Verb, wire: Wire, *words: str) -> tuple[int, Rows]:
    """Its exit code and findings, all with a fix unless all is well."""
    done = verb(wire, "doctor", "--json", *words)
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.stderr == ""
    assert all(set(row) == {"check", "level", "text", "fix"} for row in rows)
    assert all(row["fix"] for row in rows if row["level"] != "ok")
    assert done.returncode == int(any(row["level"] == "error" for row in rows))
    return done.returncode, rows


def bad(rows: Rows, check: str) -> list[str]:
    """What is wrong in one respect."""
    return [
        f"{row['level']}: {row['text']}"
        for row in rows
        if row["check"] == check and row["level"] != "ok"
    ]


def doctor_when_bad(verb: Verb, wire: Wire, check: str, count: int = 1) -> tuple[int, Rows]:
    """As `doctor`, once so many things are wrong in one respect: a busy machine shows a node or a
    topic late.
    """

    def look() -> tuple[int, Rows] | None:
        code, rows = doctor(verb, wire)
        return (code, rows) if len(bad(rows, check)) >= count else None

    found = wait_for(look)
    assert found
    return found


@pytest.fixture
def door(wire: Wire) -> Bus:
    """A process that holds the meeting point."""
    return wire.bus("door", lasting=True)


def test_with_a_robot_that_drives_all_is_well_and_a_stop_is_reported_as_no_error(
    verb: Verb, wire: Wire
) -> None:
    wire.start("sim").wait_for_line("listens on")
    wire.start("pose-service").wait_for_line("goals")
    controller = wire.start("controller")
    odom = wire.bus().latest("odom", Odometry)
    wait_for(lambda: (now := odom.read()[0]) and not now.twist.twist.is_slow(0.1))

    def is_well() -> bool:
        code, rows = doctor(verb, wire)
        texts = " ".join(row["text"] for row in rows)
        parts = ("3 of this version: controller (pid", "fresh on odom", "and speaks Zenoh")
        seen.append(texts)
        return code == 0 and all(part in texts for part in parts)

    seen = list[str]()
    wait_for(is_well, what=lambda: f"all to be well: {seen[-1]}")  # a busy machine is late
    assert controller.returncode is None
    assert "yields" not in controller.err
    wait_for(
        lambda: (now := odom.read()[0]) and not now.twist.twist.is_slow(0.1), what="it to drive on"
    )
    assert verb(wire, "stop").returncode == 0
    _, rows = doctor_when_bad(verb, wire, "cmd_vel")
    assert bad(rows, "cmd_vel")[0].startswith("warning: hb_bot is stopped by stop@")


def test_a_paused_sim_is_a_warning_until_it_plays(verb: Verb, wire: Wire) -> None:
    wire.start("sim").wait_for_line("listens on")
    assert verb(wire, "sim", "pause").returncode == 0
    _, rows = doctor_when_bad(verb, wire, "sim")
    assert bad(rows, "sim") == ["warning: the sim is paused: its robots stand still"]
    assert verb(wire, "sim", "play").returncode == 0
    wait_for(lambda: not bad(doctor(verb, wire)[1], "sim"), what="it to play")


@pytest.mark.needs("ip", "unshare")
def test_with_no_network_and_nothing_running_all_is_well() -> None:
    words = ["unshare", "-rn", *command("doctor")]  # not even loopback is up
    done = subprocess.run(words, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0
    assert re.fullmatch(
        r"no multicast on loopback \(.*\): meets others at tcp/127.0.0.1:7447 alone\n", done.stderr
    )
    assert "tcp/127.0.0.1:7447 is free: no sim runs here yet" in done.stdout


@pytest.mark.parametrize("mode", ["peer", "client"])
def test_a_missing_router_is_reported(verb: Verb, wire: Wire, mode: str) -> None:
    port = free_port()
    wire.flags = ["--mode", mode, "--connect", f"tcp/127.0.0.1:{port}"]
    code, rows = doctor(verb, wire)
    assert code == 1
    assert bad(rows, "port") == [
        f"error: tcp/127.0.0.1:{port} cannot be reached: Connection refused"
    ]
    assert f"--listen tcp/0.0.0.0:{port}" in next(
        row["fix"] for row in rows if row["check"] == "port"
    )


@pytest.mark.parametrize("mode", ["peer", "client"])
def test_a_holder_of_the_port_that_speaks_no_zenoh_is_named(
    verb: Verb, wire: Wire, mode: str
) -> None:
    wire.flags += ["--mode", mode]
    with Process([sys.executable, "-c", HOLD, str(wire.port)]) as holder:
        holder.wait_for_line("up")
        _, rows = doctor(verb, wire)
    (text,) = bad(rows, "port")
    assert text.startswith("error" if mode == "client" else "warning"), "peers do without the port"
    assert f"(pid {holder.pid}), which does not speak Zenoh" in text
    assert "end it in its terminal once what it drives stands" in next(
        row["fix"] for row in rows if row["check"] == "port"
    )


def test_a_sleeping_holder_of_the_port_is_to_be_woken(verb: Verb, wire: Wire) -> None:
    router = wire.start("router")
    router.wait_for_line("listens at")  # else the doctor may take the port before it does
    wait_for(lambda: "speaks Zenoh" in str(doctor(verb, wire)[1]))
    router.signal(signal.SIGSTOP)
    _, rows = doctor_when_bad(verb, wire, "port")
    router.signal(signal.SIGCONT)
    assert "stopped as by Ctrl-Z" in bad(rows, "port")[0]
    assert f"kill -CONT {router.pid}" in str(rows)


def test_a_sleeper_is_named_with_what_wakes_it_up(verb: Verb, wire: Wire, door: Bus) -> None:
    asleep = wire.start("pose-service")
    asleep.wait_for_line("goals")
    asleep.signal(signal.SIGSTOP)
    _, rows = doctor_when_bad(verb, wire, "meeting")
    asleep.signal(signal.SIGCONT)
    (text,) = bad(rows, "meeting")
    assert "stopped as by Ctrl-Z" in text
    assert f"kill -CONT {asleep.pid}" in next(
        row["fix"] for row in rows if row["check"] == "meeting"
    )


def test_odom_that_does_not_come_is_stale(verb: Verb, wire: Wire, door: Bus) -> None:
    publisher = wire.bus("sim").publisher("Fred/odom", Odometry)
    code, rows = doctor_when_bad(verb, wire, "odom")
    (text,) = bad(rows, "odom")
    assert re.match(r"error: Fred/odom is stale: nothing from sim for \d+\.\d s", text)
    assert code == 1
    wait_for(lambda: not publisher.matched, what="the doctor to be gone without a trace")


@contextlib.contextmanager
def commanding(*buses: Bus) -> Iterator[None]:
    """Several scripts that command the robot at 20 Hz."""
    ends = threading.Event()
    publishers = [bus.publisher("cmd_vel", Twist) for bus in buses]

    def command() -> None:
        while not ends.wait(0.05):
            for publisher in publishers:
                publisher.put(Twist.planar(x=0.1))

    thread = threading.Thread(target=command)
    thread.start()
    try:
        yield
    finally:
        ends.set()
        thread.join()


def test_two_sources_that_fight_for_a_robot_and_two_sims_on_one_key_are_reported(
    verb: Verb, wire: Wire
) -> None:
    sim = wire.start("sim")
    sim.wait_for_line("listens on")
    with commanding(wire.bus("left"), wire.bus("right")):
        (text,) = wait_for(lambda: bad(doctor(verb, wire)[1], "cmd_vel"))
    assert text.startswith("error: 2 sources command hb_bot at once: left@")
    assert "(script, " in text and "not obeyed" in text and "right@" in text
    clock = wire.bus("other", lasting=True).publisher("clock", Clock)  # our own sim would refuse
    nodes = [
        f"{name} (pid {pid} on {os.uname().nodename})"
        for name, pid in [("sim", sim.pid), ("other", os.getpid())]
    ]

    def are_named() -> bool:  # one that answers late is named without its process
        code, rows = doctor_when_bad(verb, wire, "duplicates")
        (text,) = bad(rows, "duplicates")
        assert code == 1 and text.startswith("error: ")
        return all(node in text for node in nodes)

    wait_for(are_named, what=lambda: f"{nodes}")
    clock.close()


def foreign(wire: Wire, change: Callable[[dict[str, Any]], None]) -> tuple[Any, Any]:
    """A node whose description is altered by `change`."""
    bus = wire.bus("foreign")
    reported = {
        "node": "foreign",
        "version": graph.version("holozen"),
        "host": "elsewhere",
        "pid": 7,
    }

    def answer(query: Any) -> None:
        with query:
            row = reported | {"time": time.time()}
            change(row)
            query.reply(graph.node_info_key(bus.id), json.dumps(row))

    return bus.session.declare_queryable(graph.node_info_key(bus.id), answer), bus.announce("node")


def test_a_clock_that_is_off_is_reported(verb: Verb, wire: Wire, door: Bus) -> None:
    held = foreign(wire, lambda row: row.__setitem__("time", row["time"] + 3))
    code, rows = doctor_when_bad(verb, wire, "clock")
    (text,) = bad(rows, "clock")
    found = re.match(
        r"error: the clock of elsewhere is ([+-].+) s from ours \(give or take (.+) s\)", text
    )
    assert found and code == 1 and held, text
    assert float(found[1]) == pytest.approx(3, abs=float(found[2]) + 1e-3)


def test_another_version_and_a_node_that_does_not_answer_are_reported(
    verb: Verb, wire: Wire, door: Bus
) -> None:
    bus = wire.bus("mute")
    held = (
        foreign(wire, lambda row: row.__setitem__("version", "0.0.1")),
        bus.announce("node"),
        bus.session.declare_queryable(
            graph.node_info_key(bus.id), lambda query: queries.append(query)
        ),
    )
    queries: list[Any] = []
    code, rows = doctor_when_bad(verb, wire, "nodes", 2)
    other, mute = sorted(bad(rows, "nodes"))
    assert other == (
        "warning: foreign (pid 7 on elsewhere) has holozen 0.0.1, this is "
        f"{graph.version('holozen')}"
    )
    assert mute.startswith(f"warning: mute ({bus.id[:6]}) does not answer")
    assert code == 0 and held
    queries.clear()


@pytest.mark.parametrize(("lacks", "level"), [("xacro", "warning"), ("zenoh", "error")])
def test_a_missing_wheel_is_reported(wire: Wire, tmp_path: Path, lacks: str, level: str) -> None:
    """A real environment without it: links to all else."""
    there = next(Path(path) for path in sys.path if path.endswith("site-packages"))
    for entry in there.iterdir():
        if lacks not in entry.name and not entry.name.endswith(".pth"):
            (tmp_path / entry.name).symlink_to(entry)
    script = (
        "import sys; sys.path[:0] = sys.argv[1:3]; del sys.argv[1:3]; from holozen.cli "
        "import main; sys.exit(main())"
    )
    words = [
        sys.executable,
        "-S",
        "-I",
        "-c",
        script,
        str(REPO),
        str(tmp_path),
        "doctor",
        *wire.flags,
    ]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60)
    assert done.stderr == ""
    assert f"{level:<8} packages: " in done.stdout
    assert f"{lacks} is missing" in done.stdout
    assert "port: " in done.stdout  # everything else is checked all the same


def test_a_wrong_configuration_is_one_error_line(verb: Verb, wire: Wire) -> None:
    code, rows = doctor(verb, wire, "--config", "/nowhere.json5")
    (text,) = bad(rows, "zenoh")
    assert (code, "/nowhere.json5" in text) == (1, True)


def test_it_ends_quietly_without_a_reader(wire: Wire) -> None:
    words = " ".join(command("doctor", *wire.flags))
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", f"{words} | head -1"],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_variables_put_every_process_on_a_network_and_the_doctor_shows_them(
    wire: Wire, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    env = {
        "HOLOZEN_CONNECT": wire.endpoint,
        "HOLOZEN_LISTEN": wire.endpoint,
        "HOLOZEN_MODE": "peer",
    }

    def run(verb: str, *words: str, **more: str) -> subprocess.CompletedProcess[str]:
        words = (*command(verb, *words),)
        return subprocess.run(
            words, env={**os.environ, **env, **more}, capture_output=True, text=True, timeout=60
        )

    with Process(command("up"), env=env) as up:
        up.wait_for_line("goals", within=60)
        wait_for(lambda: "controller" in wire.run("node", "list").stdout, what="all that up starts")
        assert run("topic", "echo", "odom", "--once").returncode == 0
        shown = run("doctor", "--json", "--mode", "peer").stdout
        found = [
            row["text"]
            for row in map(json.loads, shown.splitlines())
            if row["check"] == "environment"
        ]
        assert found == [
            "HOLOZEN_MODE=peer is overridden here by --mode",
            f"HOLOZEN_CONNECT={wire.endpoint} applies to every verb without --connect",
            f"HOLOZEN_LISTEN={wire.endpoint} applies to every verb without --listen",
        ]
    for name, value in env.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setenv("HOLOZEN_MODE", "klient")
    for verb in ("sim", "teleop", "controller", "pose-service", "up", "stop", "doctor"):
        with contextlib.suppress(SystemExit):
            assert cli.main([verb, *["--script", os.devnull][: 2 * (verb == "teleop")]]) == 2, verb
        out, err = capsys.readouterr()
        assert (out, err.count("\n")) == ("", 1), verb
        assert err.startswith("holozen: HOLOZEN_MODE='klient' (did you mean 'client'?)"), err
