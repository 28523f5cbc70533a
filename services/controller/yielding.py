"""Manners: the controller lets go when somebody else drives, and takes the robot again only when told."""

from holozen.messages import CommandStatus

RESUMES = "`holozen controller --resume` or the teleop's r resumes"


class Manners:
    """Reads cmd_vel_status. `source` is how the sim calls this controller."""

    def __init__(self, source: str) -> None:
        self._source = source
        self._resumed = 0
        self.yielded_to = ""  # empty while this controller may drive
        self.stopped = ""  # who set the software stop, while it holds

    @property
    def reason(self) -> str:
        """Why this controller does not drive, and what lets it; empty while it may."""
        if self.stopped:
            return f"yields: the robot is stopped by {self.stopped}; `holozen release` frees it, and then {RESUMES}"
        return f"yields to {self.yielded_to}; {RESUMES}" if self.yielded_to else ""

    def see(self, status: CommandStatus) -> None:
        """Take account of the newest status. A sim that was started again forgets who drove; this does not."""
        if status.resumed > self._resumed:
            self.yielded_to = ""
        self._resumed = status.resumed
        self.stopped = status.stopped
        if status.stopped:
            self.yielded_to = f"the stop by {status.stopped}"
        elif status.obeyed and status.obeyed != self._source:
            self.yielded_to = status.obeyed
        elif status.held and not self.yielded_to:
            self.yielded_to = "somebody before"
