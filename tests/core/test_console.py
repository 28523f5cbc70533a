"""A report is one line that the terminal survives."""

import re
import subprocess
import sys
from subprocess import PIPE

import pytest

from holozen.console import KEPT, printable, report


def test_a_line_is_written_to_stderr(capsys: pytest.CaptureFixture[str]) -> None:
    report("sim: ready")
    assert capsys.readouterr() == ("", "sim: ready\n")


def test_what_came_over_the_wire_cannot_move_the_cursor_or_start_a_line() -> None:
    assert printable("cmd_vel: from \x1b[2Jme\nand\ryou") == "cmd_vel: from ?[2Jme?and?you"
    assert printable("grün ▶ 10 °") == "grün ▶ 10 °"


def test_report_prints_only_what_is_printable(capsys: pytest.CaptureFixture[str]) -> None:
    report("one\ntwo")
    assert capsys.readouterr().err == "one?two\n"


def test_a_terminal_that_is_gone_is_no_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    class Gone:
        def write(self, _text: str) -> int:
            raise OSError("gone")

    monkeypatch.setattr(sys, "stderr", Gone())
    report("anybody?")


@pytest.mark.parametrize("blocks", [True, False])
def test_unread_samples_are_dropped_and_counted_when_the_reader_goes_on(blocks: bool) -> None:
    """Another process that shares the terminal or pipe may make it non-blocking."""
    code = (
        "import os, sys\nfrom holozen.console import KEPT, drain, report\n"
        f"os.set_blocking(2, {blocks})\n"
        "for number in range(2000):\n report(f'{number:099}')\n"
        "print('wrote all', flush=True)\nsys.stdin.readline()\ndrain(20)"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], stdin=PIPE, stdout=PIPE, stderr=PIPE, text=True
    ) as process:
        assert process.stdin and process.stdout and process.stderr
        assert process.stdout.readline() == "wrote all\n"
        process.stdin.write("\n")
        process.stdin.close()
        lines = process.stderr.read().splitlines()
    written = [int(line) for line in lines if line.isdigit()]
    # Dropped more than once where the writing thread comes to its turn in between.
    notices = [line for line in lines if not line.isdigit()]
    dropped = [
        re.fullmatch(r"\.\.\. and (\d+) more lines? w\w+ dropped, as the output was not read", line)
        for line in notices
    ]
    assert written == sorted(written)
    assert len(written) >= KEPT
    assert len(written) + sum(int(notice[1]) for notice in dropped if notice) == 2000
    assert notices and all(dropped)


def test_the_last_line_is_written_before_a_process_ends() -> None:
    code = (
        "import os, threading\nfrom holozen.console import report\nfor n in range(100):\n "
        "report('a line')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30)
    assert (done.returncode, done.stderr) == (0, "a line\n" * 100)


STALLS = """
import _thread, itertools, os, time, types
from holozen import console
begun = _thread.start_new_thread
times = itertools.count()
clock = lambda: 0.25 * min(next(times), 8)  # it stands before `drain` gives up
setattr(console, "time", types.SimpleNamespace(monotonic=clock))
def late(work, words):
    time.sleep(0.1)
    work(*words)
setattr(console, "_thread", types.SimpleNamespace(start_new_thread=lambda *work: begun(late, work)))
console.report("the reason")
console.drain()
os._exit(0)
"""


def test_the_last_line_is_written_on_a_machine_that_stalls_while_it_waits() -> None:
    """Each of the first looks at the clock is a quarter of a second after the one before."""
    done = subprocess.run(
        [sys.executable, "-c", STALLS], capture_output=True, text=True, timeout=60
    )
    assert done.stderr == "the reason\n"


LATE = """
import _thread, time
start = _thread.start_new_thread
_thread.start_new_thread = lambda run, args: start(lambda: (time.sleep(0.1), run(*args)), ())
from holozen.console import report
from holozen.process import quiet
report("said before")
with quiet():
    time.sleep(0.3)
"""


def test_what_is_said_before_a_silence_is_written_though_its_thread_runs_late() -> None:
    done = subprocess.run([sys.executable, "-c", LATE], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "said before\n")
