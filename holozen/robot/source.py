"""Where a robot comes from, and what there is to warn of in it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path

from holozen.robot.errors import cut
from holozen.robot.tag import Tag

MOST_WARNINGS = 200
MOST_GUESSES = 20  # each looks at every name; a file of nothing but mistakes has to end soon too


@dataclass(slots=True)
class Source:
    """The file a robot comes from, the packages given with it, and what there is to warn of in it.

    `strict`: a mesh that is missing or bad is an error. `confined`: the text came over the wire, and may open nothing
    but the files of known packages.
    """

    origin: Path
    packages: Mapping[str, Path]
    warnings: list[str] = field(default_factory=list)
    guesses: int = 0
    strict: bool = False
    confined: bool = False
    meshes: int = 0

    def warn(self, tag: Tag, problem: str) -> None:
        """Notes a mistake that a robot can be driven with."""
        if len(self.warnings) < MOST_WARNINGS:
            self.warnings.append(str(tag.wrong(problem)))
        elif len(self.warnings) == MOST_WARNINGS:
            self.warnings.append(f"{tag.place}: there are more than {MOST_WARNINGS} warnings; the rest is not told")

    def nearest(self, name: str, known: Iterable[str], common: str = "", alike: float = 0.6) -> str:
        """The one of `known` that `name` is most like, as the phrase "; the nearest is ...", or nothing.

        `alike` is how much the two have in common, from 0 to 1; the beginning `common` does not count.
        """
        self.guesses += 1
        if self.guesses > MOST_GUESSES:
            return ""
        same = {other.removeprefix(common).casefold()[:60]: other for other in known}
        found = get_close_matches(name.removeprefix(common).casefold()[:60], same, 1, alike)
        return f"; the nearest is {cut(same[found[0]])}" if found else ""
