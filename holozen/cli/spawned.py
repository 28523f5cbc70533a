"""What `holozen spawn` tells of what it put into the world."""

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from holozen.messages import Pose


@dataclass(frozen=True, slots=True)
class Spawned:
    """What was put into the world: where it listens (nowhere: an empty key), where it stands, and advice."""

    name: str
    key: str
    pose: "Pose"
    hint: str = ""

    def __str__(self) -> str:
        at = self.pose.position
        where = f"listens on {self.key}" if self.key else f"stands at {at.x:.3f} {at.y:.3f} {at.z:.3f}"
        return f"{self.name} {where}{self.hint and f'; {self.hint}'}"

    def as_json(self) -> str:
        """The same as one JSON object."""
        from msgspec import to_builtins

        return json.dumps({"name": self.name, "key": self.key, "pose": to_builtins(self.pose), "hint": self.hint})
