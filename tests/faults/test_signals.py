"""Random signals in any state of any process: each ends on SIGTERM afterwards, quietly, and leaves
nothing behind.
"""

import contextlib
import random
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from holozen.messages import Odometry
from holozen.testing import Process, Terminal, Wire, wait_for

ENDS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]
OTHERS = [
    signal.SIGTSTP,
    signal.SIGCONT,
    signal.SIGWINCH,
    signal.SIGCHLD,
    signal.SIGPIPE,
    signal.SIGSTOP,
]
DEADLY = [signal.SIGUSR1, signal.SIGUSR2, signal.SIGALRM, signal.SIGKILL, signal.SIGQUIT]
"""Those that end any program that does not expect them."""

ROOT = Path(__file__).parents[2]
VERBS = [
    ["sim"],
    ["pose-service"],
    ["controller"],
    ["router"],
    ["topic", "echo", "odom"],
    ["topic", "pub", "cmd_vel", "{}"],
    ["record", "odom"],
    ["stop"],
    ["node", "list"],
]


def harass(process: Process, chance: random.Random, deadly: bool) -> list[int]:
    """Send a process some signals at arbitrary times of its life. Returns them."""
    sent = []
    time.sleep(chance.choice([chance.uniform(0.0, 0.5), chance.uniform(0.5, 2.0)]))
    for _ in range(chance.randint(1, 5)):
        number = chance.choice(ENDS + 2 * OTHERS + (DEADLY if deadly else []))
        process.signal(number)
        sent.append(int(number))
        time.sleep(chance.choice([0.0, chance.uniform(0.0, 0.3)]))
    process.signal(signal.SIGCONT)
    return sent


def shared_memory(process: Process) -> set[Path]:
    """The files of shared memory that a process has mapped now."""
    with contextlib.suppress(OSError):
        maps = Path(f"/proc/{process.pid}/maps").read_text().splitlines()
        return {Path(line.split()[5]) for line in maps if "/dev/shm/" in line}
    return set()


@pytest.mark.timeout(3600)
def test_random_signals_leave_no_process_no_traceback_and_no_shared_memory(
    wire: Wire, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, trials: Callable[[int, int], int]
) -> None:
    chance, used = random.Random(seed := random.randrange(10**6)), set[Path]()
    wire.start("sim").wait_for_line("listens on")
    odom = wire.bus().latest("odom", Odometry)
    monkeypatch.chdir(tmp_path)
    for trial in range(trials(1, 100)):
        with Wire() as other:
            for verb in chance.sample(VERBS, 4):
                process = (other if verb[0] in ("sim", "router") else wire).start(*verb)
                sent = harass(process, chance, deadly=True)
                used |= shared_memory(process)
                process.signal(signal.SIGTERM)
                what = f"seed {seed}, trial {trial}: {' '.join(verb)}, signals {sent}"
                assert process.wait(20) in {
                    0,
                    1,
                    130,
                    -signal.SIGTERM,
                    *(-number for number in sent),
                }, what
                assert not shows_traceback(process.err), f"{what}: {process.err}"
    count = odom.count
    wait_for(lambda: odom.count > count + 20, 20, "odom of the sim that got no signal")
    assert not [path for path in used if path.exists()], f"seed {seed}"


@pytest.mark.timeout(3600)
def test_random_signals_leave_a_tidy_terminal_and_a_robot_that_stands(
    wire: Wire, trials: Callable[[int, int], int]
) -> None:
    chance, used = random.Random(seed := random.randrange(10**6)), set[Path]()
    wire.start("sim").wait_for_line("listens on")
    odom = wire.bus().latest("odom", Odometry)
    for trial in range(trials(2, 100)):
        with wire.terminal("teleop", "--mode", "latch") as terminal:
            if chance.random() < 0.7:
                terminal.wait_for_text("listening")
                terminal.type("i")
            sent = harass(terminal.process, chance, deadly=False)
            used |= shared_memory(terminal.process)
            terminal.process.signal(signal.SIGTERM)
            what = f"seed {seed}, trial {trial}: {sent}"
            assert terminal.process.wait(20) in {
                0,
                1,
                130,
                -signal.SIGTERM,
                *(-number for number in sent),
            }, f"{what}: {terminal.raw}"
            assert not shows_traceback(terminal.raw), f"{what}: {terminal.raw}"
            assert terminal.modes() == terminal.modes_before, what
            assert_tidy(terminal, what)
        count = odom.count
        wait_for(
            lambda count=count: odom.count > count + 5 and stands(odom.read()[0]),  # type: ignore[misc]
            20,
            f"{what}: rest",
        )
    assert not [path for path in used if path.exists()], f"seed {seed}"


def shows_traceback(text: str) -> bool:
    """Whether a text holds a traceback of our own code. Python itself shows one on Ctrl-C while it
    starts.
    """
    traceback = text.partition("Traceback")[2]
    return any(f"{ROOT}/{folder}/" in traceback for folder in ("holozen", "services"))


def stands(odom: Odometry | None) -> bool:
    return odom is not None and abs(odom.twist.twist.linear.x) < 1e-6


def assert_tidy(terminal: Terminal, what: str) -> None:
    """Check that everything switched on is off again: the alternate screen, the hidden cursor,
    bracketed paste.
    """
    for on, off in (("1049h", "1049l"), ("25l", "25h"), ("2004h", "2004l")):
        assert terminal.raw.rfind(f"\x1b[?{on}") <= terminal.raw.rfind(f"\x1b[?{off}"), (
            f"{what}: {on}"
        )
