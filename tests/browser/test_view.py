"""What the page of `holozen view` shows in a real browser, and what its drawer changes in the
world.
"""

import io
import math
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Picture
from playwright.sync_api import Browser, Page

from holozen import data, entities
from holozen.bus import Bus
from holozen.messages import (
    Header,
    LaserScan,
    Odometry,
    Point,
    Pose,
    PoseStamped,
    Range,
    SimulationStatus,
    TFMessage,
    TransformStamped,
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
from holozen.spawning import SpawnPose, spawn_file
from holozen.testing import Process, Wire, wait_for
from holozen.transport.pubsub import Latest
from holozen.view.open_page import ASIDE, BACK, UP
from holozen.view.scene import FIELD
from tests.extensions.bags.bags import a_bag

from .conftest import address, is_soon

pytestmark = [pytest.mark.needs("chromium"), pytest.mark.alone]

TOP, DECK_HEIGHT = 48, 208  # pixels of the page above the scene, and below it
# pixels of the scene; a software renderer takes its time for each
SIZE = {"width": 960, "height": 320}
# pixels of the scene without controls of the page; its notices are below
FREE: Any = {"x": 251, "y": 0, "width": 369, "height": 250}
DEPTH = -0.04  # m; the height at which hb_bot stands
DECK = 0.295  # m; the height of hb_bot's orange deck
EXACT = 7  # pixels; the same for a camera that is where it has to be
NEAR = 14  # pixels between the middle of what is seen of the deck, and the robot's
TWO_FRAMES = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
FEW_FRAMES = """
    if (self !== top) {
    const frame = window.requestAnimationFrame.bind(window);
    window.requestAnimationFrame = draw => setTimeout(() => frame(draw), 200);
    window.cancelAnimationFrame = clearTimeout;
    }
"""
"""Draws at most 5 frames a second: a software renderer would take both cores for as many as it can.
"""
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


Open = Callable[..., Page]


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
        page = context.new_page()
        page.on(
            "console",
            lambda reported: faults.append(reported.text) if reported.type == "error" else None,
        )
        page.on("pageerror", lambda error: faults.append(str(error)))
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


def place(odom: Latest[Odometry]) -> tuple[float, float]:
    message = odom.read()[0]
    assert message is not None
    return message.pose.pose.position.x, message.pose.pose.position.y


def put(bus: Bus, odom: Latest[Odometry], x: float, y: float) -> None:
    """Place the robot there."""
    request = SetEntityStateRequest("hb_bot", EntityState(pose=Pose(Point(x, y, -0.04))))
    bus.call("set_entity_state", request, SetEntityStateReply)
    wait_for(lambda: math.dist(place(odom), (x, y)) < 0.001, what=f"the robot at {x}, {y}")


def pixel(
    x: float, y: float, z: float, robot: tuple[float, float] = (0.0, 0.0)
) -> tuple[float, float]:
    """The pixel of the scene where a point of the world is, for a page that follows a robot at that
    place.
    """
    at = np.array((*robot, DEPTH))
    eye, forward = at + np.array((-BACK, -ASIDE, UP)), np.array((BACK, ASIDE, -UP))
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, (0, 0, 1))
    right /= np.linalg.norm(right)
    away = np.array((x, y, z)) - eye
    scale = SIZE["height"] / 2 / math.tan(FIELD / 2) / (away @ forward)
    return SIZE["width"] / 2 + scale * (away @ right), SIZE["height"] / 2 - scale * (
        away @ np.cross(right, forward)
    )


def colored(page: Page, color: Callable[[Any, Any, Any], Any]) -> list[tuple[int, int]]:
    """The pixels (x, y) of a colour."""
    picture = Picture.open(io.BytesIO(page.screenshot(clip=FREE | {"y": TOP + FREE["y"]})))
    red, green, blue = np.asarray(picture.convert("RGB"), np.float32).transpose(2, 0, 1)
    rows, columns = np.nonzero(color(red, green, blue)) + np.array([[FREE["y"]], [FREE["x"]]])
    return list(zip(columns.tolist(), rows.tolist(), strict=True))


def deck(page: Page) -> tuple[float, float] | None:
    """The middle of the orange pixels, if there are any."""
    found = colored(page, lambda r, g, b: (r > 150) & (r - b > 70) & (r - g > 25) & (g - b > 25))
    return tuple(np.mean(found, axis=0).tolist()) if len(found) > 60 else None


def shows_it_at(page: Page, x: float, y: float, within: float = NEAR) -> bool:
    middle = deck(page)
    return middle is not None and math.dist(middle, pixel(x, y, DECK)) < within


def stands(odom: Latest[Odometry]) -> bool:
    message = odom.read()[0]
    return message is not None and message.twist.twist.is_slow(0.01)


def test_a_bag_is_played_with_a_slider_for_its_time(
    town: Wire, opened: Open, tmp_path: Path
) -> None:
    bag = town.start("view", "--port", "0", str(a_bag(tmp_path / "a.mcap")))
    # its 2 s are over; and no other page of this file is open yet, which would be drawn as well
    page = opened(address(bag), ready="paused")

    def shows_arrow() -> bool:
        """After the camera was aimed anew: a page that opens slowly may replace it by its own."""
        for view in ("Top", "Follow"):
            page.get_by_role("button", name=view, exact=True).click()
        return is_soon(lambda: shows_arrow_at(page))

    wait_for(shows_arrow, what="a robot without a description")
    page.get_by_label("Time, s").fill("0.5")
    page.locator("#at:text('0.5 s')").wait_for()
    assert not page.get_by_role("button", name="STOP", exact=True).is_visible(), (
        "a bag is not driven"
    )
    page.close()


def shows_arrow_at(page: Page) -> bool:
    """Whether the orange arrow of a robot without a description is in the middle."""
    middle = deck(page)
    return (
        middle is not None and math.dist(middle, (SIZE["width"] / 2, SIZE["height"] / 2)) < 4 * NEAR
    )


def test_the_robot_is_where_its_odometry_places_it_in_its_colours_and_moves_when_driven(
    page: Page, odom: Latest[Odometry]
) -> None:
    start = place(odom)
    assert not colored(page, measured)

    def moved() -> bool:
        page.keyboard.up("a")  # again if the browser was too busy to keep it held
        page.keyboard.down("a")
        return is_soon(
            lambda: math.dist(place(odom), start) > 0.2 and bool(colored(page, measured))
        )

    wait_for(moved, 20, "the robot and the arrow of its velocity")
    page.keyboard.up("a")
    wait_for(lambda: stands(odom), what="rest")
    wait_for(lambda: shows_it_at(page, *place(odom)), what="the robot where it is now")
    wait_for(lambda: not colored(page, measured), what="no arrow of a robot that stands")
    assert colored(page, lambda r, g, b: (r - g > 90) & (b - g > 60)), "its trail"


def measured(red: Any, green: Any, blue: Any) -> Any:
    """The arrow of the velocity measured by odometry."""
    return (green - red > 60) & (green - blue > 60)


def test_displays_show_what_topics_hold_in_the_frames_of_tf(
    page: Page, bus: Bus, odom: Latest[Odometry]
) -> None:
    scans, frames = bus.publisher("scan", LaserScan), bus.publisher("tf", TFMessage)
    page.get_by_label("LaserScan: scan").check()
    x, y = 0.0, 0.0
    put(bus, odom, x, y)
    message = odom.read()[0]
    assert message is not None
    turned = yaw(Transform.of(Point(), message.pose.pose.orientation).rotation)

    def shown(drift: float = 0.0) -> bool:
        at = TransformMessage(Vector3(0.0, 0.0, 0.1))
        there = TransformStamped(
            Header(frame_id="map"), message.header.frame_id, TransformMessage(Vector3(0.3))
        )
        # named as the choice is
        above = TransformStamped(Header(frame_id="world"), "map", TransformMessage())
        frames.put(
            TFMessage(
                [
                    TransformStamped(Header(frame_id=message.child_frame_id), "laser", at),
                    there,
                    above,
                ]
            )
        )
        first, many = -turned - math.pi / 2 - 0.05, [0.8] * 11
        scans.put(
            LaserScan(
                Header(frame_id="laser"), first, angle_increment=0.01, range_max=5.0, ranges=many
            )
        )
        found = colored(page, wall)
        return (
            bool(found) and math.dist(np.mean(found, axis=0), pixel(x + drift, y - 0.8, 0.1)) < NEAR
        )

    wait_for(shown, 20, "the wall that the scan hit")
    fix(page, "map", shown)
    wait_for(lambda: shown(0.3), 20, "the wall where it is in that frame")
    fix(page, "world", shown)
    wait_for(shown, 20, "the wall where the robot truly is")
    page.get_by_label("LaserScan: scan").uncheck()
    wait_for(lambda: not colored(page, wall), what="no scan")
    before = len(axes(page))
    page.get_by_label("TF", exact=True).check()
    wait_for(lambda: len(axes(page)) > before + 20, what="the axes of the frames")
    page.get_by_label("TF", exact=True).uncheck()
    wait_for(lambda: len(axes(page)) < before + 10, what="no axes")


def fix(page: Page, frame: str, publish: Callable[[], object]) -> None:
    """Choose the fixed frame, once it is offered."""
    choice = page.get_by_label("Fixed frame")

    def offered() -> bool:
        publish()
        return frame in choice.locator("option").all_inner_texts()

    wait_for(offered, 20, f"{frame} to be offered")
    choice.select_option(frame)


def test_a_path_stays_in_its_frame_while_the_robot_moves(
    page: Page, bus: Bus, odom: Latest[Odometry]
) -> None:
    x, y = 0.0, 0.0
    put(bus, odom, x, y)
    message = odom.read()[0]
    assert message is not None
    plan = bus.publisher("plan", PathMessage)
    page.get_by_label("Path: plan").check()
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
    page.get_by_label("Path: plan").uncheck()


def test_what_is_drawn_in_a_fixed_frame_goes_and_comes_with_that_frame_and_with_the_robot(
    page: Page, bus: Bus, odom: Latest[Odometry]
) -> None:
    rover = data.find("urdf", "mecanum.urdf.xacro")
    # out of sight, and so is what it sees in the world
    spawn_file(bus, rover, "rover", SpawnPose(x=8.0))
    scans, frames = bus.publisher("rover/scan", LaserScan), bus.publisher("rover/tf", TFMessage)
    choose(page, "rover")
    gone = page.get_by_text("the frame hall is gone")
    put(bus, odom, 0.0, 0.0)
    seen = (0.0, -0.8)  # beside the other robot

    def scan(parent: str = "") -> Any:
        """Publish a wall, and where odometry began in `parent`. Returns the pixels of the wall."""
        first, many = math.atan2(seen[1], seen[0]) - 0.05, [math.hypot(*seen)] * 11
        scans.put(
            LaserScan(
                Header(frame_id="hall"), first, angle_increment=0.01, range_max=5.0, ranges=many
            )
        )
        if parent:
            at = TransformMessage(Vector3(1.0))
            frames.put(TFMessage([TransformStamped(Header(frame_id=parent), "rover/odom", at)]))
        return colored(page, wall)

    def shown() -> bool:
        found = scan("hall")
        return bool(found) and math.dist(np.mean(found, axis=0), pixel(*seen, 0.0)) < NEAR

    fix(page, "hall", lambda: scan("hall"))
    page.get_by_label(
        "LaserScan: scan"
    ).check()  # the other robot, which is left by now, has one too
    wait_for(shown, 20, "the wall in the fixed frame")
    wait_for(
        lambda: not scan("cellar") and gone.is_visible(),
        20,
        "the frame to be gone, since it has another name",
    )
    wait_for(shown, 20, "the wall in the fixed frame that is back")
    wait_for(
        lambda: not scan() and gone.is_visible(),
        20,
        "the frame to be gone, since nobody publishes it",
    )
    wait_for(shown, 20, "the wall in the fixed frame that is back")
    assert not gone.is_visible()
    entities.delete(bus, "rover")
    page.get_by_text("rover is gone.").wait_for()
    wait_for(lambda: not scan("hall"), 20, "no wall of a robot that is gone")
    spawn_file(bus, rover, "rover", SpawnPose(x=8.0))
    wait_for(shown, 20, "the wall of the robot that is back")
    scans.close()
    wait_for(
        lambda: not any(end.key == "rover/scan" and end.kind == "pub" for end in bus.endpoints()),
        what="no publisher of scans",
    )
    page.get_by_label("LaserScan: scan").uncheck()
    wait_for(lambda: not colored(page, wall), what="no wall, since it is switched off")
    entities.delete(bus, "rover")
    choose(page, "hb_bot")


def wall(red: Any, green: Any, blue: Any) -> Any:
    """The points that a scan hit."""
    return (red > 180) & (green < 60) & (blue < 60)


def axes(page: Page) -> list[tuple[int, int]]:
    """The pixels of axes that point up."""
    return colored(page, lambda r, g, b: (b > 130) & (r < 90) & (g < 90))


def test_a_number_of_a_topic_is_plotted_until_it_is_paused(page: Page, bus: Bus) -> None:
    numbers = bus.publisher("level", Range)
    sent = count(1)

    def has(label: str, option: str) -> bool:
        numbers.put(Range(range=next(sent)))
        return option in page.get_by_label(label).last.locator("option").all_inner_texts()

    wait_for(lambda: has("Topic", "level"), what="the topic")
    page.locator("#topic").select_option("level")
    wait_for(lambda: has("Field", "range"), what="the fields of a message")
    assert page.get_by_label("Field").input_value() == "range", "what a person looks at comes first"
    page.get_by_role("button", name="Plot it").click()

    def points() -> int:
        numbers.put(Range(range=next(sent)))
        return int(page.locator(".plot canvas").get_attribute("data-points") or 0)

    wait_for(lambda: points() > 5, what="a plot")
    page.get_by_label("Pause plots").check()
    wait_for(lambda: points() == points() == points(), what="a plot that stands still")
    page.get_by_role("button", name="Remove").click()
    assert page.locator(".plot").count() == 0
    page.get_by_label("Pause plots").uncheck()


def test_what_is_spawned_and_deleted_by_its_buttons_comes_and_goes(page: Page, bus: Bus) -> None:
    def blue() -> int:
        return len(colored(page, lambda r, g, b: (b - r > 60) & (b > 90) & (r < 120)))

    before = blue()
    page.get_by_label("Model", exact=True).select_option("mecanum")
    page.get_by_role("button", name="Spawn", exact=True).click()
    wait_for(lambda: "mecanum1" in entities.names(bus), what="the robot in the sim")
    wait_for(lambda: blue() > before + 50, what="a blue robot")
    choose(page, "mecanum1")
    page.get_by_role("button", name="Delete the robot").click()
    assert "mecanum1" in entities.names(bus), "it asks twice"
    page.get_by_role("button", name="Really delete mecanum1?").click()
    wait_for(lambda: "mecanum1" not in entities.names(bus), what="it to be deleted")
    assert "hb_bot" in entities.names(bus)
    page.get_by_text("mecanum1 is gone.").wait_for()
    page.get_by_role("button", name="Drive hb_bot").click()
    page.locator("nav [aria-pressed=true]:text('hb_bot')").wait_for()


def test_the_picture_on_an_object_is_drawn_upright(page: Page, bus: Bus, tmp_path: Path) -> None:
    pixels = np.zeros((64, 64, 3), np.uint8)
    pixels[:32], pixels[32:] = (0, 255, 0), (0, 0, 255)  # green above blue
    Picture.fromarray(pixels).save(tmp_path / "flag.png")
    (tmp_path / "flag.urdf").write_text(
        """<robot name="flag"><link name="flag"><inertial><mass value="1"/>
        <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
        <visual><geometry><box size="0.05 0.5 0.6"/></geometry>
        <material name="flag"><texture filename="flag.png"/></material></visual>
        <collision><geometry><box size="0.05 0.5 0.6"/></geometry></collision></link></robot>"""
    )
    spawn_file(bus, tmp_path / "flag.urdf", "flag", SpawnPose(x=1.0, z=0.3))

    def shows_green_above_blue() -> bool:
        green = colored(page, lambda r, g, b: (g - r > 60) & (g - b > 60))
        blue = colored(page, lambda r, g, b: (b - r > 60) & (b - g > 60))
        if min(len(green), len(blue)) < 200:
            return False
        return bool(np.mean(green, axis=0)[1] < np.mean(blue, axis=0)[1] - 10)

    wait_for(shows_green_above_blue, what="a box that is green above and blue below")
    entities.delete(bus, "flag")


def choose(page: Page, robot: str) -> None:
    page.locator("nav").get_by_role("button", name=robot).click()
    page.locator(f"nav [aria-pressed=true]:text('{robot}')").wait_for()


def test_a_click_on_a_robot_chooses_it(page: Page, bus: Bus) -> None:
    spawn_file(bus, data.find("urdf", "mecanum.urdf.xacro"), "other", SpawnPose(x=0.2, y=1.0))

    def chosen() -> bool:
        x, y = pixel(0.2, 1.0, 0.1)
        page.mouse.click(x, TOP + y)
        return is_soon(page.locator("nav [aria-pressed=true]:text('other')").is_visible)

    wait_for(chosen, 20, "the other robot to be chosen")
    choose(page, "hb_bot")
    entities.delete(bus, "other")


def test_the_sim_is_paused_stepped_played_and_reset_by_its_buttons(
    page: Page, bus: Bus, odom: Latest[Odometry]
) -> None:
    latest = bus.latest("simulation_status", SimulationStatus)

    def status() -> SimulationStatus:
        found = latest.read()[0]
        return found or SimulationStatus()

    def click(name: str) -> None:
        page.locator("#simulation").get_by_role("button", name=name, exact=True).click()

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


def click(page: Page, x: float, y: float) -> None:
    """Click on a point of the ground."""
    column, row = pixel(x, y, 0.0)
    page.mouse.click(column, TOP + row)


def test_a_robot_is_moved_to_where_one_clicks(page: Page, odom: Latest[Odometry]) -> None:
    page.get_by_role("button", name="Move the robot").click()
    click(page, 0.3, 0.4)
    wait_for(lambda: math.dist(place(odom), (0.3, 0.4)) < 0.05, what="the robot there")


def test_a_goal_that_is_set_by_a_click_on_the_ground_is_reached(
    page: Page, town: Wire, bus: Bus, odom: Latest[Odometry]
) -> None:
    controller = town.start("controller", "--laps", "0")
    wait_for(lambda: any(one.node == "controller" and one.kind == "sub" for one in bus.endpoints()))
    page.get_by_role("button", name="Set a goal").click()
    click(page, 0.2, -0.5)
    page.get_by_text("goal 0.2").wait_for()
    controller.wait_for_line("goal_pose: (0.2")
    page.get_by_role("button", name="Let the controller drive").click()  # a person drove before
    wait_for(
        lambda: math.dist(place(odom), (0.2, -0.5)) < 0.04 and stands(odom),
        20,
        "the robot at the goal",
    )
    controller.terminate()


def test_it_is_grey_when_the_sim_is_killed_and_comes_back_with_it(
    page: Page, town: Wire, sim: Process
) -> None:
    wait_for(lambda: deck(page), what="an orange robot")
    sim.kill()
    wait_for(lambda: deck(page) is None, what="a grey robot")
    town.start("sim").wait_for_line("listens on")
    wait_for(lambda: shows_it_at(page, 0.0, 0.0), what="an orange robot at the start")


def test_the_camera_follows_goes_behind_and_looks_down(
    page: Page, bus: Bus, odom: Latest[Odometry]
) -> None:
    middle = (SIZE["width"] / 2, SIZE["height"] / 2)

    def in_the_middle() -> bool:
        found = deck(page)
        return found is not None and math.dist(found, middle) < 4 * NEAR

    for view in ("Follow", "Behind", "Top"):
        page.get_by_role("button", name=view, exact=True).click()
        for x in (1.0, 3.0):
            put(bus, odom, x, 2.0)
            wait_for(in_the_middle, what=f"the robot at {x} in the middle of {view}")
    page.get_by_role("button", name="Free").click()
