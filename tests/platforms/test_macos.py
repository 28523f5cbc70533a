"""As on macOS: without what Linux alone has, `up` starts, drives and ends. No Mac is here; its
kernel is untried.
"""

from pathlib import Path

import pytest

from holozen.messages import Odometry
from holozen.testing import Wire, wait_for

LACKS = """
import ctypes, fcntl, os, signal, sys, time

for module, names in (
    (os, "memfd_create pipe2 O_PATH O_DIRECT pidfd_open O_TMPFILE sched_getaffinity eventfd setns unshare"),
    (fcntl, "F_SETPIPE_SZ F_GETPIPE_SZ"), (time, "CLOCK_BOOTTIME"), (signal, "pidfd_send_signal"),
):
    for name in names.split():
        if hasattr(module, name):
            delattr(module, name)

import ctypes.util  # before the platform has another name, with which it needs what Debian leaves out

def watch(event, arguments):
    if event in ("open", "os.listdir") and str(arguments[0]).startswith("/proc"):
        raise FileNotFoundError(2, "there is no /proc", arguments[0])

sys.addaudithook(watch)

class Library(ctypes.CDLL):
    def __getattr__(self, name):
        if name in ("prctl", "malloc_trim", "mallopt"):
            raise AttributeError(name)
        return super().__getattr__(name)

ctypes.CDLL = Library
sys.platform = "darwin"
"""  # noqa: E501


@pytest.fixture
def mac(tmp_path: Path) -> dict[str, str]:
    """The environment of processes that lack it, and all that they start."""
    (tmp_path / "sitecustomize.py").write_text(LACKS)
    return {"PYTHONPATH": str(tmp_path)}


def test_a_robot_is_started_and_driven_without_what_linux_alone_has(
    mac: dict[str, str], wire: Wire
) -> None:
    odom = wire.bus().latest("odom", Odometry)
    terminal = wire.terminal("up", env=mac)
    wait_for(lambda: odom.count > 3, 60, lambda: terminal.screen())
    terminal.wait_for_text("controller@")
    terminal.hold_until(",", lambda: "you drive" in terminal.screen())
    terminal.type("\x03")
    assert terminal.process.wait() == 0
    assert "warning: this kernel lacks Landlock and seccomp" in terminal.screen()
    assert "Traceback" not in terminal.raw


def test_the_doctor_finds_nothing_wrong_there(mac: dict[str, str], wire: Wire) -> None:
    doctor = wire.start("doctor", env=mac)
    assert doctor.wait(30) == 0, doctor.err
    assert "python: " in doctor.out and "Traceback" not in doctor.err
