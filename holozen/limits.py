"""Limits on speed and on change of speed, as pure functions. Metres, radians, seconds."""

import math
from collections.abc import Iterator

Planar = tuple[float, float, float]
"""A planar velocity in the body frame: forward (m/s), left (m/s), counter-clockwise (rad/s)."""

STOP: Planar = (0.0, 0.0, 0.0)
TIMES = (0.0, 10.0)  # s; the range of the time before a collision; 0: off


def clamp(value: float, limit: float) -> float:
    """`value` limited to [-limit, limit]."""
    return max(-limit, min(limit, value))


def clamp_speed(velocity: Planar, linear: float, angular: float) -> Planar:
    """`velocity` with its speed at most `linear` m/s in the same direction, its turn at most
    `angular` rad/s.
    """
    x, y, turn = velocity
    speed = math.hypot(x, y)
    scale = linear / speed if speed > linear else 1.0
    return x * scale, y * scale, clamp(turn, angular)


def ramp(now: Planar, wanted: Planar, linear: float, angular: float, dt: float) -> Planar:
    """The velocity `dt` seconds after `now` on the way to `wanted`, at up to `linear` m/s^2 and
    `angular` rad/s^2.
    """
    dx, dy, dturn = (w - n for w, n in zip(wanted, now, strict=True))
    dx, dy, dturn = clamp_speed((dx, dy, dturn), linear * dt, angular * dt)
    return now[0] + dx, now[1] + dy, now[2] + dturn


def not_finite(value: object) -> str:
    """The path of the first number in plain values that is NaN or infinite, such as `linear.x`;
    else empty.
    """
    return next(_bad_numbers(value, ""), "")


def _bad_numbers(value: object, path: str) -> Iterator[str]:
    if isinstance(value, float) and not math.isfinite(value):
        yield path
    elif isinstance(value, dict):
        for name, inner in value.items():
            yield from _bad_numbers(inner, f"{path}.{name}" if path else name)
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            yield from _bad_numbers(inner, f"{path}[{index}]")
