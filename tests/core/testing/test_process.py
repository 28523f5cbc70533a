"""The processes of holozen.testing: what is forked is what a new Python would be, and ends with the
test.
"""

import json
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from holozen.testing import Process, Terminal, Wire, wait_for
from holozen.testing.wire import command
from tests.present import needs

SHOWS = """
import json, os, signal, sys, threading
streams = sys.stdin, sys.stdout, sys.stderr
print(json.dumps({
    "words": sys.argv,
    "folder": os.getcwd(),
    "variables": dict(os.environ),
    "streams": [(s.name, s.encoding, s.errors, s.line_buffering, s.write_through, s.isatty()) for s in streams],
    "files": sorted(os.listdir("/proc/self/fd"))[:-1],
    "leads": (os.getsid(0), os.getpgrp()) == (os.getpid(), os.getpid()),
    "terminal": [os.tcgetpgrp(fd) == os.getpid() for fd in range(3) if os.isatty(fd)],
    "signals": [str(signal.getsignal(number)) for number in range(1, 32)],
    "threads": threading.active_count(),
}), flush=True)
sys.exit(3)
"""  # noqa: E501


@needs("run")
def test_a_verb_that_is_forked_is_as_in_a_new_python(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("shows.py").write_text(SHOWS)
    words = command("run", "shows.py", "--ros-args", "-p", "speed:=ü")

    def shown(is_new: bool, terminal: bool) -> dict[str, Any]:
        env = {"ONLY": "here", "EMPTY": ""}
        if terminal:
            with Terminal(words, env=env, is_new=is_new) as window:
                assert window.process.wait() == 3
                return dict(json.loads(window.raw))
        with Process(words, env=env, is_new=is_new) as process:
            assert process.wait() == 3
            return dict(json.loads(process.out))

    for terminal in (False, True):
        facts = shown(False, terminal)
        assert facts == shown(True, terminal)
        assert (facts["variables"]["ONLY"], facts["folder"], facts["leads"]) == (
            "here",
            str(tmp_path),
            True,
        )


ENDS = """
import os, sys
from holozen.testing import Process
from holozen.testing.wire import command
sleeper = Process(command("run", "sleeps.py"))
sleeper.wait_for_line("sleeps")
print(sleeper.pid, flush=True)
os.kill(os.getpid(), 9)
"""


@needs("run")
def test_what_is_forked_ends_as_it_is_told_and_with_its_test(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("sleeps.py").write_text('import time\nprint("sleeps", flush=True)\ntime.sleep(60)')
    with Process(command("run", "sleeps.py")) as process:
        process.wait_for_line("sleeps")
        with pytest.raises(AssertionError, match="still runs"):
            process.wait(0.01)
        assert process.kill() == process.returncode == -signal.SIGKILL
        process.signal(signal.SIGTERM)  # which nothing gets
    done = subprocess.run([sys.executable, "-c", ENDS], capture_output=True, text=True, timeout=60)
    assert done.returncode == -signal.SIGKILL, done.stderr
    wait_for(
        lambda: not Path(f"/proc/{int(done.stdout)}").exists(),
        what="the end of what a killed test had started",
    )


def test_a_ctrl_c_at_the_start_of_what_is_forked_ends_it_without_a_traceback() -> None:
    for _ in range(20):
        with Process(command("--version")) as process:
            process.signal(signal.SIGINT)
            assert process.wait() in (-signal.SIGINT, 130, 0)
            assert not process.err


def test_a_verb_is_forked_whatever_another_has_set_in_the_test_itself(
    wire: Wire, call: Callable[..., object], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    for _ in range(2):
        echo = wire.start("topic", "echo", "nothing")
        assert "fork_server" in Path(f"/proc/{echo.pid}/cmdline").read_text()
        call("topic", "list", *wire.flags)
