"""The command that installs what a verb lacks, into the environment of this process."""

import sys
from importlib.util import find_spec
from pathlib import Path


def advice(extra: str) -> str:
    """What to do to have the extra `extra`."""
    return f"in the checkout of holozen, run: {_command(extra)}"


def interpreter() -> str:
    """This Python as one types it here: relative, where it is below the current folder."""
    path = Path(sys.executable)
    here = Path.cwd()
    return str(path.relative_to(here) if path.is_relative_to(here) else path)


def is_tool() -> bool:
    """Whether `uv tool` made the environment, which holds what one command names and nothing
    else.
    """
    return Path(sys.prefix, "uv-receipt.toml").exists()


def _command(extra: str) -> str:
    if is_tool():
        return "uv tool install --force '.[all]'"
    return f"{'pip' if find_spec('pip') else 'uv pip'} install -e '.[{extra}]'"
