"""Where a robot comes from, and what there is to warn of in it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from holozen.robot.tag import Tag


@dataclass(slots=True)
class Source:
    """The file a robot comes from, the packages given with it, and what there is to warn of in it."""

    origin: Path
    packages: Mapping[str, Path]
    warnings: list[str] = field(default_factory=list)

    def warn(self, tag: Tag, problem: str) -> None:
        """Notes a mistake that a robot can be driven with."""
        self.warnings.append(str(tag.wrong(problem)))
