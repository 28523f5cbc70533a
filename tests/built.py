"""Programs that cargo builds in minutes: scripts/NAME builds one, in the user's cache folder."""

import subprocess
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).parents[1] / "scripts"


def built(script: str) -> Path:
    """Where its program is, or would be. Ask when a module is imported: tests get a cache folder of
    their own.
    """
    asked = subprocess.run([SCRIPTS / script, "--path"], capture_output=True, text=True, check=True)
    return Path(asked.stdout.strip())


def needs(program: Path, script: str) -> None:
    """Skip the test if the program is not there."""
    if not program.exists():
        pytest.skip(
            f"not built: scripts/{script} builds {program.name}, as scripts/test --long does"
        )
