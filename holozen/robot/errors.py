"""The one error of this folder."""


class RobotError(ValueError):
    """A robot cannot be used as it is written. One line: where, what is wrong, what is allowed, what to do."""


def listed(names: list[str], most: int = 12) -> str:
    """The names as one phrase, cut after `most` of them: an error stays one readable line."""
    shown = ", ".join(sorted(names)[:most])
    return shown + f" and {len(names) - most} more" if len(names) > most else shown or "none"


def near(name: str, known: list[str]) -> str:
    """Words that ask whether the name in `known` that looks like `name` was meant, or nothing."""
    from difflib import get_close_matches

    match = get_close_matches(name[:80], known, 1)
    return f"; did you mean {match[0]!r}?" if match else ""
