"""The one error of this folder."""

MOST = 2000  # characters of a message


class RobotError(ValueError):
    """A robot cannot be used as it is written. One line: where, what is wrong, what is allowed, what to do.

    Of a message that grows long in spite of `cut` and `listed`, the first MOST characters are kept.
    """

    def __init__(self, told: str) -> None:
        super().__init__(told if len(told) <= MOST else told[: MOST - 3] + "...")


def cut(text: str, most: int = 80) -> str:
    """A text of the file in quotes, at most `most` characters of it."""
    return repr(text if len(text) <= most else text[: most - 3] + "...")


def listed(names: list[str], most: int = 12) -> str:
    """The names as one phrase, cut after `most` of them: an error stays one readable line."""
    shown = ", ".join(name if len(name) <= 80 else name[:77] + "..." for name in sorted(names)[:most])
    return shown + f" and {len(names) - most} more" if len(names) > most else shown or "none"


def near(name: str, known: list[str]) -> str:
    """Words that ask whether the name in `known` that looks like `name` was meant, or nothing."""
    from difflib import get_close_matches

    match = get_close_matches(name[:80], known, 1)
    return f"; did you mean {cut(match[0])}?" if match else ""
