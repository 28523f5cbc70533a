"""What the page's drawer and clicks change in the world, and what is drawn then."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Picture
from playwright.sync_api import Page

from holozen import data, entities
from holozen.bus import Bus
from holozen.messages import Odometry, SimulationStatus
from holozen.messages.simulation_interfaces import SimulationState
from holozen.spawning import SpawnPose, spawn_file
from holozen.testing import Process, Wire, wait_for
from holozen.transport.pubsub import Latest

from ..conftest import insist, press
from ..driving import place, stands, tap
from .pixels import NEAR, SIZE, TOP, choose, colored, deck, pixel, put, shows_it_at

pytestmark = [pytest.mark.needs("chromium"), pytest.mark.alone]


def test_what_is_spawned_and_deleted_by_its_buttons_comes_and_goes(page: Page, bus: Bus) -> None:
    def blue() -> int:
        return len(colored(page, lambda r, g, b: (b - r > 60) & (b > 90) & (r < 120)))

    before = blue()
    page.get_by_label("Model", exact=True).select_option("mecanum")
    insist(
        page.get_by_role("button", name="Spawn", exact=True).click,
        lambda: "mecanum1" in entities.names(bus),
        "the robot in the sim",
    )
    wait_for(lambda: blue() > before + 50, what="a blue robot")
    choose(page, "mecanum1")

    def delete() -> None:
        page.get_by_role("button", name="Delete the robot").click()
        assert "mecanum1" in entities.names(bus), "it asks twice"
        page.get_by_role("button", name="Really delete mecanum1?").click()

    insist(delete, lambda: "mecanum1" not in entities.names(bus), "it to be deleted")
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


def test_a_click_on_a_robot_chooses_it(page: Page, bus: Bus) -> None:
    spawn_file(bus, data.find("urdf", "mecanum.urdf.xacro"), "other", SpawnPose(x=0.2, y=1.0))

    x, y = pixel(0.2, 1.0, 0.1)
    insist(
        lambda: page.mouse.click(x, TOP + y),
        page.locator("nav [aria-pressed=true]:text('other')").is_visible,
        "the other robot to be chosen",
    )
    choose(page, "hb_bot")
    entities.delete(bus, "other")


def test_the_sim_is_paused_stepped_played_and_reset_by_its_buttons(
    page: Page, bus: Bus, odom: Latest[Odometry]
) -> None:
    latest = bus.latest("simulation_status", SimulationStatus)

    def status() -> SimulationStatus:
        found = latest.read()[0]
        return found or SimulationStatus()

    def click(name: str, condition: Callable[[], bool], what: str) -> None:
        button = page.locator("#simulation").get_by_role("button", name=name, exact=True)
        insist(button.click, condition, what)

    click("Pause", lambda: status().state == SimulationState.STATE_PAUSED, "a paused sim")
    steps, epoch = status().steps, status().epoch
    click("Step", lambda: status().steps == steps + 24, "its steps")
    click("Play", lambda: status().state == SimulationState.STATE_PLAYING, "a sim that plays")
    click("Reset", lambda: status().epoch > epoch, "a new epoch")
    wait_for(lambda: math.hypot(*place(odom)) < 0.01, what="the robot at the start")


def click(page: Page, x: float, y: float) -> None:
    """Click on a point of the ground."""
    column, row = pixel(x, y, 0.0)
    page.mouse.click(column, TOP + row)


def test_a_robot_is_moved_to_where_one_clicks(page: Page, odom: Latest[Odometry]) -> None:
    def move() -> None:
        page.get_by_role("button", name="Move the robot").click()
        click(page, 0.3, 0.4)

    insist(move, lambda: math.dist(place(odom), (0.3, 0.4)) < 0.05, "the robot there")


def test_a_goal_that_is_set_by_a_click_on_the_ground_is_reached(
    page: Page, town: Wire, bus: Bus, odom: Latest[Odometry]
) -> None:
    tap(page, "a", odom)
    controller = town.start("controller", "--laps", "0")
    wait_for(lambda: any(one.node == "controller" and one.kind == "sub" for one in bus.endpoints()))

    def set_goal() -> None:
        page.get_by_role("button", name="Set a goal").click()
        click(page, 0.2, -0.5)

    insist(set_goal, page.get_by_text("goal 0.2").is_visible, "the goal in the page")
    controller.wait_for_line("goal_pose: (0.2")
    drive = page.get_by_role("button", name="Let the controller drive")  # a person drove last
    drive.wait_for()
    insist(lambda: press(drive), drive.is_hidden, "it to drive")
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
