"""Messages made shorter, for a terminal or a table."""

import json

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any


def cut(value: "Any", longest: int = 0, arrays: bool = True, texts: bool = True) -> "Any":
    """`value` with lists and texts of at most `longest` values or characters (0: all of them).

    Without `arrays` a list tells its length instead; without `texts` a text does.
    """
    if isinstance(value, dict):
        return {name: cut(inner, longest, arrays, texts) for name, inner in value.items()}
    if isinstance(value, list):
        if not arrays:
            return f"<{len(value)} values>"
        kept = [cut(inner, longest, arrays, texts) for inner in value[: longest or None]]
        return kept + ([f"... {len(value) - longest} more"] if 0 < longest < len(value) else [])
    if isinstance(value, str):
        if not texts:
            return f"<{len(value)} characters>"
        return value[:longest] + "..." if 0 < longest < len(value) else value
    return value


def row(value: "Any") -> str:
    """The values of a message as one line of comma-separated values, in their order."""
    return ",".join(_cells(value))


def _cells(value: "Any") -> list[str]:
    if isinstance(value, dict):
        return [cell for inner in value.values() for cell in _cells(inner)]
    if isinstance(value, list):
        return [cell for inner in value for cell in _cells(inner)]
    if isinstance(value, str):
        text = value if value.isprintable() else json.dumps(value)[1:-1]
        return ['"' + text.replace('"', '""') + '"' if set(text) & set(',"') else text]
    return [json.dumps(value)]
