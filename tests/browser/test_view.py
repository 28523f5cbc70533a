"""The page of `holozen view` in a real browser: what it shows, and that its pad is a dead-man."""

import io
import math
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from PIL import Image as Picture
from playwright.sync_api import Browser, ConsoleMessage, Page

from holozen import data, entities
from holozen.bus import Bus
from holozen.cli.spawn import Place, spawn_file
from holozen.messages import (
    GetSceneReply,
    GetSceneRequest,
    Header,
    Image,
    LaserScan,
    Odometry,
    Point,
    Pose,
    PoseStamped,
    Range,
    SimulationStatus,
    TFMessage,
    TransformStamped,
    TriggerReply,
    TriggerRequest,
    Vector3,
)
from holozen.messages import Path as PathMessage
from holozen.messages import Transform as TransformMessage
from holozen.messages.simulation_interfaces import (
    EntityState,
    SetEntityStateReply,
    SetEntityStateRequest,
    SimulationState,
)
from holozen.rotation import Transform, yaw
from holozen.testing import Process, Wire, wait_for
from holozen.transport.pubsub import Latest
from services.view.scene import EYE, FIELD, LOOK_AT
from tests.faults.proxy import Proxy
from tests.unit.bag.bags import a_bag

from .conftest import TOKEN, address

pytestmark = [pytest.mark.needs("chromium"), pytest.mark.alone]

SIZE = {"width": 960, "height": 320}  # pixels; a software renderer takes its time for each
FREE = (np.arange(SIZE["width"]) > 320) & (np.arange(SIZE["width"]) < 620)  # columns without panel and notices
COARSE = 0.2  # of the pixels that a page draws which is not looked at
DECK = 0.295  # m; the height of hb_bot's orange deck
NEAR = 14  # pixels between the middle of what is seen of the deck, and the robot's
FARTHEST = 0.5 * 0.5 + 0.05  # m; what a robot at 0.5 m/s goes in the 0.5 s that a stop may take, and a little
TWO_FRAMES = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
FEW_FRAMES = """
    const frame = window.requestAnimationFrame.bind(window);
    window.requestAnimationFrame = draw => setTimeout(() => frame(draw), 200);
    window.cancelAnimationFrame = clearTimeout;
"""
"""Draws at most 5 frames a second: a software renderer would take both cores for as many as it can."""
GONE = "Tried to update non-existent component"
"""Viser's page reports it where a person uses what is being removed, such as a held button."""
PHONE = {"width": 390, "height": 844}
WEBGL = True


@pytest.fixture(scope="module")
def bus(town: Wire) -> Bus:
    return town.bus()


@pytest.fixture(scope="module")
def odom(bus: Bus, sim: Process) -> Latest[Odometry]:
    latest = bus.latest("odom", Odometry)
    wait_for(lambda: latest.count, what="odom")
    return latest


@pytest.fixture(scope="module")
def sim(town: Wire) -> Process:
    sim = town.start("sim")
    sim.wait_for_line("listens on")
    return sim


def is_fault(reported: ConsoleMessage) -> bool:
    """Whether a page reported an error."""
    return reported.type == "error" and GONE not in reported.text


Open = Callable[..., Page]


@pytest.fixture(scope="module")
def opened(chromium: Browser, view: str, sim: Process) -> Iterator[Open]:
    """Opens pages, as a phone or not, and waits until they show a robot. None loads anything from elsewhere, or reports
    an error.
    """
    faults: list[str] = []
    contexts = []

    def page(address: str = view, ready: str = "not driven", **options: Any) -> Page:
        own = address.partition("?")[0]
        own_socket = own.replace("http", "ws", 1)
        contexts.append(context := chromium.new_context(**{"viewport": SIZE, **options}))
        context.add_init_script(FEW_FRAMES)
        page = context.new_page()
        page.on("console", lambda reported: faults.append(reported.text) if is_fault(reported) else None)
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("request", lambda sent: None if own in sent.url else faults.append(sent.url))
        page.on("websocket", lambda made: None if made.url.startswith(own_socket) else faults.append(made.url))
        page.goto(address)
        notice = page.get_by_text("Software WebGL")  # it would cover the pad
        notice.locator("xpath=../..").get_by_role("button").dispatch_event("click")
        page.get_by_text(ready).or_(page.get_by_text("driven by")).first.wait_for()
        return page

    yield page
    for context in contexts:
        context.close()
    assert faults == []


@pytest.fixture(scope="module")
def first(opened: Open) -> Page:
    return opened()


@pytest.fixture(scope="module")
def link(view: str) -> Iterator[Proxy]:
    """The network between the view and the phone."""
    with Proxy(urlsplit(view).port or 0) as link:
        yield link


@pytest.fixture(scope="module")
def phone(opened: Open, link: Proxy) -> Page:
    """The page on another device."""
    address = f"http://127.0.0.1:{link.port}/?token={TOKEN}"
    return opened(address, viewport=PHONE, is_mobile=True, has_touch=True, device_scale_factor=COARSE)


@pytest.fixture
def page(first: Page) -> Iterator[Page]:
    """A page for all tests; each leaves it with no button held, also where it fails."""
    yield first
    first.mouse.up()


def place(odom: Latest[Odometry]) -> tuple[float, float]:
    message = odom.read()[0]
    assert message is not None
    return message.pose.pose.position.x, message.pose.pose.position.y


def put(bus: Bus, odom: Latest[Odometry], x: float, y: float) -> None:
    """Place the robot there."""
    request = SetEntityStateRequest("hb_bot", EntityState(pose=Pose(Point(x, y, -0.04))))
    bus.call("set_entity_state", request, SetEntityStateReply)
    wait_for(lambda: math.dist(place(odom), (x, y)) < 0.001, what=f"the robot at {x}, {y}")


def speed(odom: Latest[Odometry]) -> float:
    message, age = odom.read()
    assert message is not None
    assert age < 5, "the sim is there"
    return math.hypot(message.twist.twist.linear.x, message.twist.twist.linear.y)


def pixel(x: float, y: float, z: float) -> tuple[float, float]:
    """The pixel of a point of the world, as a page that was just opened shows it."""
    eye, forward = np.array(EYE), np.array(LOOK_AT) - np.array(EYE)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, (0, 0, 1))
    right /= np.linalg.norm(right)
    away = np.array((x, y, z)) - eye
    scale = SIZE["height"] / 2 / math.tan(FIELD / 2) / (away @ forward)
    return SIZE["width"] / 2 + scale * (away @ right), SIZE["height"] / 2 - scale * (away @ np.cross(right, forward))


def colored(page: Page, color: Callable[[Any, Any, Any], Any]) -> list[tuple[int, int]]:
    """The pixels (x, y) of a colour."""
    picture = Picture.open(io.BytesIO(page.screenshot())).convert("RGB")
    red, green, blue = np.asarray(picture, float).transpose(2, 0, 1)
    rows, columns = np.nonzero(color(red, green, blue) & FREE)
    return list(zip(columns.tolist(), rows.tolist(), strict=True))


def deck(page: Page) -> tuple[float, float] | None:
    """The middle of the orange pixels, if there are any."""
    found = colored(page, lambda r, g, b: (r > 150) & (r - b > 70) & (r - g > 25) & (g - b > 25))
    return tuple(np.mean(found, axis=0).tolist()) if len(found) > 60 else None


def shows_it_at(page: Page, x: float, y: float) -> bool:
    middle = deck(page)
    return middle is not None and math.dist(middle, pixel(x, y, DECK)) < NEAR


def hold(page: Page, button: str, moves: Callable[[], bool]) -> None:
    """Hold a button until it `moves` the robot; again if the browser was too slow to keep it held, as on a busy
    machine.
    """

    def tried() -> bool:
        press(page, button)
        return is_soon(moves)

    wait_for(tried, 20, f"{button} to move the robot")


def press(page: Page, button: str) -> None:
    page.mouse.up()
    handle = page.get_by_role("button", name=button, exact=True)
    handle.scroll_into_view_if_needed()
    box = handle.bounding_box()
    assert box
    page.mouse.move(box["x"] + 20, box["y"] + box["height"] / 2)
    page.mouse.down()


def is_soon(condition: Callable[[], bool]) -> bool:
    try:
        return wait_for(condition, 1.5)
    except AssertionError:
        return False


def stands_near(odom: Latest[Odometry], before: tuple[float, float]) -> None:
    """Check that the robot comes to rest within 0.5 s, and within the distance that it covers in that time."""
    wait_for(lambda: speed(odom) < 0.01, what="the robot to stand")
    assert math.dist(place(odom), before) < FARTHEST


def test_the_robot_is_where_its_odometry_places_it_in_its_colours_and_moves_when_driven(
    page: Page, odom: Latest[Odometry]
) -> None:
    wait_for(lambda: shows_it_at(page, *place(odom)), what="the robot in the picture")
    start = place(odom)
    assert not colored(page, measured)
    hold(page, "Left", lambda: math.dist(place(odom), start) > 0.2 and bool(colored(page, measured)))
    page.mouse.up()
    stands_near(odom, place(odom))
    wait_for(lambda: shows_it_at(page, *place(odom)), what="the robot where it is now")
    wait_for(lambda: not colored(page, measured), what="no arrow of a robot that stands")
    assert colored(page, lambda r, g, b: (r - g > 90) & (b - g > 60)), "its trail"


def measured(red: Any, green: Any, blue: Any) -> Any:
    """The arrow of the velocity measured by odometry."""
    return (green - red > 60) & (green - blue > 60)


def test_another_window_in_front_ends_a_held_button(page: Page, odom: Latest[Odometry]) -> None:
    hold(page, "Forward", lambda: speed(odom) > 0.4)
    # A headless browser has no other windows: this is what it reports when one comes to the front.
    page.evaluate("window.dispatchEvent(new Event('blur'))")
    stands_near(odom, place(odom))
    seen = odom.count
    assert odom.wait(seen + 25, 5) and speed(odom) < 0.01, "half a second later, with the button still held"
    page.mouse.up()


def test_a_page_that_hung_stops_the_robot_and_does_not_go_on_by_itself(page: Page, odom: Latest[Odometry]) -> None:
    hold(page, "Turn left", lambda: turns(odom))
    page.evaluate("{const start = Date.now(); while (Date.now() - start < 800);}")  # as a phone that sleeps
    wait_for(lambda: not turns(odom), what="the robot to stand")
    page.get_by_text("not driven").wait_for()
    page.get_by_text("counts as let go").wait_for()
    seen = odom.count
    assert odom.wait(seen + 25, 5) and not turns(odom), "half a second later, with the button still held"
    page.mouse.up()
    hold(page, "Turn right", lambda: turns(odom))
    page.mouse.up()
    wait_for(lambda: not turns(odom), what="the robot to stand")


def turns(odom: Latest[Odometry]) -> bool:
    message = odom.read()[0]
    return message is not None and abs(message.twist.twist.angular.z) > 0.05


def test_a_thumb_drives_on_the_screen_of_a_phone(phone: Page, odom: Latest[Odometry]) -> None:
    button = phone.get_by_role("button", name="Right", exact=True)

    boxes = [button.bounding_box()]

    def within_reach() -> Any:  # without scrolling, once the panel has slid up
        boxes.append(box := button.bounding_box())
        phone.evaluate(TWO_FRAMES)
        return box if box == boxes[-2] and box and box["y"] + box["height"] < PHONE["height"] else None

    box = wait_for(within_reach, what="the pad")
    thumb = {"x": box["x"] + 30, "y": box["y"] + box["height"] / 2}
    touch = phone.context.new_cdp_session(phone)
    touch.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [thumb]})
    wait_for(lambda: speed(odom) > 0.4, what="the robot to drive")
    touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    stands_near(odom, place(odom))


def test_a_lost_network_stops_the_robot_and_a_button_that_was_held_does_not_go_on(
    phone: Page, link: Proxy, odom: Latest[Odometry]
) -> None:
    hold(phone, "Backward", lambda: speed(odom) > 0.4)
    link.stall()
    stands_near(odom, place(odom))
    link.resume()
    phone.get_by_text("not driven").wait_for()
    seen = odom.count
    assert odom.wait(seen + 25, 5) and speed(odom) < 0.01, "what was held back moves nothing"
    phone.mouse.up()


def test_a_release_that_waited_in_a_link_does_not_end_a_stop_from_after_it(
    phone: Page, link: Proxy, bus: Bus, odom: Latest[Odometry]
) -> None:
    def ask(verb: str) -> None:
        bus.call(verb, TriggerRequest(), TriggerReply)

    ask("stop")
    phone.get_by_text("stopped by test@").first.wait_for()
    link.stall()
    phone.get_by_role("button", name="Release", exact=True).click()
    ask("release")
    ask("stop")
    seen = odom.count
    assert odom.wait(seen + 25, 5), "half a second later"
    link.resume()
    phone.get_by_text("the link to this page is too slow to drive").wait_for()
    phone.get_by_text("stopped by test@").first.wait_for()
    ask("release")
    phone.get_by_text("not driven").wait_for()


def test_stop_counts_while_a_slider_of_the_page_moves(phone: Page) -> None:
    stop = phone.get_by_role("button", name="Stop", exact=True).element_handle()
    phone.get_by_role("slider").first.evaluate(
        """(slider, stop) => {
          const key = kind => slider.dispatchEvent(
            new KeyboardEvent(kind, {key: "ArrowRight", code: "ArrowRight", bubbles: true}));
          key("keydown"); stop.click(); key("keydown"); key("keyup");
        }""",
        stop,
    )
    phone.get_by_text("stopped by view@").first.wait_for()
    phone.get_by_role("button", name="Release", exact=True).click()
    phone.get_by_text("not driven").wait_for()


def test_a_second_page_shows_the_driver_stops_it_drives_itself_and_stops_when_it_is_closed(
    page: Page, phone: Page, odom: Latest[Odometry]
) -> None:
    def refused() -> bool:
        phone.mouse.up()
        hold(page, "Forward", lambda: speed(odom) > 0.4)  # again if it was let go of, as on a busy machine
        if not is_soon(phone.get_by_text("driven by view@").is_visible):
            return False
        press(phone, "Backward")
        shown = is_soon(phone.get_by_text("another page drives this robot").is_visible)
        message = odom.read()[0]
        return bool(shown and message and message.twist.twist.linear.x > 0.4)

    wait_for(refused, 20, "the other page to be refused while the robot drives on")
    phone.mouse.up()
    phone.get_by_role("button", name="Stop", exact=True).click()
    page.get_by_text("stopped by view@").first.wait_for()
    stands_near(odom, place(odom))
    page.mouse.up()
    phone.get_by_role("button", name="Release", exact=True).click()
    page.get_by_text("not driven").wait_for()
    hold(phone, "Backward", lambda: speed(odom) > 0.4)
    phone.close()
    stands_near(odom, place(odom))


def test_stop_counts_while_a_button_of_the_same_page_is_held(page: Page, odom: Latest[Odometry]) -> None:
    for _ in range(5):  # viser's page may swallow one of two reports
        hold(page, "Turn left", lambda: turns(odom))
        page.get_by_role("button", name="Stop", exact=True).dispatch_event("click")  # as another finger does
        page.get_by_text("stopped by view@").first.wait_for()
        page.mouse.up()
        page.get_by_role("button", name="Release", exact=True).click()
        page.get_by_text("not driven").wait_for()


def test_displays_show_what_topics_hold_in_the_frames_of_tf(page: Page, bus: Bus, odom: Latest[Odometry]) -> None:
    page.get_by_role("tab", name="Displays").click()
    scans, frames = bus.publisher("scan", LaserScan), bus.publisher("tf", TFMessage)
    images = bus.publisher("eye", Image)
    for name in ("LaserScan: scan", "Image: eye"):
        page.get_by_text(name, exact=True).click()
    x, y = 0.0, 0.0
    put(bus, odom, x, y)
    message = odom.read()[0]
    assert message is not None
    turned = yaw(Transform.of(Point(), message.pose.pose.orientation).rotation)

    def shown(drift: float = 0.0) -> bool:
        at = TransformMessage(Vector3(0.0, 0.0, 0.1))
        there = TransformStamped(Header(frame_id="map"), message.header.frame_id, TransformMessage(Vector3(0.3)))
        above = TransformStamped(Header(frame_id="world"), "map", TransformMessage())  # named as the choice is
        frames.put(TFMessage([TransformStamped(Header(frame_id=message.child_frame_id), "laser", at), there, above]))
        first, many = -turned - math.pi / 2 - 0.05, [0.8] * 11
        scans.put(LaserScan(Header(frame_id="laser"), first, angle_increment=0.01, range_max=5.0, ranges=many))
        images.put(Image(height=2, width=2, encoding="rgb8", step=6, data=[0, 0, 255] * 4))
        found = colored(page, wall)
        return bool(found) and math.dist(np.mean(found, axis=0), pixel(x + drift, y - 0.8, 0.1)) < NEAR

    wait_for(shown, 20, "the wall that the scan hit")
    wait_for(lambda: shown() and page.locator("img[src^=blob]").is_visible(), what="the image beside it")
    choose(page, "Fixed frame", "map")
    wait_for(lambda: shown(0.3), 20, "the wall where it is in that frame")
    choose(page, "Fixed frame", "world")
    wait_for(shown, 20, "the wall where the robot truly is")
    for name in ("LaserScan: scan", "Image: eye"):
        page.get_by_text(name, exact=True).click()
    wait_for(lambda: not colored(page, wall), what="no scan")
    before = len(axes(page))
    page.get_by_text("TF", exact=True).click()
    wait_for(lambda: len(axes(page)) > before + 20, what="the axes of the frames")
    page.get_by_text("TF", exact=True).click()
    wait_for(lambda: len(axes(page)) < before + 10, what="no axes")
    page.get_by_role("tab", name="Drive").click()


def test_a_path_stays_in_its_frame_while_the_robot_moves(page: Page, bus: Bus, odom: Latest[Odometry]) -> None:
    page.get_by_role("tab", name="Displays").click()
    x, y = 0.0, 0.0
    put(bus, odom, x, y)
    message = odom.read()[0]
    assert message is not None
    plan = bus.publisher("plan", PathMessage)
    page.get_by_text("Path: plan", exact=True).click()
    line = [PoseStamped(pose=Pose(Point(x + ahead, y - 0.8))) for ahead in (-0.1, 0.1)]

    def shown() -> bool:
        found = colored(page, measured)  # it has the same green
        return bool(found) and math.dist(np.mean(found, axis=0), pixel(x, y - 0.8, 0.0)) < NEAR

    def published() -> bool:
        plan.put(PathMessage(Header(frame_id=message.header.frame_id), line))
        return shown()

    wait_for(published, 20, "the path")
    for way in (0.5, 0.0):
        put(bus, odom, x, y + way)
        wait_for(lambda way=way: shows_it_at(page, x, y + way), what="the robot elsewhere")  # type: ignore[misc]
        wait_for(shown, what="the path where it was")
    page.get_by_text("Path: plan", exact=True).click()
    page.get_by_role("tab", name="Drive").click()


def test_what_is_drawn_in_a_fixed_frame_goes_and_comes_with_that_frame_and_with_the_robot(
    page: Page, bus: Bus, odom: Latest[Odometry]
) -> None:
    rover = data.find("urdf", "mecanum.urdf.xacro")
    spawn_file(bus, rover, "rover", Place(x=8.0))  # out of sight, and so is what it sees in the world
    scans, frames = bus.publisher("rover/scan", LaserScan), bus.publisher("rover/tf", TFMessage)
    page.get_by_role("tab", name="Displays").click()
    choose(page, "Robot", "rover")
    gone = page.get_by_text("the frame hall is gone")
    put(bus, odom, 0.0, 0.0)
    seen = (0.0, -0.8)  # beside the other robot

    def scan(parent: str = "") -> Any:
        """Publish a wall, and where odometry began in `parent`. Returns the pixels of the wall."""
        first, many = math.atan2(seen[1], seen[0]) - 0.05, [math.hypot(*seen)] * 11
        scans.put(LaserScan(Header(frame_id="hall"), first, angle_increment=0.01, range_max=5.0, ranges=many))
        if parent:
            at = TransformMessage(Vector3(1.0))
            frames.put(TFMessage([TransformStamped(Header(frame_id=parent), "rover/odom", at)]))
        return colored(page, wall)

    def shown() -> bool:
        found = scan("hall")
        return bool(found) and math.dist(np.mean(found, axis=0), pixel(*seen, 0.0)) < NEAR

    fixed = page.get_by_text("Fixed frame", exact=True).locator("xpath=following::input[1]")
    hall = page.get_by_role("option", name="hall", exact=True)

    def chosen() -> bool:
        scan("hall")
        if fixed.input_value() != "hall":
            fixed.click()
            if hall.is_visible():
                hall.click()
        return fixed.input_value() == "hall"

    wait_for(chosen, 20, "the frame to be offered and chosen")
    page.get_by_text("LaserScan: scan", exact=True).click()  # the other robot, which is left by now, has one too
    wait_for(shown, 20, "the wall in the fixed frame")
    wait_for(lambda: not scan("cellar") and gone.is_visible(), 20, "the frame to be gone, since it has another name")
    wait_for(shown, 20, "the wall in the fixed frame that is back")
    wait_for(lambda: not scan() and gone.is_visible(), 20, "the frame to be gone, since nobody publishes it")
    wait_for(shown, 20, "the wall in the fixed frame that is back")
    assert not gone.is_visible()
    entities.delete(bus, "rover")
    page.get_by_text("rover is gone; choose another").wait_for()
    wait_for(lambda: not scan("hall"), 20, "no wall of a robot that is gone")
    spawn_file(bus, rover, "rover", Place(x=8.0))
    wait_for(shown, 20, "the wall of the robot that is back")
    scans.close()
    wait_for(
        lambda: not any(end.key == "rover/scan" and end.kind == "pub" for end in bus.endpoints()),
        what="no publisher of scans",
    )
    page.get_by_text("LaserScan: scan", exact=True).click()
    wait_for(lambda: not colored(page, wall), what="no wall, since it is switched off")
    entities.delete(bus, "rover")
    choose(page, "Robot", "hb_bot")
    page.get_by_role("tab", name="Drive").click()


def wall(red: Any, green: Any, blue: Any) -> Any:
    """The points that a scan hit."""
    return (red > 180) & (green < 60) & (blue < 60)


def axes(page: Page) -> list[tuple[int, int]]:
    """The pixels of axes that point up."""
    return colored(page, lambda r, g, b: (b > 130) & (r < 90) & (g < 90))


def test_a_number_of_a_topic_is_plotted_until_it_is_paused(page: Page, bus: Bus) -> None:
    numbers = bus.publisher("level", Range)
    sent = count(1)
    page.get_by_role("tab", name="Plots").click()
    choose(page, "Topic", "level")
    offered = page.get_by_text("Field", exact=True).locator("xpath=following::input[1]")

    def plotted() -> Any:
        numbers.put(Range(range=next(sent)))
        charts = "Object.values(window.__viserTestpoints?.uplots ?? {})"
        return page.evaluate(f"{charts}.map(one => Array.from(one.chart.data[1]))")

    wait_for(lambda: (plotted(), offered.input_value() != "(none)")[1], what="the fields of a message")
    choose(page, "Field", "range")
    page.get_by_role("button", name="Plot it").click()
    wait_for(lambda: len((plotted() or [[]])[0]) > 5, what="a plot")
    (line,) = plotted()
    assert line == sorted(line)
    page.get_by_text("Pause plots").click()
    wait_for(lambda: plotted() == plotted(), what="a plot that stands still")
    page.get_by_role("button", name="Remove").click()
    wait_for(lambda: plotted() == [], what="no plot")
    page.get_by_role("tab", name="Drive").click()


def test_what_is_spawned_and_deleted_by_its_buttons_comes_and_goes(page: Page, bus: Bus) -> None:
    def blue() -> int:
        return len(colored(page, lambda r, g, b: (b - r > 60) & (b > 90) & (r < 120)))

    before = blue()
    page.get_by_role("tab", name="World").click()
    choose(page, "Model", "mecanum")
    page.get_by_role("button", name="Spawn", exact=True).click()
    wait_for(lambda: "mecanum1" in entities.names(bus), what="the robot in the sim")
    wait_for(lambda: blue() > before + 50, what="a blue robot")
    choose(page, "Robot", "mecanum1")
    page.get_by_role("button", name="Delete the robot").click()
    wait_for(lambda: "mecanum1" not in entities.names(bus), what="it to be deleted")
    wait_for(lambda: blue() < before + 25, what="it to be gone")
    assert "hb_bot" in entities.names(bus)
    page.get_by_text("mecanum1 is gone; choose another").wait_for()
    choose(page, "Robot", "hb_bot")


def choose(page: Page, label: str, value: str) -> None:
    page.get_by_text(label, exact=True).locator("xpath=following::input[1]").click()
    page.get_by_role("option", name=value, exact=True).click()


def test_the_sim_is_paused_stepped_played_and_reset_by_its_buttons(
    page: Page, bus: Bus, odom: Latest[Odometry]
) -> None:
    latest = bus.latest("simulation_status", SimulationStatus)

    def status() -> SimulationStatus:
        found = latest.read()[0]
        return found or SimulationStatus()

    def click(name: str) -> None:
        page.get_by_role("button", name=name, exact=True).click()

    page.get_by_role("tab", name="World").click()
    click("Pause")
    wait_for(lambda: status().state == SimulationState.STATE_PAUSED, what="a paused sim")
    steps, epoch = status().steps, status().epoch
    click("Step")
    wait_for(lambda: status().steps == steps + 24, what="its steps")
    click("Play")
    wait_for(lambda: status().state == SimulationState.STATE_PLAYING, what="a sim that plays")
    click("Reset")
    wait_for(lambda: status().epoch > epoch, what="a new epoch")
    wait_for(lambda: math.hypot(*place(odom)) < 0.01, what="the robot at the start")


def test_a_robot_is_moved_by_its_handles(page: Page, bus: Bus, odom: Latest[Odometry]) -> None:
    page.get_by_role("tab", name="World").click()
    page.get_by_text("Move by handles").click()
    x, y = 0.0, 0.0
    put(bus, odom, x, y)
    wait_for(lambda: colored(page, lambda r, g, b: (g - r > 40) & (g - b > 30)), what="the handles; one is green")

    def moved() -> bool:
        for ahead, act in ((0.96, page.mouse.down), (1.1, str), (1.3, str), (1.6, page.mouse.up)):
            page.mouse.move(*pixel(x + ahead, y, 0.0))
            page.evaluate(TWO_FRAMES)  # the page looks where the pointer is once in a frame
            act()
        return is_soon(lambda: place(odom)[0] > x + 0.2)

    wait_for(moved, what="the robot to be moved")
    page.get_by_text("Move by handles").click()


def test_a_goal_that_is_set_by_a_click_on_the_ground_is_reached(
    page: Page, town: Wire, bus: Bus, odom: Latest[Odometry]
) -> None:
    controller = town.start("controller", "--laps", "0")
    wait_for(lambda: any(one.node == "controller" and one.kind == "sub" for one in bus.endpoints()))
    page.get_by_role("tab", name="World").click()
    page.get_by_role("button", name="Set a goal").click()
    page.get_by_text("click on the ground").wait_for()
    page.mouse.click(*pixel(0.2, -0.5, 0.0))
    page.get_by_text("goal 0.2").wait_for()
    controller.wait_for_line("goal_pose: (0.2")
    page.get_by_role("button", name="Resume", exact=True).click()  # others drove the robot before
    wait_for(lambda: math.dist(place(odom), (0.2, -0.5)) < 0.04 and speed(odom) < 0.01, 20, "the robot at the goal")
    controller.terminate()


def test_it_is_grey_when_the_sim_is_killed_and_comes_back_with_it(page: Page, town: Wire, sim: Process) -> None:
    wait_for(lambda: deck(page), what="an orange robot")
    sim.kill()
    wait_for(lambda: deck(page) is None, what="a grey robot")
    town.start("sim").wait_for_line("listens on")
    wait_for(lambda: shows_it_at(page, 0.0, 0.0), what="an orange robot at the start")


def test_the_camera_follows_and_looks_down(page: Page, bus: Bus, odom: Latest[Odometry]) -> None:
    middle = (SIZE["width"] / 2, SIZE["height"] / 2)

    def in_the_middle() -> bool:
        found = deck(page)
        return found is not None and math.dist(found, middle) < 2 * NEAR

    page.get_by_role("tab", name="World").click()
    page.get_by_text("Follow", exact=True).click()
    for x in (1.0, 3.0):
        put(bus, odom, x, 2.0)
        wait_for(in_the_middle, what=f"the robot at {x} in the middle")
    page.get_by_text("Follow", exact=True).click()
    page.get_by_role("button", name="Top view").click()
    wait_for(in_the_middle, what="the robot from above in the middle")


def test_a_bag_is_played_with_a_slider_for_its_time(town: Wire, opened: Open, tmp_path: Path) -> None:
    bag = town.start("view", "--port", "0", str(a_bag(tmp_path / "a.mcap")))
    page = opened(address(bag), ready="paused")  # its 2 s are over
    wait_for(lambda: shows_arrow_at(page, 1.9), what="where it ended")
    slider = page.get_by_text("Time, s", exact=True).locator("xpath=following::input[not(@type='hidden')][1]")
    slider.fill("0.5")
    wait_for(lambda: shows_arrow_at(page, 0.5), what="where it was after half a second")
    assert page.get_by_text("Forward").count() == 0, "a bag is not driven"
    page.close()


def shows_arrow_at(page: Page, x: float) -> bool:
    """Whether the orange arrow of a robot without a description is there."""
    middle = deck(page)
    return middle is not None and math.dist(middle, pixel(x, 0.0, 0.03)) < NEAR


def test_the_sims_are_asked_for_the_scene_less_often_while_no_page_is_open(wire: Wire, opened: Open) -> None:
    requests: list[GetSceneRequest] = []

    def answer(request: GetSceneRequest) -> GetSceneReply:
        requests.append(request)
        return GetSceneReply()

    def is_busy() -> bool:
        before = len(requests)
        return is_soon(lambda: len(requests) > before + 5)

    wire.bus("sim").serve("get_scene", GetSceneRequest, GetSceneReply, answer).start()
    page = opened(address(wire.start("view", "--port", "0")), ready="no robot is there")
    wait_for(is_busy, what="many requests")
    page.close()
    wait_for(lambda: not is_busy(), what="few requests")


def test_a_page_needs_the_token(chromium: Browser, page: Page, view: str) -> None:
    assert page.url == view, "it was let in"
    without, _, token = view.partition("?")
    assert token == f"token={TOKEN}"
    context = chromium.new_context()
    other = context.new_page()
    refused = other.goto(without)
    assert refused is not None and refused.status == 403
    assert "the address needs the token" in other.content()
    context.close()
