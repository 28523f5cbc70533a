"""Each way that a hold on the page ends, and who gets no hold."""

import json
import math
import os
import signal
from collections.abc import Iterator
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser, Page, Route

from holozen.messages import (
    CommandStatus,
    GetSceneReply,
    GetSceneRequest,
    Odometry,
    TriggerReply,
    TriggerRequest,
)
from holozen.testing import Wire, wait_for
from holozen.transport.pubsub import Latest
from tests.faults.proxy import Proxy

from ..conftest import TOKEN, Open, address, insist, is_soon, release
from ..driving import (
    FARTHEST,
    HALF_A_SECOND,
    MOVES,
    hold,
    place,
    stands,
    stays,
    stops_near,
    tap,
    velocity,
)

pytestmark = [pytest.mark.needs("chromium"), pytest.mark.alone]


@pytest.fixture(scope="module")
def link(view: str) -> Iterator[Proxy]:
    """The network between the view and a phone."""
    with Proxy(urlsplit(view).port or 0) as link:
        yield link


ENDS: dict[str, str] = {
    "another window": "dispatchEvent(new Event('blur'))",  # a headless browser has no other windows
    "a hidden tab": """Object.defineProperty(document, 'hidden', {get: () => true, configurable: true});
        document.dispatchEvent(new Event('visibilitychange')); delete document.hidden""",  # noqa: E501
    "Command": "dispatchEvent(new KeyboardEvent('keydown', {key: 'Meta', code: 'MetaLeft', "
    "metaKey: true}))",
    "a page that hangs": "{const start = Date.now(); while (Date.now() - start < 900);}",
}
"""What ends a hold beside its release, and how that is done to a page."""


@pytest.mark.parametrize("what", ENDS)
def test_a_hold_ends_with(what: str, page: Page, odom: Latest[Odometry]) -> None:
    hold(page, "w", odom)
    page.evaluate(ENDS[what])
    stops_near(odom, place(odom))
    page.keyboard.down("w")  # as the keyboard repeats
    assert stays(odom), "what is still held moves nothing"
    page.keyboard.up("w")
    tap(page, "w", odom)


def test_a_renderer_that_is_suspended_stops_the_robot_which_does_not_go_on_by_itself(
    page: Page, chromium: Browser, odom: Latest[Odometry]
) -> None:
    found = chromium.new_browser_cdp_session().send("SystemInfo.getProcessInfo")["processInfo"]
    renderers = [process["id"] for process in found if process["type"] == "renderer"]
    hold(page, "w", odom)
    before = place(odom)
    for process in renderers:
        os.kill(process, signal.SIGSTOP)
    try:
        wait_for(lambda: stands(odom), what="the robot to stand")
    finally:
        for process in renderers:
            os.kill(process, signal.SIGCONT)
    assert math.dist(place(odom), before) < FARTHEST + 0.25
    assert stays(odom), "the key is still held"
    page.keyboard.up("w")


def test_a_page_that_crashes_or_is_closed_stops_the_robot(
    opened: Open, odom: Latest[Odometry]
) -> None:
    def crash(page: Page) -> None:
        page.goto("chrome://crash", wait_until="commit")

    for end in (crash, Page.close):
        page = opened()
        hold(page, "w", odom)
        try:
            end(page)
        except Exception as error:
            assert "crashed" in str(error) or "ERR_" in str(error) or "closed" in str(error), error
        stops_near(odom, place(odom))
    assert stays(odom)


def test_a_lost_network_stops_the_robot_and_nothing_that_waited_in_it_moves_it(
    opened: Open, link: Proxy, town: Wire, odom: Latest[Odometry]
) -> None:
    bus = town.bus("operator")

    def ask(verb: str) -> None:
        bus.call(verb, TriggerRequest(), TriggerReply)

    page = opened(f"http://127.0.0.1:{link.port}/?token={TOKEN}")
    hold(page, "w", odom)
    link.stall()
    stops_near(odom, place(odom))
    page.get_by_role("heading", name="The view does not answer").wait_for()
    link.resume()
    page.get_by_role("heading", name="The view does not answer").wait_for(state="hidden")
    assert stays(odom), "the key is still held"
    page.keyboard.up("w")
    ask("stop")
    page.get_by_role("button", name="Release", exact=True).wait_for()
    link.stall()
    page.get_by_role("button", name="Release", exact=True).click()
    ask("release")
    ask("stop")
    seen = odom.count
    assert odom.wait(seen + 2 * HALF_A_SECOND, 5)
    link.resume()
    page.get_by_role("heading", name="The view does not answer").wait_for(state="hidden")
    page.get_by_text("Stopped by operator@").wait_for()
    assert stays(odom), "the old click on Release ended no stop from after it"
    release(page)


def test_of_two_pages_one_drives_and_each_stops_the_robot(
    opened: Open, page: Page, odom: Latest[Odometry]
) -> None:
    other = opened()
    hold(page, "w", odom)
    page.get_by_text("you drive").wait_for()
    other.get_by_text("another page drives", exact=True).wait_for()
    refused = other.get_by_text("another page drives this robot", exact=True)

    def drives_alone() -> bool:
        return refused.is_visible() and velocity(odom)[0] > MOVES

    def press_both() -> None:
        other.keyboard.up("s")
        hold(page, "w", odom)
        other.keyboard.down("s")

    insist(press_both, drives_alone, "the first page alone to drive")
    page.keyboard.up("w")
    assert wait_for(lambda: stands(odom)) and stays(odom), "the other page has to press again"
    other.keyboard.up("s")
    hold(page, "w", odom)
    other.get_by_role("button", name="STOP", exact=True).click(delay=1500)
    stops_near(odom, place(odom))
    page.get_by_text(
        "Stopped by this view"
    ).wait_for()  # the finger lifts from what is Release by then
    assert stays(odom)
    page.keyboard.up("w")
    release(page)
    other.get_by_role("button", name="STOP", exact=True).wait_for()


PRESSED_TWICE = """new Promise(done => {
    const press = () => {
        document.getElementById("stop").dispatchEvent(new PointerEvent("pointerdown"));
        document.getElementById("stop").click();
    };
    const notice = document.getElementById("notice");
    new MutationObserver(() => {
        if (!notice.textContent.startsWith("Stopped")) return;
        press();
        done();
    }).observe(notice, {subtree: true, childList: true});
    press();
})"""
"""A stop, and another one as soon as the page has shown the first."""


def test_who_presses_stop_twice_does_not_release(
    page: Page, town: Wire, odom: Latest[Odometry]
) -> None:
    status = town.bus("witness").latest("cmd_vel_status", CommandStatus)
    hold(page, "w", odom)
    page.evaluate(PRESSED_TWICE)
    stops_near(odom, place(odom))
    page.keyboard.up("w")
    page.get_by_role("button", name="Release", exact=True).wait_for()
    seen = status.count
    assert status.wait(seen + 10, 10)
    found = status.read()[0]
    assert found is not None and found.stopped
    release(page)


def test_without_a_robot_a_sheet_says_so_until_one_is_heard_which_stays_chosen_when_its_sim_comes(
    wire: Wire, opened: Open
) -> None:
    page = opened(address(wire.start("view", "--port", "0")), ready="")
    sheet = page.get_by_text("No robot is heard.")
    sheet.wait_for()
    page.get_by_text("holozen up").wait_for()
    with wire.bus("base") as base:
        odom = base.publisher("odom", Odometry)

        def has_chosen() -> bool:
            odom.put(Odometry())
            return page.locator("#driver:text('ready')").is_visible()

        wait_for(has_chosen)
        sheet.wait_for(state="hidden")
    sim = wire.start("sim")
    page.locator("#robots").get_by_text("hb_bot").wait_for()
    page.locator("#driver:text('ready')").wait_for()
    sim.kill()
    sheet.wait_for()


def test_the_sims_are_asked_for_the_scene_less_often_while_no_page_is_open(
    wire: Wire, opened: Open
) -> None:
    requests: list[GetSceneRequest] = []

    def answer(request: GetSceneRequest) -> GetSceneReply:
        requests.append(request)
        return GetSceneReply()

    def is_busy() -> bool:
        before = len(requests)
        return is_soon(lambda: len(requests) > before + 5)

    wire.bus("sim").serve("get_scene", GetSceneRequest, GetSceneReply, answer).start()
    page = opened(address(wire.start("view", "--port", "0")), ready="")
    wait_for(is_busy, what="many requests")
    page.close()
    wait_for(lambda: not is_busy(), what="few requests")


def test_no_other_web_site_and_nobody_without_the_token_gets_in(
    chromium: Browser, view: str
) -> None:
    without, _, token = view.partition("?")
    assert token == f"token={TOKEN}"
    context = chromium.new_context()
    mine = context.new_page()
    refused = mine.goto(without)
    assert refused is not None and refused.status == 403
    assert "the address needs the token" in mine.content()
    mine.goto(view)  # from here on the browser has the cookie
    mine.get_by_text("ready", exact=True).wait_for()

    def elsewhere(route: Route) -> None:
        route.fulfill(body="<title>elsewhere</title>", content_type="text/html")

    context.route("http://elsewhere.test/**", elsewhere)
    theirs = context.new_page()
    theirs.goto("http://elsewhere.test/")
    for path in ("drive", f"drive?token={TOKEN}", "scene/a", "picture/a"):
        opens = """url => new Promise(done => {
            const socket = new WebSocket(url, 'holozen.cockpit.1');
            socket.onopen = () => done('open');
            socket.onerror = () => done('refused');
        })"""
        assert theirs.evaluate(opens, without.replace("http", "ws") + path) == "refused", path
    framed = theirs.evaluate(f"""async () => {{
        const frame = document.createElement('iframe');
        frame.src = {json.dumps(view)};
        document.body.append(frame);
        await new Promise(done => frame.onload = done);
        try {{ return frame.contentDocument ? 'blank' : 'refused'; }} catch {{ return 'refused'; }}
    }}""")
    assert framed == "refused"
    context.close()
