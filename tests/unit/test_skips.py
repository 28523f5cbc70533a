"""The rule of tests/conftest.py: in CI a test that did not run is a failure, and elsewhere it says why."""

import os
import re
import subprocess
import sys
from pathlib import Path

CONFTEST = Path(__file__).parents[1] / "conftest.py"
NEEDS = "@pytest.mark.needs('ss', 'ip', 'unshare')\ndef test_it(): pass"
SKIPS = "def test_it(): pytest.skip('no moon tonight')"
SKIPS_ALL = "pytest.skip('no moon tonight', allow_module_level=True)"
FAILS_AS_IT_SHOULD = "@pytest.mark.xfail(strict=True)\ndef test_it(): assert False"


def outcome(folder: Path, code: str, ci: str) -> str:
    """What pytest prints about `code`, where no command can be found and so none can be installed."""
    (folder / "conftest.py").write_text(CONFTEST.read_text())
    (folder / "test_one.py").write_text(f"import pytest\n{code}\n")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-ra", "-p", "no:cacheprovider", "--rootdir", folder, folder],
        env=os.environ | {"CI": ci, "PATH": str(folder)},
        capture_output=True,
        text=True,
    )
    return done.stdout


def test_a_skip_says_why_and_fails_in_ci(tmp_path: Path) -> None:
    for ci, end in [("true", r"1 (failed|error) in"), ("false", r"1 skipped in")]:
        rows = [
    (NEEDS, "needs ss, ip, unshare; on Debian: apt install iproute2 util-linux"),
    (SKIPS, "no moon tonight"),
    (SKIPS_ALL, "no moon tonight"),
]  # fmt: skip
        for code, reason in rows:
            shown = outcome(tmp_path, code, ci)
            assert reason in shown
            assert re.search(end, shown.splitlines()[-1])


def test_a_failure_that_is_expected_is_none(tmp_path: Path) -> None:
    assert "1 xfailed" in outcome(tmp_path, FAILS_AS_IT_SHOULD, "true")


def test_a_command_without_a_known_package_is_a_mistake_in_the_test(tmp_path: Path) -> None:
    code = "@pytest.mark.needs('warp')\ndef test_it(): pass"
    assert "needs('warp'): not in PACKAGES of" in outcome(tmp_path, code, "false")
