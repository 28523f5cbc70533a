"""The words for a state, shared by the screen and the plain lines: numbers, names, alarms, who drives."""

import math

from .state import State


def clean(text: str, longest: int = 200) -> str:
    """Printable ASCII of at most `longest` characters, so that its width is its length; `?` for what is not."""
    if not (text.isascii() and text.isprintable()):
        text = "".join(letter if " " <= letter <= "~" else "?" for letter in text[: longest + 1])
    return text if len(text) <= longest else text[: max(0, longest - 1)] + "~"


def number(value: float) -> str:
    """A velocity with its sign, in at most 7 characters: +0.500, -12.34, +1e+300. There is no -0.000."""
    if abs(value) < 5e-4:
        value = 0.0
    size = abs(value)
    digits = 3 if size < 9.9995 else 2 if size < 99.995 else 1 if size < 999.95 else 0
    return f"{value:+.{digits}f}" if size < 99999 else f"{value:+.0e}"


def short(value: float) -> str:
    """The same with two digits, in 5 characters as long as it is below 10: +0.50."""
    if abs(value) < 5e-3:
        value = 0.0
    return f"{value:+.2f}" if abs(value) < 9.995 else number(value)


def amount(value: float) -> str:
    """A speed, which has no sign: 0.500, 1000."""
    return number(abs(value))[1:]


def seconds(value: float) -> str:
    """A duration: 0.62 ms, 12 ms, 3.2 s."""
    if not value < 1:
        return f"{value:.1f} s" if value < 99999 else "an age"
    milliseconds = max(0.0, value) * 1000
    return f"{milliseconds:.{2 if milliseconds < 1 else 1 if milliseconds < 10 else 0}f} ms"


def planar(velocity: tuple[float, float, float]) -> str:
    """A velocity in a sentence."""
    x, y, turn = map(number, velocity)
    return f"x {x} y {y} m/s turn {turn} rad/s"


def alarms(state: State) -> list[list[str]]:
    """What must not be missed, the worst first; each in wordings from the longest to the shortest."""
    found = []
    if state.stopped:
        release = f"`holozen release{' ' * bool(state.robot)}{clean(state.robot, 64)}`"
        by = f"STOPPED by {clean(state.stopped, 40)}: {release}"
        found.append([f"{by} lets it drive again", by, f"STOPPED: {release}", "STOPPED"])
    if not state.listeners:
        found.append([f"NOBODY IS LISTENING on {clean(state.key, 100)}", "NOBODY IS LISTENING"])
    if not math.isfinite(state.odom_age):
        found.append(["NO ODOM: nothing was heard from a robot", "NO ODOM"])
    elif state.stale:
        found.append([f"ODOM IS STALE: the last one came {seconds(state.odom_age)} ago", "ODOM IS STALE"])
    if state.deadman and not state.deadman_held:
        found.append(["dead man: hold space", "dead man"])
    return found


def driver(state: State) -> tuple[str, str]:
    """Who is obeyed, with a style: a warning where somebody else is while we command a motion."""
    if state.obeyed and state.obeyed == state.source:
        return "good", "you drive"
    if state.obeyed:
        name = clean(state.obeyed, 24)
        return ("warning", f"{name} drives, not you") if state.moving else ("", f"{name} drives")
    return "", "nobody drives; the autopilot is held" if state.held else "nobody drives"


def mode(state: State) -> str:
    """How keys drive, and why so."""
    name = f"{state.mode} + dead man" if state.deadman else state.mode
    return clean(f"{name}: {state.why}" if state.why else name)
