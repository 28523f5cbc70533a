"""One sim, one view and one Chromium for the tests of a file."""

import shutil
from collections.abc import Callable, Generator, Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, Locator, Page, sync_playwright

from holozen.messages import Odometry
from holozen.testing import Process, Wire, wait_for
from holozen.transport.pubsub import Latest

TOKEN = "sesame"
Open = Callable[..., Page]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Function) -> Generator[None, Any, Any]:
    """A failure shows the text of the test's page."""
    report = yield
    if report.failed and (page := getattr(item, "funcargs", {}).get("page")):
        report.sections.append(("Text of the page", page.inner_text("body")))
    return report


@pytest.fixture(scope="module")
def town() -> Iterator[Wire]:
    """A wire for all tests of a file."""
    with Wire() as wire:
        yield wire


@pytest.fixture(scope="module")
def view(town: Wire) -> str:
    """The address of a view's page, with its token."""
    return address(town.start("view", "--port", "0", "--token", TOKEN))


@pytest.fixture(scope="module")
def sim(town: Wire) -> Process:
    sim = town.start("sim")
    sim.wait_for_line("listens on")
    return sim


@pytest.fixture(scope="module")
def odom(town: Wire, sim: Process) -> Latest[Odometry]:
    latest = town.bus("witness").latest("odom", Odometry)
    wait_for(lambda: latest.count, what="odom")
    return latest


def address(view: Process) -> str:
    """The address that a view prints."""
    view.wait_for_line("http://")
    return next(word for word in view.err.split() if word.startswith("http://"))


def watched(context: BrowserContext, faults: list[str]) -> Page:
    """A new page, whose errors are added to `faults`."""
    page = context.new_page()
    page.on("console", lambda said: faults.append(said.text) if said.type == "error" else None)
    page.on("pageerror", lambda error: faults.append(str(error)))
    return page


def is_soon(condition: Callable[[], bool]) -> bool:
    try:
        return wait_for(condition, 1.5)
    except AssertionError:
        return False


def insist(act: Callable[[], object], condition: Callable[[], bool], what: str) -> None:
    """Act until it has an effect: what a page asks for is refused half a second later, and a busy
    machine may take as long.
    """

    def tried() -> bool:
        act()
        return is_soon(condition)

    wait_for(tried, 20, what)


def press(button: Locator) -> None:
    """Press a button that goes once it was heard."""
    if button.is_visible():
        button.click()


def release(page: Page) -> None:
    """Press Release until the robot is released."""
    button = page.get_by_role("button", name="Release", exact=True)
    stop = page.get_by_role("button", name="STOP", exact=True)
    button.wait_for()
    insist(lambda: press(button), stop.is_visible, "the release")


@pytest.fixture(scope="module")
def flags() -> tuple[str, ...]:
    """Flags of the browser beside the usual ones."""
    return ()


@pytest.fixture(scope="module")
def chromium(flags: tuple[str, ...]) -> Iterator[Browser]:
    """A browser for the tests of a file."""
    path = shutil.which("chromium")
    assert path, "the mark `needs` has installed it"
    with sync_playwright() as playwright:
        # A container's root has no sandbox; only our own page is opened.
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox", *flags])
        yield browser
        browser.close()
