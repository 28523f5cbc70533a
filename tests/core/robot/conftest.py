"""A folder in which no package of the machine that runs the tests can be found, and expansions
without the start of a new Python.
"""

from pathlib import Path

import pytest

from tests.expansions import forked

__all__ = ["forked", "home"]


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder; the one above it is shared as /tmp is, so the search for packages ends
    here.
    """
    for variable in ("AMENT_PREFIX_PATH", "ROS_PACKAGE_PATH"):
        monkeypatch.delenv(variable, raising=False)
    tmp_path.chmod(0o1777)
    (tmp_path / "home").mkdir()
    return tmp_path / "home"
