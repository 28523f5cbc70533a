"""No file of the repo names a registry's host or a folder of the machine that it was written on."""

import re
import subprocess
from functools import cache
from pathlib import Path

import pytest

REPO = Path(__file__).parents[2]
# Written in two parts, so that this file passes its own test.
HOSTS = [
    ".".join(parts)
    for parts in (
        ("pypi", "org"),
        ("pythonhosted", "org"),
        ("crates", "io"),
        ("anaconda", "org"),
        ("npmjs", "org"),
        ("deb.debian", "org"),
        ("archive.ubuntu", "com"),
        ("ghcr", "io"),
        ("quay", "io"),
        ("gcr", "io"),
        ("docker", "io/"),
        ("hub.docker", "com"),
        ("proxy.golang", "org"),
    )
]
# /home/asha is the machine of an invented student, in tests about files that name such a place.
HOMES = re.compile(r"(?<![\w.$}{*~-])/(?:root/|work/|(?:Users|home)/(?!asha\b))[\w.]")


def tracked() -> list[Path]:
    words = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    done = subprocess.run(words, cwd=REPO, capture_output=True, text=True, timeout=60)
    if done.returncode:
        pytest.skip("not a git checkout")
    return [REPO / name for name in done.stdout.split("\0") if name and (REPO / name).is_file()]


@cache  # two rules look at all of them
def lines() -> list[tuple[str, str]]:
    """(file and line number, text) of every text file."""
    found = []
    for path in tracked():
        text = path.read_bytes().decode(errors="replace")
        where = path.relative_to(REPO).as_posix()
        found += [(f"{where}:{number}", line) for number, line in enumerate(text.splitlines(), 1)]
    return found


def test_no_file_names_the_host_of_a_registry() -> None:
    hosts = re.compile("|".join(map(re.escape, HOSTS)))
    assert [where for where, line in lines() if hosts.search(line)] == []


def test_no_file_names_a_folder_of_somebodys_machine() -> None:
    here = f"{REPO}/"
    assert [
        where
        for where, line in lines()
        if HOMES.search(line) or (len(REPO.parts) > 2 and here in line)
    ] == []


def test_the_pattern_finds_folders_and_nothing_else() -> None:
    for line in (
        "cd /" + "root/holozen",
        "see '/" + "home/me/x'",
        "file:///" + "home/me/x",
        "/" + "work/x",
    ):
        assert HOMES.search(line), line
    for line in ("docs/work/notes and ~/home/x", "/home/asha/catkin_ws", "$HOME/root/x"):
        assert not HOMES.search(line), line
