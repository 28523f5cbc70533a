"""Which live key was meant, where nothing came on one or nobody answered."""

from holozen.bus import Bus
from holozen.flags import nearest

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Iterable


def meant(bus: Bus, keys: "Iterable[str]", kinds: tuple[str, ...] = ("pub", "sub")) -> str:
    """`; did you mean 'odom'?` with the live key nearest to the first of `keys` that nobody has; else empty."""
    ends = bus.graph().settled(bus.connected)
    live = {end.key for end in ends if end.kind in kinds and not end.type.startswith("any/") and "*" not in end.key}
    lost = [key for key in keys if key not in live and "*" not in key]
    return nearest(lost[0], sorted(live)) if lost else ""
