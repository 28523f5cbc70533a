"""What the page of `holozen view` draws, with one sim and one page for the tests of a file."""

from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, Page

from holozen.bus import Bus
from holozen.messages import Odometry
from holozen.testing import Process, Wire, wait_for
from holozen.transport.pubsub import Latest

from ..conftest import Open, watched
from .pixels import DECK_HEIGHT, EXACT, SIZE, TOP, shows_it_at

SOFTWARE_WEBGL = "--enable-unsafe-swiftshader"

FEW_FRAMES = """
    if (self !== top) {
    const frame = window.requestAnimationFrame.bind(window);
    window.requestAnimationFrame = draw => setTimeout(() => frame(draw), 200);
    window.cancelAnimationFrame = clearTimeout;
    }
"""
"""Draws at most 5 frames a second: a software renderer would take both cores for as many as it can.
"""


@pytest.fixture(scope="module")
def flags() -> tuple[str, ...]:
    """A browser that draws in 3D, which takes it long."""
    return (SOFTWARE_WEBGL,)


@pytest.fixture(scope="module")
def bus(town: Wire) -> Bus:
    return town.bus()


@pytest.fixture(scope="module")
def opened(chromium: Browser, view: str, sim: Process) -> Iterator[Open]:
    """Opens pages, as a phone or not, and waits until they show a robot. None loads anything from
    elsewhere, or reports an error.
    """
    faults: list[str] = []
    contexts = []

    def page(address: str = view, ready: str = "ready", **options: Any) -> Page:
        own = address.partition("?")[0]
        own_socket = own.replace("http", "ws", 1)
        viewport = SIZE | {"height": SIZE["height"] + TOP + DECK_HEIGHT}
        contexts.append(context := chromium.new_context(**{"viewport": viewport, **options}))
        context.add_init_script(FEW_FRAMES)
        page = watched(context, faults)
        inner = (own, "blob:", "data:")
        page.on(
            "request", lambda sent: None if sent.url.startswith(inner) else faults.append(sent.url)
        )
        page.on(
            "websocket",
            lambda made: None if made.url.startswith(own_socket) else faults.append(made.url),
        )
        page.goto(address)
        page.locator(f"#driver:text('{ready}')").wait_for()
        page.get_by_role("button", name="☰").click()
        return page

    yield page
    for context in contexts:
        context.close()
    assert faults == []


@pytest.fixture(scope="module")
def first(opened: Open, odom: Latest[Odometry]) -> Page:
    """A page whose camera stays where it was with the robot at the origin."""
    page = opened()
    wait_for(lambda: shows_it_at(page, 0.0, 0.0), 60, "the robot in the middle")
    # the camera was placed when the robot was first seen, perhaps before it had settled
    for view in ("Top", "Follow"):
        page.get_by_role("button", name=view, exact=True).click()
        wait_for(lambda view=view: shows_it_at(page, 0.0, 0.0) is (view == "Follow"), what=view)  # type: ignore[misc]
    wait_for(lambda: shows_it_at(page, 0.0, 0.0, EXACT), what="the camera in its place")
    page.get_by_role("button", name="Free").click()
    return page


@pytest.fixture
def page(first: Page) -> Iterator[Page]:
    """A page for all tests; each leaves it with no key held, also where it fails."""
    yield first
    first.keyboard.press("k")
    first.keyboard.up("a")
