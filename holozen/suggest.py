"""What a misspelt name may stand for, and how names and values are shown in messages of one line."""

from collections.abc import Callable, Iterable
from itertools import islice

LONGEST = 80  # characters of a name or a value in a message
MOST = 1000  # names that are compared with one


def suggest(word: str, known: Iterable[str], part: Callable[[str], str] = str, alike: float = 0.65) -> str:
    """` (did you mean 'x'?)` with the `known` name most similar to `word`, for the end of a message; else empty.

    `alike` is the similarity required, from 0 to 1; the start of a name is nearly as similar as the whole, and a part
    of it somewhat. Case is ignored; `part` is what of both is compared.
    """
    from difflib import SequenceMatcher

    if not (plain := part(word).casefold()[:LONGEST]):
        return ""
    matcher = SequenceMatcher(None, "", plain)

    def likeness(name: str) -> float:
        other = part(name).casefold()[:LONGEST]
        found = 0.7 if len(plain) > 2 and plain in other else 0.0
        for text, share in ((other, 1.0), (other[: len(plain)], 0.95)):
            matcher.set_seq1(text)
            if share * matcher.quick_ratio() > alike:
                found = max(found, share * matcher.ratio())
        return found

    def rank(name: str) -> tuple[float, bool]:
        """Of equals, the one with the same letters: two were swapped."""
        return likeness(name), sorted(part(name).casefold()) == sorted(plain)

    best = max(islice(known, MOST), key=rank, default="")
    return f" (did you mean {shorten(best)!r}?)" if best and likeness(best) > alike else ""


def last_part(name: str) -> str:
    """What follows the last slash: the package is no sign of similarity."""
    return name.rpartition("/")[2]


def shorten(text: str, most: int = LONGEST) -> str:
    """`text`, truncated to `most` characters."""
    return text if len(text) <= most else f"{text[: most - 3]}..."


def cut(text: str, most: int = LONGEST) -> str:
    """`text` in quotes, truncated to `most` characters."""
    return repr(shorten(text, most))


def listed(names: Iterable[str], most: int = 12) -> str:
    """The sorted names as one phrase, cut after `most` of them: a message stays one readable line."""
    names = sorted(names)
    shown = ", ".join(shorten(name) for name in names[:most])
    return shown + f" and {len(names) - most} more" if len(names) > most else shown or "none"


def article(name: str) -> str:
    """The name of a class with its article: `an int`, `a uint8`, `an Odometry`."""
    return f"an {name}" if name[:1] in tuple("aeioAEIO") else f"a {name}"
