"""The one error of this folder, and the parts of its messages."""

from collections.abc import Iterable

MOST = 2000  # characters of a message


class RobotError(ValueError):
    """A robot cannot be used as written. One line: where, what is wrong, what is allowed, what to do.

    Messages that are long in spite of `cut` and `listed` are truncated to MOST characters.
    """

    def __init__(self, message: str) -> None:
        super().__init__(message if len(message) <= MOST else message[: MOST - 3] + "...")


def cut(text: str, most: int = 80) -> str:
    """Text from the file in quotes, truncated to `most` characters."""
    return repr(text if len(text) <= most else text[: most - 3] + "...")


def listed(names: list[str], most: int = 12) -> str:
    """The names as one phrase, cut after `most` of them: an error stays one readable line."""
    shown = ", ".join(name if len(name) <= 80 else name[:77] + "..." for name in sorted(names)[:most])
    return shown + f" and {len(names) - most} more" if len(names) > most else shown or "none"


def suggest(name: str, known: Iterable[str], common: str = "", alike: float = 0.6) -> str:
    """ "; did you mean ...?" with the closest match in `known`, for the end of a message; else nothing.

    `alike` is the similarity required, from 0 to 1; case and the prefix `common` are ignored.
    """
    from difflib import get_close_matches

    same = {other.removeprefix(common).casefold()[:80]: other for other in known}
    found = get_close_matches(name.removeprefix(common).casefold()[:80], same, 1, alike)
    return f"; did you mean {cut(same[found[0]])}?" if found else ""
