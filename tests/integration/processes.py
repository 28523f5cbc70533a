"""What processes of a test print, leave in bags, and which of them run."""

import os
import re
import subprocess
from pathlib import Path

from holozen.bags import Message
from holozen.bags.reader import Bag
from holozen.testing import Wire, wait_for


def assert_one_line(done: subprocess.CompletedProcess[str], code: int, *parts: str) -> None:
    """It failed with this code and one line that holds these parts."""
    assert done.returncode == code, done.stderr
    assert done.stdout == ""
    lines = done.stderr.splitlines()
    assert len(lines) == 1, done.stderr
    assert all(part in lines[0] for part in parts), lines[0]


def read(path: Path) -> list[Message]:
    """All messages of a bag."""
    with Bag(path) as bag:
        return list(bag.messages())


def stopped(output: str) -> list[str]:
    """The robots that `stop` says are stopped; of a process that a busy machine holds up it says
    that it hangs, too.
    """
    return sorted(re.findall(r"^(\S+) is stopped(?:$|: its process hangs)", output, re.M))


def words_of(pid: int) -> list[str]:
    """A running process's words; none if it is gone."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_text().split("\0")
    except OSError:
        return []


def parent_of(pid: int) -> int:
    """The parent's process id; 0 if the process is gone."""
    try:
        return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
    except OSError:
        return 0


def state_of(pid: int) -> str:
    """The kernel's letter for what a process does: T is stopped, Z has ended, or is gone."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return "Z"


def parts_at(wire: Wire) -> dict[str, int]:
    """The verbs that run on this wire, with their process ids; `up` itself too."""
    found = {}
    for pid in map(int, filter(str.isdecimal, os.listdir("/proc"))):
        words = words_of(pid)
        if words == words_of(parent_of(pid)):  # it is about to become another program
            continue
        # `python -m holozen` as well as `.venv/bin/holozen`
        names = [Path(word).name for word in words]
        if wire.endpoint in words and "holozen" in names and "-c" not in words:
            found[words[names.index("holozen") + 1]] = pid
    return found


def wait_for_none(wire: Wire) -> None:
    """Wait until nothing runs on this wire. What does now is looked at first, as that is cheap."""
    parts = list(parts_at(wire).values())
    wait_for(lambda: not any(map(words_of, parts)), what="the end of all that runs")
    wait_for(lambda: parts_at(wire) == {}, what="the end of what was started meanwhile")
