"""The nearest known word for a misspelt one, or for a common word that the file formats have
another one for.
"""

from collections.abc import Iterable

ALIASES = {
    "height": "length",
    "min": "lower",
    "max": "upper",
    "torque": "effort",
    "speed": "velocity",
    "file": "filename",
    "uri": "filename",
    "colour": "color",
    "rgb": "rgba",
    "kg": "value",
    "kind": "type",
    "pos": "xyz",
    "position": "xyz",
    "rotation": "rpy",
    "intertia": "inertia",
}
"""Words commonly written instead of one of the file format."""


def distance(one: str, other: str) -> int:
    """Edit distance: letters to insert, delete, change or swap with the next one (optimal string
    alignment); the difference in length if that is 3 or more.
    """
    if abs(len(one) - len(other)) > 2:
        return abs(len(one) - len(other))
    before: list[int] = []
    last = list(range(len(other) + 1))
    for i, a in enumerate(one, 1):
        row = [i]
        for j, b in enumerate(other, 1):
            best = min(last[j] + 1, row[-1] + 1, last[j - 1] + (a != b))
            if i > 1 and j > 1 and a == other[j - 2] and one[i - 2] == b:
                best = min(best, before[j - 2] + 1)
            row.append(best)
        before, last = last, row
    return last[-1]


def nearest(word: str, known: Iterable[str], shortest: int = 2) -> str | None:
    """The known word that `word` is a misspelling of, or None. Words shorter than `shortest` are
    not guessed at.

    One wrong letter is allowed, two from eight letters on; case and underscores are ignored.
    """
    words, plain = list(known), _plain(word)
    if len(word) > 40 or len(plain) < shortest:
        return None
    if ALIASES.get(plain) in words:
        return ALIASES[plain]
    allowed = 2 if len(plain) >= 8 else 1
    near = [other for other in words if distance(plain, _plain(other)) <= allowed]
    # Of two spellings of one word, prefer the one in the same style.
    return min(
        near,
        key=lambda other: (distance(plain, _plain(other)), distance(word, other)),
        default=None,
    )


def is_clear(word: str, suggestion: str, known: Iterable[str]) -> bool:
    """Whether no other known word is as near to `word` as the one that `nearest` suggests."""
    plain, meant = _plain(word), _plain(suggestion)
    others = {_plain(other) for other in known} - {meant}
    return ALIASES.get(plain) == suggestion or all(
        distance(plain, other) > distance(plain, meant) for other in others
    )


def _plain(word: str) -> str:
    return word.lower().replace("_", "").replace("-", "")
