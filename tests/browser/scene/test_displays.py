"""What the page draws: the robot, what topics hold, a bag."""

import math
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page

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
    TFMessage,
    TransformStamped,
    Vector3,
)
from holozen.messages import Path as PathMessage
from holozen.messages import Transform as TransformMessage
from holozen.rotation import Transform, yaw
from holozen.spawning import SpawnPose, spawn_file
from holozen.testing import Wire, wait_for
from holozen.transport.pubsub import Latest
from tests.extensions.bags.bags import a_bag

from ..conftest import Open, address, is_soon
from ..driving import place, stands
from .pixels import NEAR, SIZE, choose, colored, deck, pixel, put, shows_it_at

pytestmark = [pytest.mark.needs("chromium"), pytest.mark.alone]


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
            lambda: math.dist(place(odom), start) > 0.5 and bool(colored(page, measured))
        )

    wait_for(moved, 20, "the robot and the arrow of its velocity")
    page.keyboard.up("a")
    wait_for(lambda: stands(odom), what="rest")
    wait_for(lambda: shows_it_at(page, *place(odom)), what="the robot where it is now")
    wait_for(lambda: not colored(page, measured), what="no arrow of a robot that stands")
    wait_for(
        lambda: colored(page, lambda r, g, b: (r - g > 90) & (b - g > 60)),
        what="its trail, from under it",
    )


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
    # `uncheck` would look at it again after the click, when it is gone from the list.
    page.get_by_label("LaserScan: scan").click()
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
