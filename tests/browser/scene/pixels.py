"""Where the scene shows what is in the world."""

import io
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from PIL import Image as Picture
from playwright.sync_api import Page

from holozen.bus import Bus
from holozen.messages import Odometry, Point, Pose
from holozen.messages.simulation_interfaces import (
    EntityState,
    SetEntityStateReply,
    SetEntityStateRequest,
)
from holozen.testing import wait_for
from holozen.transport.pubsub import Latest
from holozen.view.open_page import ASIDE, BACK, UP
from holozen.view.scene import FIELD

from ..driving import place

TOP, DECK_HEIGHT = 48, 208  # pixels of the page above the scene, and below it
# pixels of the scene; a software renderer takes its time for each
SIZE = {"width": 960, "height": 320}
# pixels of the scene without controls of the page; its notices are below
FREE: Any = {"x": 251, "y": 0, "width": 369, "height": 250}
DEPTH = -0.04  # m; the height at which hb_bot stands
DECK = 0.295  # m; the height of hb_bot's orange deck
EXACT = 7  # pixels; the same for a camera that is where it has to be
NEAR = 14  # pixels between the middle of what is seen of the deck, and the robot's


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


def choose(page: Page, robot: str) -> None:
    page.locator("nav").get_by_role("button", name=robot).click()
    page.locator(f"nav [aria-pressed=true]:text('{robot}')").wait_for()
