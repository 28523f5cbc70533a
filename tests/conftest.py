"""Parts of the machine that a test needs: `scripts/parts` installs them in CI, elsewhere the test
is skipped.

    @pytest.mark.needs("ip", "unshare")

In CI (CI=true) every skip is a failure: a test that did not run has shown nothing. Only what is
"not built: ..." may be missing, a program that cargo builds in minutes.

What is tried often, to be sure, is tried more often by `scripts/test --long`, which sets
HOLOZEN_LONG=1:

    def test_it_stops(trials):
        for _ in range(trials(3, 20)):
"""

import gc
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import pytest

from holozen import cli
from holozen.process import SIGNALS, Ending
from holozen.testing import Wire
from holozen.testing.process import PATIENCE

HERE = Path(__file__).parent
PACKAGES = dict(line.split(" ", 1) for line in (HERE / "packages.txt").read_text().splitlines())
"""Debian's packages of each command that a test may need."""

IN_CI = os.environ.get("CI") == "true"
CORE, EXTENSIONS = HERE / "core", HERE / "extensions"
SLOW = {
    CORE / "cli" / "test_stop_verb.py",
    CORE / "teleop",
    CORE / "transport",
    CORE / "test_benchmarks.py",
}
"""Of these, what takes, or waits, as long as other tests; so do the folders ON_THE_WIRE of
extensions.
"""
ON_THE_WIRE = {*EXTENSIONS.glob("*/wire"), *EXTENSIONS.glob("*/gateway")}
SHARED = {"town", "fleet", "kiwi", "eye"}
"""Fixtures of a file whose processes run, and cost time, from the first test that uses them until
the file's last.
"""
REORDERED = {HERE / "faults", HERE / "integration", HERE / "terminals", *ON_THE_WIRE}
LONG = os.environ.get("HOLOZEN_LONG") == "1"


os.environ["RUST_BACKTRACE"] = (
    "0"  # a panic of Zenoh's is a line, as for users; a trace takes as long as a verb
)


def pytest_configure(config: pytest.Config) -> None:
    # A run in the background, or under nohup, ignores these, and so would all that it starts.
    for number, handler in (
        (signal.SIGINT, signal.default_int_handler),
        (signal.SIGHUP, signal.SIG_DFL),
    ):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, handler)
    config.addinivalue_line(
        "markers",
        "alone: measures time, or needs what keeps it; scripts/test runs it when little else does",
    )
    config.addinivalue_line(
        "markers", "engines: tried in each physics engine, by the fixture `engine` or a world"
    )
    config.addinivalue_line("markers", f"needs(*commands): of {', '.join(PACKAGES)}")


ending = Ending()  # this process too has opened Zenoh sessions


def pytest_sessionfinish(exitstatus: int) -> None:
    ending.code = int(exitstatus)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    paths = dict.fromkeys(item.path for item in items)

    def is_quick(path: Path) -> bool:
        is_unit = CORE in path.parents or EXTENSIONS in path.parents
        return is_unit and (SLOW | ON_THE_WIRE).isdisjoint((path, path.parent))

    order = {path: (is_quick(path), number) for number, path in enumerate(paths)}

    def place(item: pytest.Item) -> tuple[tuple[bool, int], bool]:
        """The long files first: none is left over at the end. In a file, the tests that share
        processes last.
        """
        shares = item.path.parent in REORDERED and not SHARED.isdisjoint(
            getattr(item, "fixturenames", ())
        )
        return order[item.path], shares

    items.sort(key=place)


def pytest_collection_finish() -> None:
    # What thousands of collected tests are made of stays: no garbage collection looks at it again.
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True, scope="session")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Generator[None, None, None]:
    """Nothing is read from, or left in, the user's cache folder, and none of the user's own
    variables counts.
    """
    with pytest.MonkeyPatch.context() as patch:
        for name in os.environ.keys() - {"HOLOZEN_LONG"}:
            if name.startswith("HOLOZEN_") or name == "ROS_DOMAIN_ID":
                patch.delenv(name)
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        # pytest in a test: at its end it tidies up a folder that this one uses too
        patch.setenv("PYTEST_DEBUG_TEMPROOT", str(tmp_path_factory.mktemp("pytest")))
        yield


@pytest.fixture(scope="session")
def trials() -> Callable[[int, int], int]:
    """`trials(short, long)`: how often to try; `long` in a run of `scripts/test --long`."""
    return lambda short, long: long if LONG else short


@pytest.fixture
def call(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Generator[Callable[..., subprocess.CompletedProcess[str]], None, None]:
    """`call("topic", "list")`: run `holozen topic list` in this process. For what verbs write,
    which needs no other. An AssertionError ends one that goes on for PATIENCE.
    """
    handlers = {
        number: signal.getsignal(number) for number in (*SIGNALS, signal.SIGTSTP, signal.SIGALRM)
    }

    def late(_number: int, _frame: object) -> None:
        raise AssertionError(f"it still runs after {PATIENCE:g} s")

    signal.signal(signal.SIGALRM, late)

    def run(*words: str) -> subprocess.CompletedProcess[str]:
        capfd.readouterr()
        signal.setitimer(signal.ITIMER_REAL, PATIENCE)
        try:
            with monkeypatch.context() as patch:
                # On a busy machine others answer late, which is a line of its own.
                patch.setattr("holozen.transport.meeting.NOTICE", PATIENCE)
                code = cli.main([*words])
        except SystemExit as end:
            code = int(end.code or 0)
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
        return subprocess.CompletedProcess(words, code, *capfd.readouterr())

    yield run
    for number, handler in handlers.items():
        signal.signal(number, handler)
    # What `run` and `launch` leave:
    if packages := sys.modules.get("holozen.ros.packages"):
        for known in (packages.given, packages.starts, packages.stand_ins):
            known.clear()
    if importer := sys.modules.get("holozen.ros.importer"):
        importer.remove()


@pytest.fixture
def run(
    wire: Wire, call: Callable[..., subprocess.CompletedProcess[str]]
) -> Callable[..., tuple[int, str, str]]:
    """Run `holozen VERB WORDS...` on the test's wire, in this process: exit code, output,
    errors.
    """

    def run(*words: object) -> tuple[int, str, str]:
        done = call(*map(str, words), *wire.flags)
        return done.returncode, done.stdout, done.stderr

    return run


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    needed = [command for marker in item.iter_markers("needs") for command in marker.args]
    for unknown in set(needed) - set(PACKAGES):
        raise pytest.UsageError(f"needs({unknown!r}): not in {HERE}/packages.txt")
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
        if "left out: " in str(reason):  # an extension
            return report
        report.outcome, report.longrepr = "failed", f"in CI nothing may be skipped: {reason}"
    return report


def _packages(commands: list[str]) -> list[str]:
    """The packages of those commands that are not there."""
    return sorted({PACKAGES[command] for command in commands if not shutil.which(command)})
