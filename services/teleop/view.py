"""What the screen says, as styled text. Pure: a `State` in, fragments out."""

from dataclasses import dataclass, field

from holozen.limits import STOP, Planar

from .keymap import HELP

Fragments = list[tuple[str, str]]
"""prompt_toolkit's (style, text) pairs."""


@dataclass
class State:
    """Everything the screen shows. Velocities in m/s and rad/s, ages in seconds."""

    robot: str
    speed: float
    turn: float
    command: Planar | None = None
    measured: Planar = STOP
    odom_age: float = float("inf")
    stale: bool = True
    listeners: list[str] = field(default_factory=list)
    obeyed: str = ""
    held: bool = False
    source: str = ""
    note: str = ""


def render(state: State) -> Fragments:
    """The screen: keys, velocities, and who is there."""
    return [
        ("class:title", f" holozen teleop {state.robot or 'the robot at the root'}\n\n"),
        ("", f"{HELP}\n\n"),
        ("", f" speed {state.speed:.3f} m/s   turn {state.turn:.3f} rad/s\n\n"),
        *_velocities(state),
        ("", "\n"),
        *_odom(state),
        *_listeners(state),
        *_driver(state),
        ("class:warning", f" {state.note}\n" if state.note else ""),
    ]


def _velocities(state: State) -> Fragments:
    command = _planar(state.command) if state.command else "silent"
    style = "class:driving" if state.command and state.command != STOP else ""
    return [
        ("", " command   "), (style, f"{command}\n"),
        ("", f" measured  {'unknown' if state.stale else _planar(state.measured)}\n"),
    ]  # fmt: skip


def _planar(velocity: Planar) -> str:
    x, y, turn = (value + 0.0 if abs(value) >= 5e-4 else 0.0 for value in velocity)
    return f"x {x:+.3f}  y {y:+.3f} m/s  turn {turn:+.3f} rad/s"


def _odom(state: State) -> Fragments:
    if state.odom_age == float("inf"):
        return [("class:warning", " NO ODOM: nothing was heard from a robot\n")]
    if state.stale:
        return [("class:warning", f" ODOM IS STALE: the last one came {state.odom_age:.1f} s ago\n")]
    return [("class:good", f" odom      {state.odom_age * 1000:.0f} ms old\n")]


def _listeners(state: State) -> Fragments:
    if not state.listeners:
        return [("class:warning", " NOBODY IS LISTENING on cmd_vel\n")]
    return [("class:good", f" listening {', '.join(state.listeners)}\n")]


def _driver(state: State) -> Fragments:
    if state.obeyed == state.source:
        return [("class:good", " driver    you\n")]
    if state.obeyed:
        return [("", f" driver    {state.obeyed}\n")]
    return [("", " driver    nobody" + ("; r lets the controller drive again\n" if state.held else "\n"))]
