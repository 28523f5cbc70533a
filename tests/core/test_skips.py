"""The rule of tests/conftest.py: in CI a test that did not run is a failure, and elsewhere it gives
the reason.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

CONFTEST = Path(__file__).parents[1] / "conftest.py"
FILES = {
    "test_one.py": """import pytest
@pytest.mark.needs('ss', 'ip', 'unshare')
def test_needs(): pass
def test_skips(): pytest.skip('no moon tonight')
@pytest.mark.xfail(strict=True)
def test_fails_as_it_should(): assert False
@pytest.mark.needs('warp')
def test_needs_what_no_package_has(): pass
""",
    "test_all.py": "import pytest\npytest.skip('no sun today', allow_module_level=True)\n",
}


@pytest.mark.parametrize(
    ("ci", "last"),
    [("true", "1 failed, 1 xfailed, 3 errors"), ("false", "3 skipped, 1 xfailed, 1 error")],
)
def test_a_skip_gives_its_reason_and_fails_in_ci(tmp_path: Path, ci: str, last: str) -> None:
    """Where no command can be found, and so none can be installed."""
    ours = {path.name: path.read_text() for path in (CONFTEST, CONFTEST.with_name("packages.txt"))}
    for name, text in (ours | FILES).items():
        (tmp_path / name).write_text(text)
    words = ["-m", "pytest", "-ra", "-p", "no:cacheprovider", "--continue-on-collection-errors"]
    done = subprocess.run(
        [sys.executable, *words, "--rootdir", tmp_path, tmp_path],
        env=os.environ | {"CI": ci, "PATH": str(tmp_path), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"},
        capture_output=True,
        text=True,
    )
    shown = done.stdout
    for reason in (
        "needs ss, ip, unshare; on Debian: apt install iproute2 util-linux",
        "no moon tonight",
        "no sun today",
        f"needs('warp'): not in {tmp_path}/packages.txt",
    ):
        assert reason in shown
    assert last in shown.splitlines()[-1]
