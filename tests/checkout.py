"""Copies of what the repository holds."""

import shutil
import subprocess
from pathlib import Path

import pytest

REPO = Path(__file__).parents[1]


def copy(folder: Path) -> Path:
    """Copy what git knows, and what it does not ignore, into a folder."""
    words = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    listed = subprocess.run(words, cwd=REPO, capture_output=True, text=True, timeout=60)
    if listed.returncode:
        pytest.skip("not a git checkout")
    for name in filter(None, listed.stdout.split("\0")):
        if (REPO / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(REPO / name, folder / name)
    return folder
