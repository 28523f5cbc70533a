"""The folders in which ROS 2 keeps a bag: numbered MCAP files, and metadata.yaml with what is in them."""

import contextlib
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from holozen.bag.formats import Format, offered_qos
from holozen.bag.writer import BagWriter

METADATA = "metadata.yaml"
VERSION = 5  # of metadata.yaml, that of Humble, which every later distribution reads


@dataclass
class Span:
    """How many messages, and the times of the first and the last, in ns."""

    count: int = 0
    first: int = 0
    last: int = 0

    def add(self, at: int) -> None:
        """Add a message."""
        self.first = min(self.first, at) if self.count else at
        self.last = max(self.last, at)
        self.count += 1

    def figures(self) -> dict[str, Any]:
        """As metadata.yaml has them."""
        return {
            "starting_time": {"nanoseconds_since_epoch": self.first},
            "duration": {"nanoseconds": self.last - self.first},
            "message_count": self.count,
        }


@dataclass
class Contents:
    """What is in the files of a bag, by file name and by topic and type."""

    files: dict[str, Span] = field(default_factory=dict)
    topics: dict[tuple[str, str], int] = field(default_factory=dict)
    all: Span = field(default_factory=Span)

    def add(self, file: str, topic: str, kind: str, at: int) -> None:
        """Add a message."""
        self.files.setdefault(file, Span()).add(at)
        self.topics[topic, kind] = self.topics.get((topic, kind), 0) + 1
        self.all.add(at)

    def metadata(self) -> str:
        """The text of metadata.yaml. It is JSON, which every reader of YAML reads."""
        topics = [
            {
                "topic_metadata": {
                    "name": topic,
                    "type": kind,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": offered_qos(topic),
                },
                "message_count": count,
            }
            for (topic, kind), count in self.topics.items()
        ]
        information = {
            "version": VERSION,
            "storage_identifier": "mcap",
            **self.all.figures(),
            "topics_with_message_count": topics,
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": list(self.files),
            "files": [{"path": name, **span.figures()} for name, span in self.files.items()],
        }
        return json.dumps({"rosbag2_bagfile_information": information}, indent=1) + "\n"


class RosBagWriter(BagWriter):
    """Writes a new folder with `NAME_0.mcap`, `NAME_1.mcap`, ... and metadata.yaml.

    Raises OSError if the folder or a file cannot be created, BagError if it cannot be continued. After a killed
    process metadata.yaml is missing; `ros2 bag reindex` makes it.
    """

    def __init__(self, name: str, limit: int = 0) -> None:
        self._folder, self._contents = Path(name), Contents()
        self._folder.mkdir()
        try:
            super().__init__(str(self._folder / self._folder.name), limit, "ros2", numbered=True)
        except OSError:
            self._folder.rmdir()
            raise

    def write(self, topic: str, form: Format, payload: bytes, at: int, missed: int = 0) -> bool:
        """Add a message, as BagWriter does."""
        file = self.files[-1].name
        written = super().write(topic, form, payload, at, missed)
        if written:
            self._contents.add(file, topic, form.schema, at)
        return written

    def close(self) -> None:
        """Finish the last file and write metadata.yaml; a recording without messages leaves no folder."""
        super().close()
        if self.messages:
            self._describe()
        elif self._folder.exists():
            self._folder.rmdir()

    def abandon(self) -> None:
        """Close without the summary at the end of the last file, which did not fit."""
        super().abandon()
        with contextlib.suppress(OSError):
            self._describe()

    def _describe(self) -> None:
        (self._folder / METADATA).write_text(self._contents.metadata(), encoding="utf-8")
