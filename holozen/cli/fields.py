"""Fields of a message by their dotted path, such as `pose.pose.position.x` or `transforms[0].child_frame_id`."""

import re

from holozen.flags import nearest

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    Path = tuple[str | int, ...]

_PART = re.compile(r"([^.\[\]]+)|\[(\d{1,6})\]")
LONGEST = 500  # characters of a path


def path(text: str) -> "Path":
    """The names and indices of a field's path. Raises ValueError for one that is none."""
    parts: list[str | int] = []
    at = 0
    while at < len(text) <= LONGEST and (found := _PART.match(text, at + (text[at] == "." and at > 0))):
        parts.append(found[1] if found[1] is not None else int(found[2]))
        at = found.end()
    if not parts or at < len(text):
        raise ValueError(f"{text[:80]!r} is no field; write names with dots, such as pose.pose.position.x")
    return tuple(parts)


def pick(value: "Any", path: "Path") -> "Any":
    """The field of `value` at a path. Raises LookupError that names what there is."""
    for part in path:
        if isinstance(part, int) and isinstance(value, list):
            if part >= len(value):
                raise LookupError(f"no [{part}]; the list has {len(value)} values")
            value = value[part]
        elif isinstance(value, dict) and part in value:
            value = value[part]
        else:
            raise LookupError(_missing(value, part))
    return value


def _missing(value: "Any", part: str | int) -> str:
    if not isinstance(value, dict):
        return f"no field {part!r} in a {'list; write [0]' if isinstance(value, list) else type(value).__name__}"
    names = [str(name) for name in value]
    return f"no field {part!r}{nearest(str(part), names)}; there are {', '.join(names) or 'none'}"
