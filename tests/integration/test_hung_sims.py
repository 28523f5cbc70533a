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
SLOW = ("--rtf", "0.2")  # nothing here waits for a sim's time
FREES = [("list",), ("doctor",), ("release",), ("sim", "play")]
HOLDS = [("stop",), ("stop", "Fred"), ("stop", "Bob"), ("sim", "pause"), ("sim", "reset")]
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


def test_what_is_said_to_all_sims_names_one_that_hangs_and_reaches_it_once_it_goes_on(
    verb: Verb, wire: Wire
) -> None:
    first = wire.start("sim", *SLOW, "--robot", f"{BOT}=Fred")
    first.wait_for_line("Fred listens on")
    second = wire.start("sim", *SLOW, "--join", "--robot", f"{BOT}=Bob")
    second.wait_for_line("Bob listens on")
    client = wire.start("stop", "--mode", "client")
    assert (client.wait(), stopped(client.out)) == (0, BOTH), "one sim passes it on to the other"
    for says, hung, lost in ((FREES, second, "Bob"), (HOLDS, first, "Fred")):
        left = list(says)
        wait_for(
            lambda left=left, hung=hung, lost=lost: all_name_it(verb, wire, left, hung, lost),  # type: ignore[misc]
            120,
            what="all to be said in time",
        )
    comes_to(BOTH, lambda: stopped(verb(wire, "stop").stdout))
    done = verb(wire, "sim", "pause")
    assert (done.returncode, done.stdout) == (0, "paused\n")


def all_name_it(
    verb: Verb, wire: Wire, left: list[tuple[str, ...]], hung: Process, lost: str
) -> bool:
    """Whether all that is left to say was said in time while a sim hung. What ends later is left:
    Zenoh may have given the link up.
    """
    comes_to(BOTH, lambda: stopped(verb(wire, "stop").stdout))  # so each is known to the other
    assert verb(wire, "release").returncode == 0
    hung.signal(signal.SIGSTOP)
    (other,) = {*BOTH} - {lost}
    began = time.monotonic()
    said = {words: wire.start(*words) for words in left}
    for words, process in said.items():
        code = process.wait()
        if time.monotonic() - began < IN_TIME:
            left.remove(words)
            lines, concerns = refusals(process), words != ("stop", other)
            assert code == concerns, words
            assert any(lost in line for line in lines) == concerns, (words, lines)
            assert not any(other in line for line in lines), (words, lines)
    hung.signal(signal.SIGCONT)
    return not left


def refusals(process: Process) -> list[str]:
    """What it wrote of those that do not answer."""
    return [line for line in (process.out + process.err).splitlines() if "not answer" in line]


@NEEDS
def test_a_peer_without_multicast_hides_none_that_hangs() -> None:
    with Lab() as lab:
        machine = lab.host("machine")
        for name in BOTH:
            words = ("sim", *SLOW, "--join", "--robot", f"{BOT}={name}")
            hung = machine.start(*command(*words))
            hung.wait_for_line(f"{name} listens on")
        machine.start(sys.executable, "-c", FOREIGN).wait_for_line("linked")
        comes_to(BOTH, lambda: stopped(machine.run(*command("stop")).stdout))
        hung.signal(signal.SIGSTOP)
        stop = machine.start(*command("stop"))
        assert stop.wait() == 1
        assert "Fred did not confirm" in stop.err
