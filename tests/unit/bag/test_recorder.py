"""What waits is written as long as the disk takes it."""

from pathlib import Path

import pytest

from holozen.bag.intake import Intake
from holozen.bag.recorder import Recorder
from holozen.bag.writer import BagWriter
from holozen.graph import Graph


def test_nothing_more_is_written_once_the_disk_is_full_so_that_the_file_can_be_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    intake, writer = Intake(), BagWriter(str(tmp_path / "a"))
    for number in range(10):
        intake.add("a", b"%d" % number, "text/plain")
    monkeypatch.setattr(BagWriter, "full", property(lambda writer: "no room" if writer.messages == 3 else ""))
    recorder = Recorder(intake, writer, Graph(lambda: None))
    assert recorder.write_some()
    assert (writer.messages, intake.dropped) == (3, 7)
    writer.close()
