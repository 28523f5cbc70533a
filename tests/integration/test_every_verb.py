"""Every verb alone, beside what runs, and interrupted: no traceback, one line, the right exit code.

A test tries all verbs of its kind: side by side, each as a process, or one after the other in this
one.
"""

import itertools
import json
import os
import re
import shlex
import socket
import subprocess
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

import pytest
import zenoh

from holozen import cli, data
from holozen.bags.formats import as_cdr
from holozen.bags.writer import BagWriter
from holozen.bus import Bus
from holozen.messages import Odometry
from holozen.spawning import SpawnPose, spawn_file
from holozen.testing import Terminal, Wire, process, wait_for
from holozen.testing.process import START
from holozen.testing.wire import free_port

from .conftest import Verb, foreign_config, start_sim
from .foreign_samples import PUTS
from .verbs import VERBS, Row

BOT = data.find("urdf", "hb_bot.urdf.xacro")
BALL = """<robot name="ball"><link name="b"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>
<collision><geometry><sphere radius="0.1"/></geometry></collision></link></robot>"""  # noqa: E501
SIDE_BY_SIDE, MANY = 6, 20  # processes at once: those that work, and those that mostly wait
HERE = 0  # one after the other, in the main thread of this process

RACE = "dispatcher/resource.rs"
"""Where a thread of Zenoh's panics when many sessions come and go beside each other:
eclipse-zenoh/zenoh#2624.
"""
MAX_RACES = 3  # of some 300 tries; nothing is tried again
RACED: list[str] = []

Done = subprocess.CompletedProcess[str]
T = TypeVar("T")

OTHER_NAMES = {"topic plot": "plot", "bag record": "record", "bag play": "replay"}
"""Verbs that do what another does: they are tried with what is wrong, and with their work as JSON.
"""
ONCE = [name for name in VERBS if name not in OTHER_NAMES]
LIVE = [name for name, row in VERBS.items() if row.live is not None]
# the others print it there
TEXT = [name for name in LIVE if not (VERBS[name].foreign or VERBS[name].endless)]
WRONG = [name for name, row in VERBS.items() if row.wrong]
ON_THE_WIRE = [name for name in ONCE if name in LIVE and VERBS[name].bus]
SILENT = [name for name in ONCE if VERBS[name].silent]
FOREIGN = [name for name in ONCE if VERBS[name].foreign]
ENDLESS = [name for name in ONCE if VERBS[name].endless]


def of_each_noun(names: list[str]) -> list[str]:
    return list({name.partition(" ")[0]: name for name in names}.values())


CLIENTS = ["topic echo", "spawn", *(["doctor"] if "doctor" in ON_THE_WIRE else [])]
WAITING = of_each_noun(
    [name for name in ON_THE_WIRE if not VERBS[name].endless and name != "doctor"]
)


def words_of(verb: str) -> list[str]:
    """A verb, or the verbs of a noun."""
    if verb in cli.NOUNS:
        return [f"{verb} {name}" for name in cli.VERBS[verb].about.split(", ")]
    return [verb, *(f"{verb} {name}" for name in cli.VERBS[verb].verbs)]


def module_of(verb: str) -> str:
    """The module that defines a verb."""
    noun, _, name = verb.partition(" ")
    return cli.command(noun).modules[name] if name else cli.VERBS[noun].module


def test_every_verb_has_a_row() -> None:
    assert list(VERBS) == [words for verb in cli.VERBS for words in words_of(verb)]


def test_another_name_is_of_a_verb_that_does_the_same() -> None:
    for name, other in OTHER_NAMES.items():
        noun, verb = name.split()
        assert VERBS[name] is VERBS[other]
        assert cli.command(noun).verb(verb).about == cli.command(other).about


class Files:
    """A folder with what verbs are given."""

    def __init__(self, tmp: Path) -> None:
        self.tmp = tmp
        self._free = itertools.count(5, 2)  # m along x, where nothing is
        (tmp / "ball.urdf").write_text(BALL)
        (tmp / "odd.urdf").write_text("<robot/>")
        (tmp / "sim.yaml").write_text("sim:\n  ros__parameters:\n    max_linear: 1.5\n")
        writer, start = BagWriter(str(tmp / "bag")), 1_700_000_000_000_000_000  # ns
        for number in range(20):
            form, payload = as_cdr(Odometry())
            writer.write("odom", form, payload, start + number * 50_000_000)
        writer.close()

    def words(self, name: str, words: str, n: str) -> list[str]:
        """The words of a verb, filled in."""
        files = {"bot": BOT} | {key: self.tmp / file for key, file in FILES.items()}
        filled = words.format(
            n=n, id=n + "".join(name.split()), tmp=self.tmp, free=next(self._free), **files
        )
        return [*name.split(), *shlex.split(filled)]


FILES = {"ball": "ball.urdf", "odd": "odd.urdf", "yaml": "sim.yaml", "bag": "bag.mcap"}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    return Files(tmp_path_factory.mktemp("verbs"))


@pytest.fixture(scope="module")
def busy(town: Wire, files: Files) -> Iterator[Wire]:
    """A sim with robots, a pose service, and a foreign node that publishes on many keys, listens
    and answers.

    They take processor time as long as they run, so the tests that need none of it come first.
    """
    start_sim(town, "--rtf", "0.2")  # nothing waits for its time, and it costs less
    with Bus("setup", town.connection) as bus:  # gone again: every verb would connect to it
        spawn_file(bus, BOT, "Spare", SpawnPose(x=2.0))
        spawn_file(bus, BOT, "Free", SpawnPose(x=-8.0))  # `stop Spare` runs beside `release Free`
        for n, x in (("text", -2.0), ("json", -3.0), ("pipe", -4.0)):
            spawn_file(bus, files.tmp / "ball.urdf", f"Doomed{n}", SpawnPose(x=x))
    town.start("pose-service").wait_for_line("goals")
    done = threading.Event()
    with zenoh.open(foreign_config(town)) as session:
        heard = session.declare_subscriber("a/heard", zenoh.handlers.RingChannel(1))
        asked = session.declare_queryable(
            "a/asked", lambda query: query.reply("a/asked", b'{"x": 1}')
        )
        talker = threading.Thread(target=_talk, args=(session, done))
        talker.start()
        yield town
        done.set()
        talker.join()
        del heard, asked


def _talk(session: zenoh.Session, done: threading.Event) -> None:
    while not done.wait(0.05):
        for key, (payload, encoding) in PUTS.items():
            session.put(key, payload, encoding=encoding)


def tries(
    names: list[str], attempt: Callable[[str], T], at_once: int = SIDE_BY_SIDE
) -> Iterator[tuple[str, T]]:
    """What came of the same try with many verbs, but for those that Zenoh's own race took part
    in.
    """
    with ThreadPoolExecutor(at_once or 1) as pool:
        outcomes = (pool.map if at_once else map)(attempt, names)
        done = dict(zip(names, outcomes, strict=True))
    for name, outcome in done.items():
        if RACE in str(outcome):
            RACED.append(name)
        else:
            yield name, outcome


def run(words: list[str], **options: Any) -> Done:
    return process.run([*START, *words], within=120, **options)


def flags(row: Row, wire: Wire) -> list[str]:
    return wire.flags if row.bus else []


def is_clean(text: str) -> bool:
    return not any(
        word in text for word in ("Traceback", "Exception ignored", "Error:", "panicked")
    )


def assert_one_line(name: str, done: Done, code: int, part: str) -> None:
    assert (done.returncode, done.stdout) == (code, ""), f"{name}: {done}"
    assert len(done.stderr.splitlines()) == 1 and part in done.stderr, f"{name}: {done.stderr}"


# --- alone


def test_without_nodes_it_reports_that(files: Files) -> None:
    def attempt(name: str) -> Done:
        words, _, _ = VERBS[name].silent or ("", 0, "")
        with Wire() as own:
            return run(files.words(name, words, "silent") + own.flags)

    for name, done in tries(SILENT, attempt, MANY):
        _, code, part = VERBS[name].silent or ("", 0, "")
        lines = done.stderr.splitlines()
        if name.endswith("record"):
            assert lines.pop(0).startswith("recording odom into ")
        assert (done.returncode, len(lines)) == (code, 1), f"{name}: {done}"
        assert part in lines[0] and is_clean(done.stderr), f"{name}: {done.stderr}"


def test_a_client_without_a_router_gives_up(files: Files) -> None:
    """They all open their sessions in the same way."""
    nowhere = ["--mode", "client", "--connect", f"tcp/127.0.0.1:{free_port()}"]

    def attempt(name: str) -> Done:
        return run(files.words(name, VERBS[name].live or "", "alone") + nowhere)

    for name, done in tries(CLIENTS, attempt, MANY):
        if name == "doctor":
            assert (
                done.returncode == 1 and done.stdout.count("error") == 1 and is_clean(done.stderr)
            ), done
            assert f"{nowhere[-1]} cannot be reached: Connection refused" in done.stdout, done
        else:
            waits, fails = done.stderr.splitlines()
            assert (done.returncode, done.stdout) == (1, ""), f"{name}: {done}"
            assert waits.startswith("waiting for a Zenoh router at "), f"{name}: {done.stderr}"
            assert "cannot open Zenoh: no router answers at " in fails, f"{name}: {done.stderr}"


def test_ctrl_c_ends_what_waits(files: Files) -> None:
    """Interrupted while they wait for a router that accepts their connection and stays silent: all
    in the same way.
    """

    def attempt(name: str) -> tuple[int, str]:
        with socket.create_server(("127.0.0.1", 0)) as mute:
            mute.settimeout(30)
            there = ["--mode", "client", "--connect", f"tcp/127.0.0.1:{mute.getsockname()[1]}"]
            words = files.words(name, VERBS[name].live or "", "waiting")
            with Terminal([*START, *words, *there]) as terminal, mute.accept()[0]:
                terminal.type("\x03")
                return terminal.process.wait(30), terminal.raw

    for name, (code, shown) in tries(WAITING, attempt, MANY):
        assert (code, is_clean(shown)) == (130, True), f"{name}: {shown}"


# --- beside what runs


def test_it_does_its_work(busy: Wire, files: Files, call: Verb) -> None:
    """As a process of its own it does it as JSON, below."""

    def attempt(name: str) -> Done:
        row = VERBS[name]
        return call(*files.words(name, row.live or "", "text"), *flags(row, busy))

    for name, done in tries(TEXT, attempt, HERE):
        assert done.returncode in {VERBS[name].code, int(name == "doctor")}, (
            f"{name}: {done.stderr}"
        )
        assert done.stdout or done.stderr, name
        assert is_clean(done.stderr), f"{name}: {done.stderr}"


def test_as_json_it_is_one_object_a_line(busy: Wire, files: Files) -> None:
    """And a verb of each module in a new Python, where that has only what it imports itself."""
    new = {module_of(name): name for name in LIVE if name not in OTHER_NAMES}.values()

    def attempt(name: str) -> Done:
        row = VERBS[name]
        return run(
            [*files.words(name, row.live or "", "json"), "--json", *flags(row, busy)],
            is_new=name in new,
        )

    for name, done in tries(LIVE, attempt):
        assert done.returncode in {VERBS[name].code, int(name == "doctor")}, (
            f"{name}: {done.stderr}"
        )
        assert done.stdout, name
        assert all(isinstance(json.loads(line), dict) for line in done.stdout.splitlines()), (
            f"{name}: {done.stdout}"
        )
        assert is_clean(done.stderr), f"{name}: {done.stderr}"


def test_a_reader_that_is_gone_ends_it_quietly(busy: Wire, files: Files) -> None:
    def attempt(name: str) -> Done:
        reading, writing = os.pipe()
        os.close(reading)
        row = VERBS[name]
        with open(writing, "wb") as gone:
            return run(
                [*files.words(name, row.live or "", "pipe"), "--json", *flags(row, busy)],
                stdout=gone,
            )

    for name, done in tries(["node list", "list"], attempt):
        assert done.returncode == 0, f"{name}: {done.stderr}"
        assert is_clean(done.stderr) and "Broken pipe" not in done.stderr, f"{name}: {done.stderr}"


def test_what_is_wrong_is_one_line(busy: Wire, files: Files, call: Verb) -> None:
    def attempt(name: str) -> Done:
        row = VERBS[name]
        return call(*files.words(name, (row.wrong or ("",))[0], "wrong"), *flags(row, busy))

    for name, done in tries(WRONG, attempt, HERE):
        _, code, part = VERBS[name].wrong or ("", 0, "")
        assert_one_line(name, done, code, part)


def test_it_does_its_work_with_foreign_nodes(busy: Wire, files: Files) -> None:
    def attempt(name: str) -> Done:
        words, _ = VERBS[name].foreign or ("", "")
        return run(files.words(name, words, "foreign") + busy.flags)

    for name, done in tries(FOREIGN, attempt):
        _, part = VERBS[name].foreign or ("", "")
        assert done.returncode == 0 and is_clean(done.stderr), f"{name}: {done.stderr}"
        assert part in done.stdout, f"{name}: {done.stdout}"


def test_ctrl_c_ends_what_would_go_on(busy: Wire, files: Files) -> None:
    def attempt(name: str) -> tuple[int, str]:
        row = VERBS[name]
        assert row.endless
        with Wire() as own:
            wire = own if row.live is None else busy
            begun, words = row.endless.begun, files.words(name, row.endless.words, "endless")
            with Terminal([*START, *words, *flags(row, wire)]) as terminal:
                wait_for(
                    lambda: re.search(begun, terminal.raw),
                    20,
                    lambda: f"{begun} in {terminal.raw[-2000:]}",
                )
                terminal.type("\x03")
                return terminal.process.wait(30), terminal.raw

    for name, (code, shown) in tries(ENDLESS, attempt):
        row = VERBS[name].endless
        assert row and code == row.code, f"{name}: {shown}"
        assert is_clean(shown), f"{name}: {shown}"


def test_zenohs_own_race_was_rare(busy: Wire) -> None:
    assert len(RACED) <= MAX_RACES, RACED
