"""Runs `child`, and says what it was at when it had to be ended."""

import contextlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import IO

from holozen.robot.errors import RobotError, cut
from holozen.robot.xacro.inputs import Outcome

PATIENCE = 60.0  # s; the child's own limits count processor time and end it long before, unless it waits
_ROOT = str(Path(__file__).resolve().parents[3])
# Without `site`: what it would find is handed over, and the start takes half as long.
_BOOT = """
import json, sys
asked = json.load(sys.stdin)
sys.path[:] = asked["modules"]
from holozen.robot.xacro.child import main
main(asked)
"""


def run(path: Path, args: Mapping[str, str], packages: Mapping[str, Path]) -> Outcome:
    """Expand `path` in a process of its own. It takes 0.1 s, and ends whatever the file holds."""
    with os.fdopen(os.memfd_create("note"), "w+b") as note:  # a machine may have no folder to write in
        asked = {
            "path": str(path),
            "args": dict(args),
            "packages": {name: str(folder) for name, folder in packages.items()},
            "modules": [*map(str, sys.path), _ROOT],
            "note": note.fileno(),
        }
        code, reply, words = _ask(json.dumps(asked).encode(), note.fileno())
        with contextlib.suppress(ValueError):
            answer = json.loads(reply)
            answer["warnings"] = tuple(answer["warnings"])
            return Outcome(**answer)
        return Outcome(error=_ended(path, code, note, words))


def _ask(question: bytes, note: int) -> tuple[int, bytes, bytes]:
    """Exit code, standard output and standard error of the child."""
    words = [sys.executable, "-I", "-S", "-X", "utf8", "-c", _BOOT]
    pipe = subprocess.PIPE
    try:
        # A session of its own: Ctrl-C is for us, who end the child in any case.
        child = subprocess.Popen(words, stdin=pipe, stdout=pipe, stderr=pipe, pass_fds=(note,), start_new_session=True)
    except OSError as error:
        raise RobotError(f"cannot start {sys.executable} to expand xacro: {error.strerror}") from None
    try:
        out, err = child.communicate(question, PATIENCE)
    except subprocess.TimeoutExpired:
        out, err = b"", b""
    finally:
        child.kill()
        child.wait()
        _close(child)
    return child.returncode, out, err


def _close(child: "subprocess.Popen[bytes]") -> None:
    for stream in (child.stdin, child.stdout, child.stderr):
        with contextlib.suppress(OSError):
            if stream:
                stream.close()


def _ended(path: Path, code: int, note: IO[bytes], words: bytes) -> str:
    from holozen.robot.xacro.child import PROCESSOR_TIME
    from holozen.robot.xacro.trace import STEP_TIME

    where, what = _noted(path, note)
    if code == -signal.SIGPROF:
        return f"{where}: {what} takes longer than the {STEP_TIME:g} s that one may take"
    if code == -signal.SIGXCPU:
        return f"{where}: the file takes longer than the {PROCESSOR_TIME} s that all of it may take"
    if code == -signal.SIGKILL:
        return f"{where}: {what} was ended; it waited more than {PATIENCE:g} s or the machine is out of memory"
    told = words.decode("utf-8", "replace").strip().splitlines()[-1:] or [f"exit code {code}"]
    return f"{where}: xacro broke off at {what}: {told[0]}"


def _noted(path: Path, note: IO[bytes]) -> tuple[str, str]:
    try:
        file, line, expression = json.loads(os.pread(note.fileno(), 10_000, 0).split(b"\n")[0])
    except ValueError:
        return str(path), "the file"
    where = f"{file}, line {line}" if file else str(path)
    return where, f"the expression {cut(expression, 200)}" if expression else "this element"
