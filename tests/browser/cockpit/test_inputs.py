"""Each way to drive from the page."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page

from holozen import data, entities
from holozen.messages import Header, Image, Odometry, Time
from holozen.spawning import SpawnPose, put, read, spawn_file
from holozen.testing import Wire, wait_for
from holozen.transport.pubsub import Latest

from ..conftest import Open, address, insist
from ..driving import (
    KEYS,
    MOVES,
    drive,
    has_signs,
    hold,
    place,
    stands,
    stays,
    stops_near,
    tap,
    velocity,
)

pytestmark = [pytest.mark.needs("chromium"), pytest.mark.alone]

PHONE = {"width": 390, "height": 844}
GAMEPAD = """axes => {
    window.looks = 0;
    navigator.getGamepads = () => {
        looks += 1;
        return axes && [{connected: true, axes, buttons: Array(17).fill({pressed: false})}] || [];
    };
}"""


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

    def both(press: Callable[[str], None]) -> None:
        press("w")
        press("a")

    keyboard = page.keyboard
    drive(lambda: both(keyboard.down), lambda: both(keyboard.up), odom, 1, 1, 0)
    page.keyboard.up("w")
    wait_for(lambda: has_signs(odom, (0, 1, 0)), what="the one that is still held")
    page.keyboard.up("a")
    wait_for(lambda: stands(odom), what="rest")


def test_the_round_stick_translates_and_its_ring_turns_by_mouse(
    page: Page, odom: Latest[Odometry]
) -> None:
    x, y = middle(page, "#move")

    def drag(*points: tuple[float, float]) -> None:
        page.mouse.move(*points[0])
        page.mouse.down()
        page.mouse.move(*points[1])

    drive(lambda: drag((x, y), (x - 45, y)), page.mouse.up, odom, 0, 1, 0)
    page.mouse.move(x + 5, y + 45)
    wait_for(lambda: velocity(odom)[0] < -MOVES, what="the robot to go back")
    page.mouse.up()
    stops_near(odom, place(odom))
    drive(lambda: drag((x, y - 78), (x + 60, y - 50)), page.mouse.up, odom, 0, 0, -1)
    page.mouse.up()
    wait_for(lambda: stands(odom), what="rest")


def test_two_thumbs_drive_on_a_phone_until_they_are_lifted_or_the_browser_takes_them(
    opened: Open, odom: Latest[Odometry]
) -> None:
    phone = opened(viewport=PHONE, is_mobile=True, has_touch=True)
    touch = phone.context.new_cdp_session(phone)
    (x, y), (u, v) = middle(phone, "#move"), middle(phone, "#thumb")
    left, right = {"x": x, "y": y - 45, "id": 1}, {"x": u - 45, "y": v, "id": 2}

    kinds = list[str]()

    def put(kind: str, *fingers: Any) -> None:
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": list(fingers)})
        kinds.append(kind)

    def lift() -> None:
        if kinds[-1:] == ["touchStart"]:
            put("touchEnd")

    drive(lambda: put("touchStart", left), lift, odom, 1, 0, 0)
    put("touchStart", left, right)
    wait_for(lambda: has_signs(odom, (1, 0, 1)), what="and to turn left")
    put("touchEnd")
    stops_near(odom, place(odom))
    drive(lambda: put("touchStart", left, right), lift, odom, 1, 0, 1)
    put("touchCancel")
    stops_near(odom, place(odom))
    assert stays(odom)


def test_a_gamepad_drives_and_has_to_be_let_go_after_a_stop(
    page: Page, odom: Latest[Odometry]
) -> None:
    def let_go() -> None:
        page.evaluate(GAMEPAD, [0, 0, 0, 0])
        wait_for(lambda: page.evaluate("looks > 0"), what="the page to look")

    drive(lambda: page.evaluate(GAMEPAD, [-0.8, 0, 0, 0]), let_go, odom, 0, 1, 0)
    page.keyboard.press("k")
    stops_near(odom, place(odom))
    assert stays(odom), "it is still pushed"
    drive(lambda: page.evaluate(GAMEPAD, [0, 0, 0.8, 0]), let_go, odom, 0, 0, -1)
    page.evaluate(GAMEPAD, None)
    wait_for(lambda: stands(odom), what="rest, since it is gone")


def test_a_click_into_the_scene_lets_go_and_gives_the_keys_back(
    page: Page, odom: Latest[Odometry]
) -> None:
    hold(page, "w", odom)
    page.mouse.click(640, 300)
    stops_near(odom, place(odom))
    page.keyboard.up("w")
    tap(page, "d", odom)


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
        hold(page, "w", odom)
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

    def press() -> None:
        page.keyboard.up("w")
        page.keyboard.down("w")

    insist(press, page.get_by_text("Stopped: 0.1 m ahead.").is_visible, "a stop before the wall")
    wait_for(lambda: stands(scout), what="the robot to stand before the wall")
    page.keyboard.up("w")
    hold(page, "s", scout)
    page.keyboard.up("s")
    for name in ("Scout", "wall"):
        entities.delete(bus, name)
