"""What the robot does while somebody is at the keys."""

import os

from tests.integration.robots import Robot, moves, planar

OFTEN = 100 if os.environ.get("HOLOZEN_LONG") else 1
"""How often a test that looks for a race runs; scripts/test --long asks for the whole hundred."""


def drives(robot: Robot, x: float = 0.0, y: float = 0.0, turn: float = 0.0) -> None:
    robot.odom.next(lambda odom: moves(odom, x, y, turn))


def stands(robot: Robot) -> None:
    robot.told_to_stop()
    robot.stands()


def assert_nothing_moves(robot: Robot, seconds: float = 0.7) -> None:
    """Nobody says a word on cmd_vel that moves the robot, for as long by the sim's clock."""
    seen = len(robot.commands.messages())
    robot.pass_time(seconds)
    assert not [command for command in robot.commands.messages()[seen:] if any(planar(command))]
