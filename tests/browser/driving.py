"""How the robot moves while one drives it from the page."""

import math
from collections.abc import Callable

from playwright.sync_api import Page

from holozen.messages import Odometry
from holozen.testing import wait_for
from holozen.transport.pubsub import Latest

from .conftest import insist

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


def drive(
    begin: Callable[[], object], end: Callable[[], object], odom: Latest[Odometry], *signs: float
) -> None:
    """Hold what moves the robot; again if the browser was too busy to keep it held."""

    def again() -> None:
        end()
        begin()

    insist(again, lambda: has_signs(odom, signs), f"the robot to move {signs}")


def tap(page: Page, key: str, odom: Latest[Odometry]) -> None:
    """Hold a key until it moves the robot, let go, and wait for rest."""
    hold(page, key, odom)
    page.keyboard.up(key)
    wait_for(lambda: stands(odom), what="rest")
