"""A sim that hangs is named by all that is said to every sim: nothing claims that its robots obeyed."""

import signal
from collections.abc import Iterator

import pytest

from holozen.testing import Process, Wire
from holozen.testing.wire import command

from .robots import URDF

BOT = URDF / "hb_bot.urdf.xacro"
STOPPED = ["Bob is stopped", "Fred is stopped"]
SAYS = [("stop",), ("release",), ("sim", "pause"), ("sim", "play"), ("sim", "reset"), ("list",), ("doctor",)]


@pytest.fixture
def hung(wire: Wire) -> Iterator[Process]:
    """A sim with Bob that is suspended, beside one with Fred."""
    wire.start("sim", "--robot", f"{BOT}=Fred").wait_for_line("Fred listens on")
    hung = wire.start("sim", "--join", "--robot", f"{BOT}=Bob")
    hung.wait_for_line("Bob listens on")
    assert sorted(wire.run("stop").stdout.splitlines()) == STOPPED  # so each is known to the other
    assert wire.run("release").returncode == 0
    hung.signal(signal.SIGSTOP)
    yield hung
    hung.signal(signal.SIGCONT)


@pytest.mark.parametrize("words", SAYS, ids=" ".join)
def test_what_is_said_to_all_sims_names_one_that_hangs(wire: Wire, hung: Process, words: tuple[str, ...]) -> None:
    done = wire.run(*words)
    assert done.returncode == 1, done
    (line,) = [line for line in (done.stdout + done.stderr).splitlines() if "not answer" in line]
    assert "Bob" in line and "Fred" not in line, line


def test_one_that_goes_on_is_told_again(wire: Wire, hung: Process) -> None:
    assert wire.run("stop", "Fred").returncode == 0, "the other one is not concerned"
    assert "Bob did not confirm" in wire.run("stop", "Bob").stderr
    assert "sim" in wire.run("sim", "pause").stderr
    hung.signal(signal.SIGCONT)
    hung.wait_for_line("overrun")
    assert sorted(wire.run("stop").stdout.splitlines()) == STOPPED
    done = wire.run("sim", "pause")
    assert (done.returncode, done.stdout) == (0, "paused\n")


def test_a_client_of_one_sim_reaches_the_other_through_it(wire: Wire) -> None:
    wire.start("sim", "--robot", f"{BOT}=Fred").wait_for_line("Fred listens on")
    wire.start("sim", "--join", "--robot", f"{BOT}=Bob").wait_for_line("Bob listens on")
    with Process(command("stop", "--mode", "client", "--connect", wire.endpoint)) as stop:
        assert stop.wait() == 0, stop.err
        assert sorted(stop.out.splitlines()) == STOPPED
