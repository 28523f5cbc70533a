"""At its end a process closes what it left open. It waits for threads that come out of Zenoh, and
not for ever.
"""

import gc
import os
import subprocess
import sys
import weakref
from types import SimpleNamespace

import pytest

from holozen.bus import Bus
from holozen.messages import Odometry
from holozen.testing import Wire, wait_for
from holozen.transport.session import Opening

ENDS = """
import threading, time
from holozen.transport import session

waited = threading.Event()

def leave():
    waited.wait()
    time.sleep({seconds})
    print("left", flush=True)

session.LAST = {last}
thread = threading.Thread(target=leave, daemon=True)
thread.start()
session.wait_for_threads((thread, None, threading.current_thread()), 0.01)
print("waited", flush=True)
waited.set()
"""


def reported(seconds: float, last: float) -> list[str]:
    """What it prints whose thread takes so many seconds, and is waited for during the `last`."""
    words = [sys.executable, "-c", ENDS.format(seconds=seconds, last=last)]
    return subprocess.run(
        words, capture_output=True, text=True, check=True, timeout=120
    ).stdout.split()


def test_a_late_thread_may_leave_before_the_process_ends() -> None:
    assert reported(0.1, 30.0) == ["waited", "left"]


def test_a_hanging_thread_does_not_keep_the_process() -> None:
    assert reported(3600, 0.1) == ["waited"]


UNCLOSED = """
import os, sys, threading
from types import SimpleNamespace
from holozen.bus import Bus, Connection
from holozen.messages import Odometry, TriggerReply, TriggerRequest

bus = Bus("unclosed", Connection(connect=(sys.argv[1],), listen=(sys.argv[1],)))
"""


@pytest.mark.parametrize(
    ("words", "code"),
    [
        ("kept = bus.publisher('odom', Odometry)", 0),
        ("kept = bus.latest('odom', Odometry)", 0),
        ("bus.serve('ask', TriggerRequest, TriggerReply, lambda _: TriggerReply()).start()", 0),
        ("bus.publisher('odom', Odometry); sys.exit(3)", 3),
        ("bus.publisher('odom', Odometry); bus.latest('odom', Odometry); 1 / 0", 1),
        (
            "bus.announce_node().ends.append(SimpleNamespace(undeclare=threading.Event().wait))  "
            "# a close that hangs",
            0,
        ),
        (
            "bus.publisher('odom', Odometry)\nif os.fork() == 0: "
            "sys.exit()\nsys.exit(os.wait()[1])",
            0,
        ),
    ],
)
def test_a_program_that_leaves_its_bus_open_ends_as_any_other(
    wire: Wire, words: str, code: int
) -> None:
    run = [sys.executable, "-c", UNCLOSED + words, wire.endpoint]
    done = subprocess.run(run, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout) == (code, "")
    # from Python 3.12 on
    shown = [line for line in done.stderr.splitlines() if "use of fork() may lead" not in line]
    assert shown[-1:] == (["ZeroDivisionError: division by zero"] if "1 / 0" in words else [])


SHORT_LIVES = """
import os, sys
from holozen.bus import Bus, Connection

def live(*listen):
    Bus("short", Connection(connect=(sys.argv[1],), listen=listen)).close()
    return len(os.listdir("/proc/self/fd"))

for listen in ([sys.argv[1]], []):
    before = live(*listen)
    print([live(*listen) for _ in range(20)][-1] - before)
"""


def test_a_bus_that_is_closed_at_once_leaves_no_link(wire: Wire) -> None:
    """Zenoh makes links in the background: in a group, and to those that gossip tells it of."""
    buses = [wire.bus(name) for name in ("first", "second", "third", "fourth")]
    wait_for(lambda: len(buses[-1].session.info.peers_zid()) == 3)
    run = [sys.executable, "-c", SHORT_LIVES, wire.endpoint]

    def leaves_none() -> bool:
        done = subprocess.run(run, capture_output=True, text=True, check=True, timeout=120)
        return max(map(int, done.stdout.split())) <= 3

    # each time 20 to 24 without the time to settle, which is too short now and then if all is busy
    wait_for(leaves_none, what="lives that leave no link")


def test_a_verb_does_not_show_what_zenoh_prints_as_it_closes(
    wire: Wire, capfd: pytest.CaptureFixture[str]
) -> None:
    bus = Bus("verb", Opening(wire.connection, early=True))
    bus.announce_node().ends.append(
        SimpleNamespace(undeclare=lambda: os.write(2, b"thread 'rx-1' panicked\n"))
    )
    bus.close()
    os.write(2, b"an error\n")
    assert capfd.readouterr().err == "an error\n"


def test_a_bus_that_was_closed_is_not_kept(wire: Wire) -> None:
    bus = Bus("closed", wire.connection)
    bus.publisher("odom", Odometry)
    bus.close()
    kept = weakref.ref(bus)
    del bus

    def is_gone() -> bool:
        gc.collect()
        return kept() is None

    wait_for(is_gone)


def test_a_forked_process_names_what_it_cannot_do(wire: Wire) -> None:
    words = """
odom, kept = bus.publisher('odom', Odometry), bus.subscribe('odom', Odometry)
for use in (lambda: Bus('child'), lambda: odom.put(Odometry()), lambda: bus.call('ask', TriggerRequest(), TriggerReply),
            kept.recv, kept.try_recv, lambda: bus.publisher('more', Odometry)):
    if os.fork() == 0:
        use()
    print(os.waitstatus_to_exitcode(os.wait()[1]), flush=True)
"""  # noqa: E501
    done = subprocess.run(
        [sys.executable, "-c", UNCLOSED + words, wire.endpoint],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.stdout.split() == ["1"] * 6
    reason = "BusError: cannot use Zenoh in a process that was forked from one which has used it: "
    assert done.stderr.count(reason) == 6 and "multiprocessing" in done.stderr


def test_a_process_forked_before_the_first_bus_opens_its_own(wire: Wire) -> None:
    program = UNCLOSED.replace("bus = ", "child = os.fork()\nbus = ")
    words = "if child: sys.exit(os.waitstatus_to_exitcode(os.wait()[1]))"
    run = [sys.executable, "-c", program + words, wire.endpoint]
    assert subprocess.run(run, timeout=120).returncode == 0
