"""What Ctrl-C leaves of scripts/test, which starts programs that here only wait."""

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

from holozen.testing import wait_for

REPO = Path(__file__).parents[2]
WAITS = f"""#!{sys.executable}
import os, pathlib, signal, time
if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # it is not ignored
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # which no sleep can overlook
pathlib.Path("started", str(os.getpid())).touch()
time.sleep(1000)
"""
CHECK = """#!/usr/bin/env bash
.venv/bin/python check
"""


def is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_ctrl_c_while_the_tests_are_collected_leaves_no_process_behind(tmp_path: Path) -> None:
    for folder in ("scripts", ".venv/bin", "started"):
        (tmp_path / folder).mkdir(parents=True)
    shutil.copy(REPO / "scripts" / "test", tmp_path / "scripts" / "test")
    programs = {
        ".venv/bin/python": WAITS,
        "scripts/check": CHECK,
        **dict.fromkeys(("scripts/venv", "scripts/parts"), "#!/bin/sh\n"),
    }
    for name, text in programs.items():
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o755)

    def started() -> list[int]:
        return [int(file.name) for file in (tmp_path / "started").iterdir()]

    with subprocess.Popen(
        [tmp_path / "scripts" / "test", "-k", "nothing"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,
    ) as script:
        try:
            wait_for(lambda: len(started()) == 4, what="the check, both halves and the tables")
            os.killpg(script.pid, signal.SIGINT)  # as a terminal does
            wait_for(lambda: not any(map(is_alive, started())), what="their end")
        finally:
            for pid in filter(is_alive, started()):
                os.kill(pid, signal.SIGKILL)
        printed, _ = script.communicate()
    assert (script.returncode, printed) == (130, b"")
