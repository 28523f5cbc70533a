"""A sim that hangs is named by all that is said to every sim: nothing claims that its robots
obeyed.
"""

import signal
import sys
import time

from holozen.testing import Process, Wire, wait_for
from holozen.testing.wire import command
from tests.faults.namespaces import NEEDS, Lab

from .conftest import Verb, comes_to
from .processes import stopped
from .robots import URDF

IN_TIME = 8.0  # s; after 10 s Zenoh gives a silent peer up
BOT = URDF / "hb_bot.urdf.xacro"
BOTH = ["Bob", "Fred"]
FREES = [("list",), ("doctor",), ("release",), ("sim", "play")]
HOLDS = [("stop",), ("sim", "pause"), ("sim", "reset")]
"""Apart: what frees is refused where it may have been sent before what holds."""
FOREIGN = """
import threading, zenoh
config = zenoh.Config()
config.insert_json5("scouting/multicast/enabled", "false")
config.insert_json5("connect/endpoints", '["tcp/127.0.0.1:7447"]')
with zenoh.open(config) as session:
    while not session.info.peers_zid():
        pass
    print("linked", flush=True)
    threading.Event().wait()
"""
"""A peer that has no multicast: the processes on loopback cannot count it."""


def two_sims(wire: Wire) -> Process:
    """A sim with Fred, and one with Bob, which is returned."""
    wire.start("sim", "--robot", f"{BOT}=Fred").wait_for_line("Fred listens on")
    sim = wire.start("sim", "--join", "--robot", f"{BOT}=Bob")
    sim.wait_for_line("Bob listens on")
    return sim


def test_what_is_said_to_all_sims_names_one_that_hangs_and_reaches_it_once_it_goes_on(
    verb: Verb, wire: Wire
) -> None:
    hung = two_sims(wire)
    for says in (FREES, HOLDS):
        left = list(says)

        def all_name_it(left: list[tuple[str, ...]] = left) -> bool:
            """Those that end later than that are asked again: Zenoh may have given the link up."""
            comes_to(
                BOTH, lambda: stopped(verb(wire, "stop").stdout)
            )  # so each is known to the other
            assert verb(wire, "release").returncode == 0
            hung.signal(signal.SIGSTOP)
            began = time.monotonic()
            said = {words: wire.start(*words) for words in left}
            for words, process in said.items():
                code = process.wait()
                if time.monotonic() - began < IN_TIME:
                    left.remove(words)
                    lines = refusals(process)
                    assert code == 1, words
                    assert any("Bob" in line for line in lines), (words, lines)
                    assert not any("Fred" in line for line in lines), (words, lines)
            hung.signal(signal.SIGCONT)
            return not left

        wait_for(all_name_it, 120, what="all to be said in time")
    comes_to(BOTH, lambda: stopped(verb(wire, "stop").stdout))
    done = verb(wire, "sim", "pause")
    assert (done.returncode, done.stdout) == (0, "paused\n")


def refusals(process: Process) -> list[str]:
    """What it wrote of those that do not answer."""
    return [line for line in (process.out + process.err).splitlines() if "not answer" in line]


def test_one_that_is_named_concerns_no_other(wire: Wire) -> None:
    two_sims(wire).signal(signal.SIGSTOP)
    bob, fred = wire.start("stop", "Bob"), wire.start("stop", "Fred")
    assert (bob.wait(), "Bob did not confirm" in bob.err) == (1, True)
    assert fred.wait() == 0


def test_the_first_one_is_named_by_the_next(verb: Verb, wire: Wire) -> None:
    hung = wire.start("sim", "--robot", f"{BOT}=Fred")
    hung.wait_for_line("Fred listens on")
    wire.start("sim", "--join", "--robot", f"{BOT}=Bob").wait_for_line("Bob listens on")
    comes_to(BOTH, lambda: stopped(verb(wire, "stop").stdout))  # so each is known to the other
    hung.signal(signal.SIGSTOP)
    said = {words: wire.start(*words) for words in (("stop",), ("list",))}
    for words, process in said.items():
        assert process.wait() == 1, words
        assert "Fred" in "".join(refusals(process))


def test_a_client_of_one_sim_reaches_the_other_through_it(wire: Wire) -> None:
    two_sims(wire)
    with Process(command("stop", "--mode", "client", "--connect", wire.endpoint)) as stop:
        assert stop.wait() == 0, stop.err
        assert stopped(stop.out) == BOTH


@NEEDS
def test_a_peer_without_multicast_hides_none_that_hangs() -> None:
    with Lab() as lab:
        machine = lab.host("machine")
        for name in BOTH:
            hung = machine.start(*command("sim", "--join", "--robot", f"{BOT}={name}"))
            hung.wait_for_line(f"{name} listens on")
        machine.start(sys.executable, "-c", FOREIGN).wait_for_line("linked")
        comes_to(BOTH, lambda: stopped(machine.run(*command("stop")).stdout))
        hung.signal(signal.SIGSTOP)
        stop = machine.start(*command("stop"))
        assert stop.wait() == 1
        assert "Fred did not confirm" in stop.err
