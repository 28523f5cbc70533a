"""What there is to show, and what a drawn line is."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from holozen.limits import STOP, Planar

Line = list[tuple[str, str]]
"""(style, text) from left to right; a style is "", "title", "driving", "good", "warning", "dim" or "alarm"."""


@dataclass
class Source:
    """One who publishes commands: its Zenoh priority, commands a second (Hz), and what the sim does with them."""

    name: str
    priority: str = ""
    rate: float = 0.0
    obeyed: bool = False
    held: bool = False


@dataclass
class State:
    """Everything the screen shows. Lengths in metres, angles in radians, velocities in m/s and rad/s, times in seconds.

    Names and warnings may hold anything: they came over the wire, and are made printable where they are drawn.
    """

    robot: str = ""  # "" is the robot at the root
    others: list[str] = field(default_factory=list)  # robots that Tab switches to
    mode: str = "hold"  # or "latch"
    why: str = ""  # how it is known that a key is up, or why it need not be
    deadman: bool = False
    deadman_held: bool = False
    speed: float = 0.5
    turn: float = 1.0
    speed_limit: float = 1000.0
    turn_limit: float = 1000.0
    command: Planar | None = None  # None: nothing is published
    measured: Planar = STOP
    odom_age: float = math.inf  # inf before the first
    stale: bool = True
    round_trip: float | None = None
    real_time_factor: float | None = None
    listeners: list[str] = field(default_factory=list)
    sources: list[Source] = field(default_factory=list)  # who publishes commands, by the sim; may hold ourselves
    obeyed: str = ""
    held: bool = False  # whether the autopilot waits until it is let
    source: str = ""  # our own name
    stopped: str = ""  # who set the software stop
    pose: tuple[float, float, float] | None = None  # x, y, yaw in the frame of odom
    trail: Sequence[tuple[float, float]] = ()  # oldest first
    warning: str = ""  # the last one
    key: str = "cmd_vel"
    keys: list[str] = field(default_factory=list)  # help of the active layout, lines of at most 40 characters
    help: bool = False  # whether the whole layout is shown in place of the picture
    ascii: bool = False  # for a terminal whose font has no braille

    @property
    def known(self) -> bool:
        """Whether `measured` is of now."""
        return not self.stale and math.isfinite(self.odom_age)

    @property
    def moving(self) -> bool:
        """Whether we command a motion."""
        return self.command is not None and any(self.command)
