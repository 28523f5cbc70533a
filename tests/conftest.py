"""Parts of the machine that a test needs: in CI they are installed if missing, elsewhere the test is skipped.

    @pytest.mark.needs("ip", "unshare")

In CI (CI=true) every skip is a failure: a test that did not run has shown nothing. Only what is "not built: ..." may be
missing, a program that cargo builds in minutes.

What is tried often, to be sure, is tried more often by `scripts/test --long`, which sets HOLOZEN_LONG=1:

    def test_it_stops(trials):
        for _ in range(trials(3, 20)):
"""

import fcntl
import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import pytest

from holozen.process import Ending

PACKAGES = {
    "chromium": "chromium",
    "debootstrap": "debootstrap",
    "docker": "docker.io",
    "docker-compose": "docker-compose",
    "faketime": "faketime",
    "Xvfb": "xvfb",
    "ip": "iproute2",
    "kitty": "kitty",
    "nft": "nftables",
    "nsenter": "util-linux",
    "screen": "screen",
    "setpriv": "util-linux",
    "setxkbmap": "x11-xkb-utils",
    "ss": "iproute2",
    "tmux": "tmux",
    "unshare": "util-linux",
    "xdotool": "xdotool",
}
"""Debian's package of each command that a test may need."""

IN_CI = os.environ.get("CI") == "true"
QUICK = Path(__file__).parent / "unit"
LONG = os.environ.get("HOLOZEN_LONG") == "1"


def pytest_configure(config: pytest.Config) -> None:
    # A run in the background, or under nohup, ignores these, and so would all that it starts.
    for number, handler in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, signal.SIG_DFL)):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, handler)
    config.addinivalue_line(
        "markers", "alone: measures time, or needs what keeps it; scripts/test runs it beside no other test"
    )
    config.addinivalue_line("markers", "engines: tried in each physics engine, by the fixture `engine` or a world")
    config.addinivalue_line("markers", f"needs(*commands): of {', '.join(PACKAGES)}")


ending = Ending()  # this process too has opened Zenoh sessions


def pytest_sessionfinish(exitstatus: int) -> None:
    ending.code = int(exitstatus)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: QUICK in item.path.parents)  # the long files first: none is left over at the end


@pytest.fixture(autouse=True, scope="session")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Generator[None, None, None]:
    """Nothing is read from, or left in, the user's cache folder."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        yield


@pytest.fixture(scope="session")
def trials() -> Callable[[int, int], int]:
    """`trials(short, long)`: how often to try; `long` in a run of `scripts/test --long`."""
    return lambda short, long: long if LONG else short


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    needed = [command for marker in item.iter_markers("needs") for command in marker.args]
    for unknown in set(needed) - set(PACKAGES):
        raise pytest.UsageError(f"needs({unknown!r}): not in PACKAGES of {__file__}")
    if IN_CI:
        _install(_packages(needed))
    if packages := _packages(needed):
        missing = ", ".join(command for command in needed if not shutil.which(command))
        pytest.skip(f"needs {missing}; on Debian: apt install {' '.join(packages)}")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, Any, Any]:
    return _no_skip((yield))


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report() -> Generator[None, Any, Any]:
    return _no_skip((yield))


def _no_skip(report: Any) -> Any:
    if IN_CI and report.outcome == "skipped" and not hasattr(report, "wasxfail"):
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else report.longrepr
        if "not built: " in str(reason):  # takes long to build, which `scripts/test --long` does
            return report
        report.outcome, report.longrepr = "failed", f"in CI nothing may be skipped: {reason}"
    return report


def _packages(commands: list[str]) -> list[str]:
    """The packages of those commands that are not there."""
    return sorted({PACKAGES[command] for command in commands if not shutil.which(command)})


def _install(packages: list[str]) -> None:
    """Try it; the test names what is missing if that fails."""
    if not packages or not shutil.which("apt-get"):
        return
    quiet = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    with (Path(tempfile.gettempdir()) / "holozen-tests-apt-get").open("w") as door:
        fcntl.flock(door, fcntl.LOCK_EX)  # two cannot install at once, and what the other one did need not be done
        for words in (["update"], ["install", "--yes", *packages]):
            subprocess.run(["apt-get", *words], env=quiet, stdin=subprocess.DEVNULL, capture_output=True, timeout=600)
