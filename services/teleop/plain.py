"""The state as one line of text, for screen readers and logs."""

from .state import State
from .words import alarms, amount, clean, driver, mode, planar, seconds


def line(state: State) -> str:
    """What the screen says, the alarms first; printable ASCII without a line end."""
    parts = [wordings[0] for wordings in alarms(state)]
    parts += [clean(state.robot, 64) or "robot at the root", driver(state)[1]]
    parts.append(f"command {planar(state.command)}" if state.command else "command silent")
    parts.append(f"measured {planar(state.measured)}" if state.known else "measured unknown")
    parts += _links(state)
    parts.append(f"speed {amount(state.speed)} of {state.speed_limit:.4g} m/s")
    parts.append(f"turn {amount(state.turn)} of {state.turn_limit:.4g} rad/s")
    parts.append(mode(state))
    if state.warning:
        parts.append(f"warning: {clean(state.warning)}")
    return "; ".join(parts)


def _links(state: State) -> list[str]:
    """Ages, and who is there; what is amiss is among the alarms already."""
    parts = []
    if state.known:
        parts.append(f"odom {seconds(state.odom_age)} old")
    if state.round_trip is not None:
        parts.append(f"round trip {seconds(state.round_trip)}")
    if state.real_time_factor is not None:
        parts.append(f"real time {amount(state.real_time_factor)}")
    if state.listeners:
        parts.append("listening: " + ", ".join(clean(name, 64) for name in state.listeners))
    others = [source for source in state.sources if source.name != state.source]
    if others:
        parts.append("also sending: " + ", ".join(f"{clean(s.name, 64)}{' (held)' * s.held}" for s in others))
    return parts
