"""The page of `holozen view` as one drives from it, with one sim for the tests of a file."""

from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, Page

from holozen.testing import Process

from ..conftest import Open, watched
from ..driving import KEYS

DESK = {"width": 1280, "height": 800}


def new_page(chromium: Browser, faults: list[str], **options: Any) -> Page:
    """A page in a context of its own, whose errors are added to `faults`. Its scene is left out:
    those of ../scene are drawn.
    """
    context = chromium.new_context(**{"viewport": DESK, **options})
    context.route(
        "**/scene/**",
        lambda route: route.fulfill(body="<title>a scene</title>", content_type="text/html"),
    )
    return watched(context, faults)


def load(page: Page, address: str, ready: str = "hb_bot") -> None:
    """Load a page, and wait until it may drive."""
    page.goto(address)
    if ready:
        page.get_by_role("button", name=ready).wait_for()
        page.locator("#driver:text('ready')").wait_for()


def ours(faults: list[str]) -> list[str]:
    """Those errors that are ours; that a network is lost is a browser's."""
    return [one for one in faults if "WebSocket" not in one]


@pytest.fixture
def opened(chromium: Browser, view: str, sim: Process) -> Iterator[Open]:
    """Opens pages of the test's own, and waits until they may drive."""
    contexts: list[BrowserContext] = []
    faults: list[str] = []

    def opened(address: str = view, ready: str = "hb_bot", **options: Any) -> Page:
        page = new_page(chromium, faults, **options)
        contexts.append(page.context)
        load(page, address, ready)
        return page

    yield opened
    for context in contexts:
        context.close()
    assert ours(faults) == []


@pytest.fixture(scope="module")
def window(chromium: Browser) -> Iterator[tuple[Page, list[str]]]:
    """A page of the file, and its errors."""
    faults: list[str] = []
    page = new_page(chromium, faults)
    yield page, faults
    page.context.close()


@pytest.fixture
def page(window: tuple[Page, list[str]], view: str, sim: Process) -> Iterator[Page]:
    """A page that is loaded anew, with nothing held, and may drive."""
    page, faults = window
    for key in KEYS:
        page.keyboard.up(key)
    page.mouse.up()
    load(page, view)
    yield page
    page.goto("about:blank")  # it lets go, and no other test sees it
    seen, faults[:] = ours(faults), []
    assert seen == []
