"""Every verb beside what runs, beside nobody, and interrupted: no traceback, one line, the right exit code.

All tries of a kind run side by side, each as a process; a test looks at the one of its verb.
"""

import argparse
import json
import os
import re
import shlex
import socket
import subprocess
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
import zenoh

from holozen import cli, data
from holozen.cli.spawn import Place, spawn_file
from holozen.testing import Terminal, Wire, wait_for
from holozen.testing.wire import command, free_port

from .conftest import start_sim, stranger_config
from .test_strangers import PUTS
from .verbs import VERBS, Row

BOT = data.find("urdf", "hb_bot.urdf.xacro")
BALL = """<robot name="ball"><link name="b"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>
<collision><geometry><sphere radius="0.1"/></geometry></collision></link></robot>"""
SIDE_BY_SIDE, MANY = 12, 40  # processes at once: those that work, and those that mostly wait

RACE = "dispatcher/resource.rs"  # where a thread of Zenoh's may panic: eclipse-zenoh/zenoh#2624

Done = subprocess.CompletedProcess[str]
Try = Callable[[str], Any]

LIVE = [name for name, row in VERBS.items() if row.live is not None]
TEXT = [name for name in LIVE if not (VERBS[name].stranger or VERBS[name].endless)]  # the others print it there
WRONG = [name for name, row in VERBS.items() if row.wrong]
ON_THE_WIRE = [name for name in LIVE if VERBS[name].bus]
SILENT = [name for name, row in VERBS.items() if row.silent]
STRANGERS = [name for name, row in VERBS.items() if row.stranger]
ENDLESS = [name for name, row in VERBS.items() if row.endless]
WAITING = [name for name in ON_THE_WIRE if not VERBS[name].endless and name != "doctor"]


def verbs_of(parser: argparse.ArgumentParser) -> list[str]:
    """The names of a parser's verbs; its own where it has none."""
    found = [action.choices for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    own = parser.prog.removeprefix("holozen ")
    return [f"{own} {name}" for choices in found for name in choices] or [own]


def test_every_verb_has_a_row() -> None:
    assert list(VERBS) == [name for verb in cli.VERBS for name in verbs_of(cli.module(verb).parser())]


class Town:
    """A sim with robots, a pose service, and a stranger who talks on many keys, listens and answers."""

    def __init__(self, wire: Wire, tmp: Path) -> None:
        self.wire, self.tmp = wire, tmp
        (tmp / "ball.urdf").write_text(BALL)
        (tmp / "odd.urdf").write_text("<robot/>")
        (tmp / "sim.yaml").write_text("sim:\n  ros__parameters:\n    max_linear: 1.5\n")
        start_sim(wire)
        spawn_file(wire.bus("setup"), BOT, "Spare", Place(x=2.0))
        for n, x in (("text", -2.0), ("json", -3.0), ("pipe", -4.0)):
            spawn_file(wire.bus("setup"), tmp / "ball.urdf", f"Doomed{n}", Place(x=x))
        wire.start("pose-service").wait_for_line("goals")
        done = wire.run("record", "odom", "-o", f"{tmp}/bag", "--max-duration", "1")
        assert done.returncode == 0, done.stderr

    def words(self, name: str, words: str, n: str) -> list[str]:
        """The words of a verb, filled in."""
        files = {"bot": BOT} | {key: self.tmp / file for key, file in FILES.items()}
        return [*name.split(), *shlex.split(words.format(n=n, id=n + "".join(name.split()), tmp=self.tmp, **files))]


FILES = {"ball": "ball.urdf", "odd": "odd.urdf", "yaml": "sim.yaml", "bag": "bag.mcap"}


@pytest.fixture(scope="module")
def place(town: Wire, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Town]:
    place, done = Town(town, tmp_path_factory.mktemp("verbs")), threading.Event()
    with zenoh.open(stranger_config(town)) as session:
        heard = session.declare_subscriber("a/heard", zenoh.handlers.RingChannel(1))
        asked = session.declare_queryable("a/asked", lambda query: query.reply("a/asked", b'{"x": 1}'))
        talker = threading.Thread(target=_talk, args=(session, done))
        talker.start()
        yield place
        done.set()
        talker.join()
        del heard, asked


def _talk(session: zenoh.Session, done: threading.Event) -> None:
    while not done.wait(0.05):
        for key, (payload, encoding) in PUTS.items():
            session.put(key, payload, encoding=encoding)


class Tries:
    """What came of the same try with many verbs, made side by side when the first is asked for."""

    def __init__(self, names: list[str], attempt: Try, at_once: int = SIDE_BY_SIDE) -> None:
        self._names, self._attempt, self._at_once = names, attempt, at_once
        self._made: dict[str, Future[Any]] = {}

    def __getitem__(self, name: str) -> Any:
        if not self._made:
            with ThreadPoolExecutor(self._at_once) as pool:
                self._made = {each: pool.submit(self._attempt, each) for each in self._names}
        return self._made[name].result()


def run(words: list[str], stdout: Any = subprocess.PIPE) -> Done:
    """Run it to its end; once more where Zenoh's own race made a noise, which many who come and go bring on."""
    done = _run(words, stdout)
    return _run(words, stdout) if RACE in done.stderr else done


def _run(words: list[str], stdout: Any) -> Done:
    return subprocess.run(
        [*command("")[:-1], *words],
        stdin=subprocess.DEVNULL,
        stdout=stdout,
        stderr=subprocess.PIPE,
        text=True,
        timeout=60,
    )


def flags(row: Row, wire: Wire) -> list[str]:
    return wire.flags if row.bus else []


def is_clean(text: str) -> bool:
    return not any(word in text for word in ("Traceback", "Exception ignored", "Error:", "panicked"))


def assert_one_line(done: Done, code: int, part: str) -> None:
    assert done.returncode == code, done.stderr
    assert (len(done.stderr.splitlines()), part in done.stderr) == (1, True), done.stderr
    assert done.stdout == ""


# --- beside what runs


@pytest.fixture(scope="module")
def in_text(place: Town) -> Tries:
    def attempt(name: str) -> Done:
        row = VERBS[name]
        return run(place.words(name, row.live or "", "text") + flags(row, place.wire))

    return Tries(TEXT, attempt)


@pytest.mark.parametrize("name", TEXT)
def test_it_does_its_work(in_text: Tries, name: str) -> None:
    done = in_text[name]
    assert done.returncode in {VERBS[name].code, int(name == "doctor")}, done.stderr
    assert (done.stdout or done.stderr) and is_clean(done.stderr)


@pytest.fixture(scope="module")
def in_json(place: Town) -> Tries:
    def attempt(name: str) -> Done:
        row = VERBS[name]
        return run([*place.words(name, row.live or "", "json"), "--json", *flags(row, place.wire)])

    return Tries(LIVE, attempt)


@pytest.mark.parametrize("name", LIVE)
def test_as_json_it_is_one_object_a_line(in_json: Tries, name: str) -> None:
    done = in_json[name]
    assert done.returncode in {VERBS[name].code, int(name == "doctor")}, done.stderr
    assert done.stdout and all(isinstance(json.loads(line), dict) for line in done.stdout.splitlines())
    assert is_clean(done.stderr)


@pytest.fixture(scope="module")
def into_nothing(place: Town) -> Tries:
    def attempt(name: str) -> Done:
        reading, writing = os.pipe()
        os.close(reading)
        row = VERBS[name]
        with open(writing, "wb") as gone:
            return run([*place.words(name, row.live or "", "pipe"), "--json", *flags(row, place.wire)], gone)

    return Tries(LIVE, attempt)


@pytest.mark.parametrize("name", LIVE)
def test_a_reader_that_is_gone_ends_it_quietly(into_nothing: Tries, name: str) -> None:
    done = into_nothing[name]
    assert done.returncode == 0, done.stderr
    assert is_clean(done.stderr) and "Broken pipe" not in done.stderr


@pytest.fixture(scope="module")
def wrongly(place: Town) -> Tries:
    def attempt(name: str) -> Done:
        row = VERBS[name]
        return run(place.words(name, (row.wrong or ("",))[0], "wrong") + flags(row, place.wire))

    return Tries(WRONG, attempt)


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_one_line(wrongly: Tries, name: str) -> None:
    _, code, part = VERBS[name].wrong or ("", 0, "")
    assert_one_line(wrongly[name], code, part)


@pytest.fixture(scope="module")
def beside_strangers(place: Town) -> Tries:
    def attempt(name: str) -> Done:
        words, _ = VERBS[name].stranger or ("", "")
        return run(place.words(name, words, "stranger") + place.wire.flags)

    return Tries(STRANGERS, attempt)


@pytest.mark.parametrize("name", STRANGERS)
def test_it_does_its_work_with_strangers(beside_strangers: Tries, name: str) -> None:
    done, (_, part) = beside_strangers[name], VERBS[name].stranger or ("", "")
    assert (done.returncode, is_clean(done.stderr)) == (0, True), done.stderr
    assert part in done.stdout


# --- beside nobody


@pytest.fixture(scope="module")
def in_silence(place: Town) -> Tries:
    def attempt(name: str) -> Done:
        words, _, _ = VERBS[name].silent or ("", 0, "")
        with Wire() as own:
            return run(place.words(name, words, "silent") + own.flags)

    return Tries(SILENT, attempt, MANY)


@pytest.mark.parametrize("name", SILENT)
def test_where_nobody_is_it_says_so(in_silence: Tries, name: str) -> None:
    _, code, part = VERBS[name].silent or ("", 0, "")
    done = in_silence[name]
    said = done.stderr.splitlines()
    if name.endswith("record"):
        assert said.pop(0).startswith("recording odom into ")
    assert (done.returncode, len(said)) == (code, 1), done.stderr
    assert part in said[0] and is_clean(done.stderr)


@pytest.fixture(scope="module")
def without_router(place: Town) -> Tries:
    nowhere = ["--mode", "client", "--connect", f"tcp/127.0.0.1:{free_port()}"]

    def attempt(name: str) -> Done:
        return run(place.words(name, VERBS[name].live or "", "alone") + nowhere)

    return Tries(ON_THE_WIRE, attempt, MANY)


@pytest.mark.parametrize("name", ON_THE_WIRE)
def test_a_client_without_a_router_gives_up(without_router: Tries, name: str) -> None:
    done = without_router[name]
    if name == "doctor":
        assert done.returncode == 1 and "no router answers at " in done.stdout and is_clean(done.stderr)
    else:
        assert_one_line(done, 1, "cannot open Zenoh: no router answers at ")


# --- interrupted


@pytest.fixture(scope="module")
def interrupted(place: Town) -> Tries:
    def attempt(name: str) -> tuple[int, str]:
        row = VERBS[name]
        assert row.endless
        with Wire() as own:
            wire = own if row.live is None else place.wire
            begun, words = row.endless.begun, place.words(name, row.endless.words, "endless")
            with Terminal([*command("")[:-1], *words, *flags(row, wire)]) as terminal:
                wait_for(lambda: re.search(begun, terminal.raw), 20, lambda: f"{begun} in {terminal.raw[-2000:]}")
                terminal.type("\x03")
                return terminal.process.wait(), terminal.raw

    return Tries(ENDLESS, attempt)


@pytest.mark.parametrize("name", ENDLESS)
def test_ctrl_c_ends_what_would_go_on(interrupted: Tries, name: str) -> None:
    code, shown = interrupted[name]
    row = VERBS[name].endless
    assert row and code == row.code, shown
    assert is_clean(shown)


@pytest.fixture(scope="module")
def kept_waiting(place: Town) -> Tries:
    """Interrupted while they wait for a router that takes their call and then says nothing."""

    def attempt(name: str) -> tuple[int, str]:
        with socket.create_server(("127.0.0.1", 0)) as mute:
            mute.settimeout(30)
            there = ["--mode", "client", "--connect", f"tcp/127.0.0.1:{mute.getsockname()[1]}"]
            words = place.words(name, VERBS[name].live or "", "waiting")
            with Terminal([*command("")[:-1], *words, *there]) as terminal, mute.accept()[0]:
                terminal.type("\x03")
                return terminal.process.wait(), terminal.raw

    return Tries(WAITING, attempt, MANY)


@pytest.mark.parametrize("name", WAITING)
def test_ctrl_c_ends_what_waits(kept_waiting: Tries, name: str) -> None:
    code, shown = kept_waiting[name]
    assert (code, is_clean(shown)) == (130, True), shown
