"""Suggestions for misspelt names, and how names and values are shown in one-line messages."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from contextlib import suppress
from itertools import islice
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

MAX_SHOWN = 80  # characters of a name or a value in a message
MAX_NAMES = 1000  # names that are compared with one
ROBOT_FILES = {".xacro", ".urdf", ".sdf", ".world"}


def suggest(
    word: str, known: Iterable[str], part: Callable[[str], str] = str, alike: float = 0.65
) -> str:
    """` (did you mean 'x'?)` with the name that is `closest` to `word`, for the end of a message;
    else empty.
    """
    best = closest(word, known, part, alike)
    return f" (did you mean {shorten(best)!r}?)" if best else ""


def closest(
    word: str, known: Iterable[str], part: Callable[[str], str] = str, alike: float = 0.65
) -> str:
    """The `known` name most similar to `word`; empty if none is.

    `alike` is the similarity required, from 0 to 1; a match of a name's start counts nearly as much
    as one of the whole, a match inside it somewhat less. Case is ignored; `part` returns the part
    of each name that is compared.
    """
    from difflib import SequenceMatcher

    if not (plain := part(word).casefold()[:MAX_SHOWN]):
        return ""
    matcher = SequenceMatcher(None, "", plain)

    def likeness(name: str) -> float:
        other = part(name).casefold()[:MAX_SHOWN]
        found = 0.7 if len(plain) > 2 and plain in other else 0.0
        for text, share in ((other, 1.0), (other[: len(plain)] if len(plain) > 1 else "", 0.95)):
            matcher.set_seq1(text)
            if share * matcher.quick_ratio() > alike:
                found = max(found, share * matcher.ratio())
        return found

    def rank(name: str) -> tuple[float, bool]:
        """Among equals, the one with the same letters wins: two were swapped."""
        return likeness(name), sorted(part(name).casefold()) == sorted(plain)

    best = max(islice(known, MAX_NAMES), key=rank, default="")
    return best if best and likeness(best) > alike else ""


def suggest_file(path: Path) -> str:
    """` (did you mean 'my_bot.urdf.xacro'?)` for a missing robot or world file: the most similar
    one in its folder and among those that come with holozen; empty if there is none, or if the file
    exists.
    """
    from pathlib import Path

    from holozen import data

    if os.path.exists(path):  # reading it failed for another reason
        return ""
    found = dict[str, Path]()
    for ours in ("", "urdf", "worlds"):
        with suppress(OSError):
            files = (data.find(ours) if ours else path.parent).iterdir()
            for file in sorted(files, key=lambda file: (file.suffix != path.suffix, file)):
                if file.suffix in ROBOT_FILES:
                    found.setdefault(file.name, file)
    best = closest(path.name, found, lambda name: name.partition(".")[0])
    if not best:
        return ""
    near = found[best]
    with suppress(OSError, ValueError):
        near = near.relative_to(Path.cwd())
    return f" (did you mean {str(near)!r}?)"


def last_part(name: str) -> str:
    """The text after the last slash: two types are not alike because their packages are."""
    return name.rpartition("/")[2]


def shorten(text: str, most: int = MAX_SHOWN) -> str:
    """`text`, truncated to `most` characters."""
    return text if len(text) <= most else f"{text[: most - 3]}..."


def cut(text: str, most: int = MAX_SHOWN) -> str:
    """`text` in quotes, truncated to `most` characters."""
    return repr(shorten(text, most))


def listed(names: Iterable[str], most: int = 12) -> str:
    """The sorted names as one phrase, cut after `most` of them: a message stays one readable
    line.
    """
    names = sorted(names)
    shown = ", ".join(shorten(name) for name in names[:most])
    return shown + f" and {len(names) - most} more" if len(names) > most else shown or "none"


def yaml_problem(error: Exception) -> str:
    """What is wrong with a YAML text, and where, in one line."""
    why = " ".join(str(getattr(error, "problem", None) or error).split())
    mark = getattr(error, "problem_mark", None)
    spaces = "; write spaces instead of tabs" if "'\\t'" in why else ""
    return why + (f" (line {mark.line + 1}, column {mark.column + 1})" if mark else "") + spaces


def article(name: str) -> str:
    """The name of a class with its article: `an int`, `a uint8`, `an Odometry`."""
    return f"an {name}" if name[:1] in tuple("aeioAEIO") else f"a {name}"
