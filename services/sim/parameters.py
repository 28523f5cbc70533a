"""What of a running sim can be set: its pace, its limits, and of each robot the watchdog and the rate of odometry."""

import time
from collections.abc import Iterator

from holozen.parameters import Number

from .entities import Entities
from .intake import ANGULAR, LINEAR
from .pace import FACTORS, Pace
from .vehicle import Vehicle

# A watchdog shorter than the gaps of 20 Hz would stop every robot between two commands; a robot at 5 m/s goes on for
# 10 m in the longest. Only a robot's file can switch it off.
TIMEOUTS = (0.05, 2.0)  # s
RATES = (1.0, 1000.0)  # Hz


def declared(entities: Entities, pace: Pace) -> Iterator[Number]:
    """The parameters of the sim, and of the robots that it has now."""
    limits = entities.limits
    yield Number(
        "max_linear", "the fastest that any robot is told to drive, from its next command on", "m/s", *LINEAR,
        lambda: limits[0], lambda value: entities.limit(value, entities.limits[1]),
    )  # fmt: skip
    yield Number(
        "max_angular", "the fastest that any robot is told to turn, from its next command on", "rad/s", *ANGULAR,
        lambda: limits[1], lambda value: entities.limit(entities.limits[0], value),
    )  # fmt: skip
    yield Number(
        "real_time_factor", "simulated seconds in a real one; 0: as fast as it goes", "", *FACTORS,
        lambda: pace.rtf, lambda value: pace.keep(value, time.monotonic()),
    )  # fmt: skip
    for vehicle in entities.vehicles:
        if vehicle.drives:
            yield from _of_robot(vehicle)


def _of_robot(vehicle: Vehicle) -> Iterator[Number]:
    place = f"{vehicle.prefix}." if vehicle.prefix else ""
    arbiter, due = vehicle.arbiter, vehicle.odom_due
    yield Number(
        f"{place}command_timeout", "the silence after which the robot stands; below zero: never", "s", *TIMEOUTS,
        lambda: arbiter.timeout, vehicle.watch,
    )  # fmt: skip
    yield Number(
        f"{place}odometry_rate", "how often odometry is told, in simulated time", "Hz", *RATES,
        lambda: due.rate, due.keep,
    )  # fmt: skip
