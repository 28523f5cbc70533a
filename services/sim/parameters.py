"""The parameters of a running sim: its pace, its limits, and the watchdog and odometry rate of each robot."""

import time
from collections.abc import Iterator

from holozen.command.freshness import AGES
from holozen.command.inputs import ANGULAR, LINEAR
from holozen.transport.parameters import Number

from .entities import Entities
from .robot import Robot
from .schedule import FACTORS, Pace

# A watchdog shorter than the period of 20 Hz would stop every robot between two commands; with the longest one a
# robot at 5 m/s travels 10 m. Only a robot's file can switch it off.
TIMEOUTS = (0.05, 2.0)  # s
RATES = (1.0, 1000.0)  # Hz


def declared(entities: Entities, pace: Pace) -> Iterator[Number]:
    """The parameters of the sim, and of its present robots."""
    limits = entities.limits
    yield Number(
        "max_linear", "linear speed limit of all robots, from their next command on", "m/s", *LINEAR,
        lambda: limits[0], lambda value: entities.limit(value, entities.limits[1]),
    )  # fmt: skip
    yield Number(
        "max_angular", "angular speed limit of all robots, from their next command on", "rad/s", *ANGULAR,
        lambda: limits[1], lambda value: entities.limit(entities.limits[0], value),
    )  # fmt: skip
    yield Number(
        "max_command_age", "commands that may be older are refused, except stops", "s", *AGES,
        lambda: entities.max_age, entities.require_age,
    )  # fmt: skip
    yield Number(
        "real_time_factor", "simulated seconds per real second; 0: as fast as possible", "", *FACTORS,
        lambda: pace.rtf, lambda value: pace.set_factor(value, time.monotonic()),
    )  # fmt: skip
    for robot in entities.robots:
        if robot.drives:
            yield from _of_robot(robot)


def _of_robot(robot: Robot) -> Iterator[Number]:
    place = f"{robot.prefix}." if robot.prefix else ""
    arbiter = robot.arbiter
    yield Number(
        f"{place}command_timeout", "the robot stops after this long without a command", "s",
        *TIMEOUTS,
        lambda: arbiter.timeout, lambda value: arbiter.set_timeout(value, time.monotonic()),
    )  # fmt: skip
    yield Number(
        f"{place}odometry_rate", "rate of odometry, in simulated time", "Hz", *RATES,
        lambda: robot.odometry_rate, robot.set_odometry_rate,
    )  # fmt: skip
