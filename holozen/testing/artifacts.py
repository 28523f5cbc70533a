"""What a failed test leaves in a folder: a bag of all that was on its wire, a picture of what
drove, and the logs.
"""

import re
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

from holozen.testing.process import START, run

if TYPE_CHECKING:
    from holozen.testing.wire import Wire

ENDS = 10.0  # s for the recorder to finish its file
BAG, PICTURE = "bag.mcap", "paths.png"


class Artifacts:
    """Records a wire into `folder`, which `keep` fills and `discard` removes. AssertionError if it
    cannot record.

    folder: a folder for this test alone; what an earlier run left there is removed.
    """

    def __init__(self, wire: "Wire", folder: Path) -> None:
        self._wire, self._folder = wire, folder
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        self._recorder = wire.start(
            "record", "--all", "--output", str(folder / BAG.removesuffix(".mcap"))
        )
        self._recorder.wait_for_line("record")

    def keep(self) -> None:
        """Write bag, picture and logs. Where no odometry was recorded, or matplotlib is missing,
        there is no picture; `picture.log` says why.
        """
        self._recorder.interrupt(ENDS)
        drawn = run(
            [*START, "bag", "plot", str(self._folder / BAG), "-o", str(self._folder / PICTURE)]
        )
        (self._folder / "picture.log").write_text(drawn.stdout + drawn.stderr)
        for number, process in enumerate(self._wire.processes, 1):
            verb = process.words[len(START)]
            (self._folder / f"{number}-{verb}.log").write_text(
                f"{process}\n{process.out}{process.err}"
            )
        for number, terminal in enumerate(self._wire.terminals, 1):
            (self._folder / f"terminal-{number}.log").write_text(terminal.raw)

    def discard(self) -> None:
        """End the recording and remove the folder."""
        self._recorder.interrupt(ENDS)
        shutil.rmtree(self._folder, ignore_errors=True)


def folder_name(test: str) -> str:
    """The name of a test's folder: its node id, with `_` for what has no place in the name of a
    file.
    """
    return re.sub(r"[^\w.=-]+", "_", test).strip("_")[-200:]
