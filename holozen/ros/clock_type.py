"""The kinds of clocks."""

from enum import IntEnum

__all__ = ["ClockType"]


class ClockType(IntEnum):
    """Which clock a time is of. Times of two clocks are not compared."""

    UNINITIALIZED = 0
    ROS_TIME = 1
    SYSTEM_TIME = 2
    STEADY_TIME = 3
