"""The parameters of a running sim: its pace, its limits, and the watchdog and odometry rate of each
robot.
"""

import time
from collections.abc import Iterator

from holozen.command.freshness import AGES
from holozen.command.inputs import ANGULAR, LINEAR
from holozen.limits import TIMES
from holozen.transport.parameters import Number

from .entities import Entities
from .fleet import Fleet
from .robot import Robot
from .schedule import FACTORS, Pace

# A watchdog shorter than the period of 20 Hz would stop every robot between two commands; with the
# longest one a robot at 5 m/s travels 10 m. Only a robot's file can switch it off.
TIMEOUTS = (0.05, 2.0)  # s
OFF = -1.0  # what robots' files say of a watchdog that is off
RATES = (1.0, 1000.0)  # Hz


def declared(entities: Entities, pace: Pace) -> Iterator[Number]:
    """The parameters of the sim, and of its present robots."""
    fleet = entities.fleet
    rules = fleet.rules
    yield Number(
        "max_linear",
        "linear speed limit of all robots, from their next command on",
        "m/s",
        *LINEAR,
        lambda: rules.linear,
        lambda value: fleet.limit(value, rules.angular),
    )
    yield Number(
        "max_angular",
        "angular speed limit of all robots, from their next command on",
        "rad/s",
        *ANGULAR,
        lambda: rules.angular,
        lambda value: fleet.limit(rules.linear, value),
    )
    yield Number(
        "max_command_age",
        "commands that may be older are refused, except stops",
        "s",
        *AGES,
        lambda: rules.max_age,
        fleet.limit_age,
    )
    yield Number(
        "real_time_factor",
        "simulated seconds per real second; 0: as fast as possible",
        "",
        *FACTORS,
        lambda: pace.rtf,
        lambda value: pace.set_factor(value, time.monotonic()),
    )
    for robot in entities.robots:
        if robot.identity.drives:
            yield from _of_robot(fleet, robot)


def _of_robot(fleet: Fleet, robot: Robot) -> Iterator[Number]:
    place = f"{robot.identity.prefix}." if robot.identity.prefix else ""
    arbiter = robot.commands.arbiters.base
    yield Number(
        f"{place}command_timeout",
        "the robot stops after this long without a command",
        "s",
        *TIMEOUTS,
        lambda: OFF if (timeout := arbiter.velocity_timeout) is None else timeout,
        lambda value: arbiter.set_velocity_timeout(value, time.monotonic()),
    )
    yield Number(
        f"{place}odometry_rate",
        "rate of odometry, in simulated time",
        "Hz",
        *RATES,
        lambda: robot.telemetry.odometry_rate,
        lambda value: fleet.set_odometry_rate(robot, value),
    )
    if monitor := robot.monitor:
        yield Number(
            f"{place}time_before_collision",
            "it slows down this long before it would touch what its lidars see; 0: it does not",
            "s",
            *TIMES,
            lambda: monitor.seconds,
            robot.slow_down_at,
        )
