"""The process that renders what the cameras of a sim see, and the exposures that the sim sends to
it.
"""

import shlex
import subprocess
import sys

from holozen.bus import Bus, Publisher
from holozen.console import report
from holozen.messages import Exposure
from holozen.process import dies_with_parent

GRACE = 1.0  # s for it to end


class Cameras:
    """The cameras of a sim. `key` is that of its exposures, which no other sim has; `where` are the
    connection flags with which the process is started.
    """

    def __init__(self, bus: Bus, key: str, where: list[str]) -> None:
        self._bus, self._key = bus, key
        self._words = ["camera", "--exposures", key, *where]
        self._publisher: Publisher[Exposure] | None = None
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start the process unless it runs."""
        self._publisher = self._publisher or self._bus.publisher(self._key, Exposure)
        if self._process is None:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "holozen", *self._words],
                stdin=subprocess.DEVNULL,
                start_new_session=True,
                preexec_fn=dies_with_parent(),
            )

    def poll_wanted(self) -> bool:
        """Look whether exposures are read. Reports once if the process has ended."""
        if self._process and (code := self._process.poll()) is not None:
            self._process = None
            again = f"`{shlex.join(['holozen', *self._words])}` starts it again"
            report(
                f"sim: the camera ended with exit code {code}, so there are no pictures; {again}"
            )
        return self._publisher is not None and self._publisher.poll_wanted()

    def expose(self, exposure: Exposure) -> None:
        """Send an exposure to be rendered."""
        if self._publisher:
            self._publisher.put(exposure)

    def close(self) -> None:
        """End the process."""
        if self._process is None:
            return
        self._process.terminate()
        try:
            self._process.wait(GRACE)
        except subprocess.TimeoutExpired:
            report(f"sim: the camera did not end within {GRACE:g} s and was killed")
            self._process.kill()
            self._process.wait()
