"""Expansions of xacro files without the start of a new Python, for tests of the text and of the
errors.
"""

import io
import os
import pickle
import signal
import sys
from collections.abc import Mapping
from importlib import import_module

import pytest
from msgspec.structs import replace

from holozen.robot.files import xacro, xacro_child
from holozen.robot.files.uris import VARIABLES
from holozen.robot.files.xacro import XacroFile
from holozen.system import memory_file


@pytest.fixture
def forked(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each expansion is in a fork of this process, without the start of a Python, and with all
    limits but that of memory, which this process may have passed. For tests of the text and of the
    errors; those of what an expansion may do, and take, have a real one.
    """
    import_module("xacro.substitution_args")  # once, not in each fork
    monkeypatch.setattr(xacro, "_ask", _ask_fork)


def _ask_fork(file: XacroFile, outside: Mapping[str, bool]) -> tuple[int, bytes]:
    plain = replace(
        file, args=dict(file.args), packages=dict(file.packages), allow_env=[*file.allow_env]
    )
    question = pickle.dumps((plain, outside, [*os.environ]))
    with memory_file("reply") as reply:
        if (child := os.fork()) == 0:
            try:
                for name in {*os.environ}.difference(VARIABLES, file.allow_env):
                    del os.environ[name]
                os.dup2(reply.fileno(), 1)
                sys.stdin = io.TextIOWrapper(io.BytesIO(question))
                signal.signal(signal.SIGALRM, signal.SIG_DFL)
                signal.alarm(int(xacro.PATIENCE))
                xacro_child.MAX_MEMORY = 1 << 40
                xacro_child.main()
            finally:
                os._exit(1)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        reply.seek(0)
        return code, reply.read()
