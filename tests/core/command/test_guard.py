"""A base's guard stops the wheels when the base's process has ended in any way, or hangs."""

import signal
import sys
from pathlib import Path
from typing import Any

import pytest

from holozen.command.guard import Guard, GuardError
from holozen.messages import Twist
from holozen.testing import Process, Wire, wait_for

BASE = """
import os, sys, time
from pathlib import Path
from holozen.bus import Bus, Connection
from holozen.command.base import Base
from holozen.command.guard import Guard
wheels, hang, endpoint, state = *map(Path, sys.argv[1:3]), *sys.argv[3:]
def drive(x):
    (new := wheels.with_suffix(f".{os.getpid()}")).write_text(str(x))
    new.replace(wheels)
guard = Guard(lambda: drive(0.0))
with Bus("base", Connection(connect=(endpoint,), listen=(endpoint,)), lasting=True) as bus:
    base = Base(bus, guard=guard, state=state)
    drive(0.0)
    print("drives", flush=True)
    while True:
        x, _, _ = base.velocity()
        drive(x)
        base.publish((x, 0.0, 0.0))
        while hang.exists():
            time.sleep(0.01)
        time.sleep(0.01)
"""


@pytest.mark.parametrize("end", ["SIGSEGV", "SIGKILL", "hang"])
def test_the_wheels_of_a_base_stand_once_its_process_has_ended_or_its_loop_hangs(
    end: str, wire: Wire, tmp_path: Path
) -> None:
    wheels, hang = tmp_path / "wheels", tmp_path / "hang"
    words = [sys.executable, "-c", BASE, str(wheels), str(hang), wire.endpoint, str(tmp_path)]
    commands: Any = wire.bus("driver").publisher("cmd_vel", Twist)
    with Process(words) as base:
        base.wait_for_line("drives")
        wait_for(lambda: commands.put(Twist.planar(0.3)) or float(wheels.read_text()) == 0.3)
        if end == "hang":
            hang.touch()
        else:
            base.signal(getattr(signal, end))
            assert base.wait() == -getattr(signal, end)
        wait_for(lambda: commands.put(Twist.planar(0.3)) or float(wheels.read_text()) == 0.0)
        if end == "hang":  # and its loop turns them again, once it goes on
            hang.unlink()
            wait_for(lambda: commands.put(Twist.planar(0.3)) or float(wheels.read_text()) == 0.3)


def test_a_guard_is_started_before_there_are_threads() -> None:
    import threading

    end = threading.Event()
    thread = threading.Thread(target=end.wait)
    thread.start()
    try:
        with pytest.raises(GuardError, match="start the guard before the Bus"):
            Guard(lambda: None)
    finally:
        end.set()
        thread.join()
