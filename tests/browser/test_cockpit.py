"""The page of `holozen view` as one drives from it, in a real browser: each way to hold it, and
each way that ends.
"""

import json
import math
import os
import re
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, Route

from holozen import data, entities
from holozen.messages import (
    CommandStatus,
    GetSceneReply,
    GetSceneRequest,
    Header,
    Image,
    Odometry,
    Time,
    TriggerReply,
    TriggerRequest,
)
from holozen.spawning import SpawnPose, put, read, spawn_file
from holozen.testing import Process, Wire, wait_for
from holozen.transport.pubsub import Latest
from tests.faults.proxy import Proxy

from .conftest import TOKEN, address, is_soon

pytestmark = [pytest.mark.needs("chromium"), pytest.mark.alone]

DESK, PHONE = {"width": 1280, "height": 800}, {"width": 390, "height": 844}
STANDS, MOVES = 0.01, 0.1  # m/s or rad/s
# m; what a robot at 0.5 m/s goes in the 0.5 s that a stop may take, and a little
FARTHEST = 0.5 * 0.5 + 0.05
HALF_A_SECOND = 25  # messages of odom
KEYS = {
    "w": (1, 0, 0),
    "s": (-1, 0, 0),
    "a": (0, 1, 0),
    "d": (0, -1, 0),
    "q": (0, 0, 1),
    "e": (0, 0, -1),
    "i": (1, 0, 0),
    ",": (-1, 0, 0),
    "j": (0, 0, 1),
    "l": (0, 0, -1),
    "J": (0, 1, 0),
    "L": (0, -1, 0),
    "u": (1, 0, 1),
    "o": (1, 0, -1),
    "m": (-1, 0, -1),
    ".": (-1, 0, 1),
}
"""The signs of the velocity that each key commands: forward, left, counter-clockwise."""
GAMEPAD = """axes => {
    navigator.getGamepads = () => axes && [{connected: true, axes, buttons: Array(17).fill({pressed: false})}] || [];
}"""  # noqa: E501


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


@pytest.fixture(scope="module")
def link(view: str) -> Iterator[Proxy]:
    """The network between the view and a phone."""
    with Proxy(urlsplit(view).port or 0) as link:
        yield link


Open = Callable[..., Page]


def new_page(chromium: Browser, faults: list[str], **options: Any) -> Page:
    """A page in a context of its own, whose errors are added to `faults`. Its scene is left out:
    those of test_view.py are drawn.
    """
    context = chromium.new_context(**{"viewport": DESK, **options})
    context.route(
        "**/scene/**",
        lambda route: route.fulfill(body="<title>a scene</title>", content_type="text/html"),
    )
    page = context.new_page()
    page.on("console", lambda said: faults.append(said.text) if said.type == "error" else None)
    page.on("pageerror", lambda error: faults.append(str(error)))
    return page


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


def velocity(odom: Latest[Odometry]) -> tuple[float, float, float]:
    message, age = odom.read()
    assert message is not None and age < 5, "the sim is there"
    twist = message.twist.twist
    return twist.linear.x, twist.linear.y, twist.angular.z


def place(odom: Latest[Odometry]) -> tuple[float, float]:
    message = odom.read()[0]
    assert message is not None
    return message.pose.pose.position.x, message.pose.pose.position.y


def has_signs(odom: Latest[Odometry], signs: tuple[float, ...]) -> bool:
    return all(
        abs(is_) < MOVES if not sign else is_ * sign > MOVES
        for is_, sign in zip(velocity(odom), signs, strict=True)
    )


def stands(odom: Latest[Odometry]) -> bool:
    return max(map(abs, velocity(odom))) < STANDS


def stays(odom: Latest[Odometry]) -> bool:
    """Whether the robot stands for half a second more."""
    seen = odom.count
    return odom.wait(seen + HALF_A_SECOND, 5) and stands(odom)


def stops_near(odom: Latest[Odometry], before: tuple[float, float]) -> None:
    """Check that the robot comes to rest within the distance of half a second."""
    wait_for(lambda: stands(odom), what="the robot to stand")
    assert math.dist(place(odom), before) < FARTHEST


def hold(page: Page, key: str, odom: Latest[Odometry]) -> None:
    """Hold a key until it moves the robot; again if the browser was too busy to keep it held."""

    def tried() -> bool:
        page.keyboard.up(key)
        page.keyboard.down(key)
        try:
            return wait_for(lambda: has_signs(odom, KEYS[key]), 2)
        except AssertionError:
            return False

    wait_for(tried, 20, f"{key} to move the robot")


def middle(page: Page, selector: str) -> tuple[float, float]:
    box = page.locator(selector).bounding_box()
    assert box
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def test_each_key_moves_the_robot_as_its_cap_says_and_its_release_stops_it(
    page: Page, odom: Latest[Odometry]
) -> None:
    for key in KEYS:
        hold(page, key, odom)
        assert page.locator("kbd.lit").count() >= 1
        page.keyboard.up(key)
        stops_near(odom, place(odom))
        assert page.locator("kbd.lit").count() == 0
    page.keyboard.down("w")
    page.keyboard.down("a")
    wait_for(lambda: has_signs(odom, (1, 1, 0)), what="two keys together")
    page.keyboard.up("w")
    wait_for(lambda: has_signs(odom, (0, 1, 0)), what="the one that is still held")
    page.keyboard.up("a")
    wait_for(lambda: stands(odom), what="rest")


def test_the_round_stick_translates_and_its_ring_turns_by_mouse(
    page: Page, odom: Latest[Odometry]
) -> None:
    x, y = middle(page, "#move")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x - 45, y)
    wait_for(lambda: has_signs(odom, (0, 1, 0)), what="the robot to go left")
    page.mouse.move(x + 5, y + 45)
    wait_for(lambda: velocity(odom)[0] < -MOVES, what="the robot to go back")
    page.mouse.up()
    stops_near(odom, place(odom))
    page.mouse.move(x, y - 78)
    page.mouse.down()
    page.mouse.move(x + 60, y - 50)
    wait_for(lambda: has_signs(odom, (0, 0, -1)), what="the robot to turn right")
    page.mouse.up()
    wait_for(lambda: stands(odom), what="rest")


def test_two_thumbs_drive_on_a_phone_until_they_are_lifted_or_the_browser_takes_them(
    opened: Open, odom: Latest[Odometry]
) -> None:
    phone = opened(viewport=PHONE, is_mobile=True, has_touch=True)
    touch = phone.context.new_cdp_session(phone)
    (x, y), (u, v) = middle(phone, "#move"), middle(phone, "#thumb")
    left, right = {"x": x, "y": y - 45, "id": 1}, {"x": u - 45, "y": v, "id": 2}

    def put(kind: str, *fingers: Any) -> None:
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": list(fingers)})

    put("touchStart", left)
    wait_for(lambda: has_signs(odom, (1, 0, 0)), what="the robot to go ahead")
    put("touchStart", left, right)
    wait_for(lambda: has_signs(odom, (1, 0, 1)), what="and to turn left")
    put("touchEnd")
    stops_near(odom, place(odom))
    put("touchStart", left, right)
    wait_for(lambda: has_signs(odom, (1, 0, 1)), what="both thumbs")
    put("touchCancel")
    stops_near(odom, place(odom))
    assert stays(odom)


def test_a_gamepad_drives_and_has_to_be_let_go_after_a_stop(
    page: Page, odom: Latest[Odometry]
) -> None:
    page.evaluate(GAMEPAD, [-0.8, 0, 0, 0])
    wait_for(lambda: has_signs(odom, (0, 1, 0)), what="the robot to go left")
    page.keyboard.press("k")
    stops_near(odom, place(odom))
    assert stays(odom), "it is still pushed"
    page.evaluate(GAMEPAD, [0, 0, 0, 0])
    page.wait_for_timeout(100)  # the page looks 30 times a second
    page.evaluate(GAMEPAD, [0, 0, 0.8, 0])
    wait_for(lambda: has_signs(odom, (0, 0, -1)), what="the robot to turn right")
    page.evaluate(GAMEPAD, None)
    wait_for(lambda: stands(odom), what="rest, since it is gone")


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
    hold(page, "w", odom)
    page.keyboard.up("w")
    wait_for(lambda: stands(odom), what="rest")


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
    page.get_by_role("button", name="Release", exact=True).click()
    page.get_by_role("button", name="STOP", exact=True).wait_for()


def test_of_two_pages_one_drives_and_each_stops_the_robot(
    opened: Open, page: Page, odom: Latest[Odometry]
) -> None:
    other = opened()
    hold(page, "w", odom)
    page.get_by_text("you drive").wait_for()
    other.get_by_text("another page drives", exact=True).wait_for()
    other.keyboard.down("s")
    other.get_by_text("another page drives this robot", exact=True).wait_for()
    assert velocity(odom)[0] > MOVES
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
    page.get_by_role("button", name="Release", exact=True).click()
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
    page.get_by_role("button", name="Release", exact=True).click()
    page.get_by_role("button", name="STOP", exact=True).wait_for()


def test_a_click_into_the_scene_lets_go_and_gives_the_keys_back(
    page: Page, odom: Latest[Odometry]
) -> None:
    hold(page, "w", odom)
    page.mouse.click(640, 300)
    stops_near(odom, place(odom))
    page.keyboard.up("w")
    hold(page, "d", odom)
    page.keyboard.up("d")
    wait_for(lambda: stands(odom), what="rest")


def test_an_old_picture_is_covered_and_who_drives_by_it_stops(
    page: Page, town: Wire, odom: Latest[Odometry]
) -> None:
    eye = town.bus("eye").publisher("eye", Image)

    def expose(late: float = 0.0) -> bool:
        now = odom.read()[0]
        assert now is not None
        stamp = Time.of(now.header.stamp.seconds() - late) if late else now.header.stamp
        eye.put(
            Image(Header(stamp), height=2, width=2, encoding="rgb8", step=6, data=[0, 0, 255] * 4)
        )
        return page.locator("#picture").is_visible()

    def is_covered(late: float = 0.0) -> bool:
        expose(late)
        return page.locator("#cover").is_visible()

    wait_for(expose, what="the picture")
    wait_for(lambda: not is_covered(), what="a fresh picture")
    page.locator("#picture .swap").click()
    wait_for(
        lambda: not is_covered() and not page.locator("body.off").count(), what="sticks that are on"
    )

    def moves() -> bool:
        expose()
        page.keyboard.up("w")
        page.keyboard.down("w")
        expose()
        return velocity(odom)[0] > MOVES

    wait_for(moves, 20, "the robot to drive by the picture")
    page.locator("#cover").wait_for()  # no more pictures come
    stops_near(odom, place(odom))
    page.keyboard.up("w")
    wait_for(
        lambda: is_covered(late=1.0),
        what="a picture that was exposed long ago to be covered, as fast as they come",
    )
    page.get_by_role("button", name="Drive by the scene").click()
    hold(page, "w", odom)
    page.keyboard.up("w")
    eye.close()
    page.locator("#picture").wait_for(state="hidden")


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


def test_a_view_to_look_only_drives_nothing(
    town: Wire, opened: Open, odom: Latest[Odometry]
) -> None:
    page = opened(address(town.start("view", "--port", "0", "--look-only")))
    page.keyboard.down("w")
    assert stays(odom)
    assert not page.get_by_role("button", name="STOP", exact=True).is_visible()


def test_the_speeds_are_three_gears(page: Page, odom: Latest[Odometry]) -> None:
    fastest: dict[str, float] = {}
    for key, gear in zip("123", ("slow", "normal", "fast"), strict=True):
        page.keyboard.press(key)
        page.get_by_role("button", name=gear, exact=True).and_(
            page.locator("[aria-checked=true]")
        ).wait_for()
        hold(page, "w", odom) if gear != "slow" else page.keyboard.down("w")
        wait_for(lambda: velocity(odom)[0] > fastest.get("last", 0) + 0.05, what=f"{gear}")
        seen = odom.count
        assert odom.wait(seen + 5, 5)
        fastest["last"] = fastest[gear] = velocity(odom)[0]
        page.keyboard.up("w")
        wait_for(lambda: stands(odom), what="rest")
    assert fastest["slow"] == pytest.approx(0.15, abs=0.02) and fastest["normal"] == pytest.approx(
        0.5, abs=0.02
    )
    assert fastest["fast"] == pytest.approx(1.0, abs=0.05)


WALL = """<sdf version="1.6"><model name="wall"><static>true</static><link name="l">
<collision name="c"><pose>0 0 0.5 0 0 0</pose><geometry><box><size>0.2 4 1</size></box></geometry>
</collision></link></model></sdf>"""


def test_a_switch_lets_a_robot_stop_before_what_its_lidar_sees_and_the_page_says_so(
    town: Wire, opened: Open, tmp_path: Path
) -> None:
    bus, file = town.bus("builder"), tmp_path / "wall.sdf"
    file.write_text(WALL)
    explorer, scout_file = data.find("urdf", "explorer.urdf.xacro"), tmp_path / "scout.urdf.xacro"
    camera = '<gazebo reference="camera_link">.*?</gazebo>'  # pictures would take long to render
    scout_file.write_text(re.sub(camera, "", explorer.read_text(), flags=re.DOTALL))
    spawn_file(bus, file, "wall", SpawnPose(x=2.0, y=20.0))
    put(bus, read(scout_file, "Scout", packages={"holo": explorer.parents[1]}), SpawnPose(y=20.0))
    scout = bus.latest("Scout/odom", Odometry)
    page = opened()
    page.locator("#menu").click()
    switch = page.get_by_label("Slow down near obstacles")
    page.get_by_role("button", name="hb_bot").click()
    page.locator("nav [aria-pressed=true]:text('hb_bot')").wait_for()
    switch.wait_for(state="hidden")  # it sees no obstacles
    page.get_by_role("button", name="Scout", exact=True).click()
    switch.check()
    page.wait_for_timeout(1500)  # a state from before the click would uncheck it by then
    assert switch.is_checked()
    page.keyboard.down("w")
    page.get_by_text("Stopped: 0.1 m ahead.").wait_for()
    wait_for(lambda: stands(scout), what="the robot to stand before the wall")
    page.keyboard.up("w")
    hold(page, "s", scout)
    page.keyboard.up("s")
    for name in ("Scout", "wall"):
        entities.delete(bus, name)
