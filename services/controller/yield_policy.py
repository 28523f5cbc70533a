"""When the controller leaves the robot to others, and when it drives again."""

import enum
from typing import NamedTuple

from holozen.messages import CommandStatus
from holozen.wire import release_command, resume_command


class Cause(enum.Enum):
    """Why a controller yields. The values begin the sentence that says so, with the name in it."""

    HELD = "yields to --held"  # it was started so
    SOURCE = "yields to {name}"  # another source drives, or did last
    EARLIER = "yields: another source drove this robot"  # before this controller's first status
    STOP = "yields to the stop by {name}"  # a software stop, which may have been released since
    # one of goal_pose or of an action has ended: the robot stays there
    GOAL = "yields to a goal of {name}"


class Yielded(NamedTuple):
    """Why the controller does not drive.

    cause: The kind of reason.
    name: The source, the node that set the stop, or the key of the goal; empty for HELD and
        EARLIER.
    """

    cause: Cause
    name: str = ""


class YieldPolicy:
    """Whether the controller may drive: it yields when another source drives, and drives again only
    after a resume.

    yielded: Why it does not drive; None while it may.
    stopped: The node that set the software stop; empty while there is none.

    It reads cmd_vel_status, in which `source` is this controller. `held`: it yields at first.
    """

    def __init__(self, source: str, held: bool = False, robot: str = "") -> None:
        self._source = source
        self._release = release_command(robot)
        self._how = f"resume with `{resume_command(robot)}` or press r in the teleop"
        # resumes at the last status; those before the first status do not count
        self._resumed: int | None = None
        self.yielded: Yielded | None = Yielded(Cause.HELD) if held else None
        self.stopped = ""

    @property
    def reason(self) -> str:
        """Why this controller does not drive, and what would let it; empty while it may."""
        if self.stopped:
            return (
                f"yields: the robot is stopped by {self.stopped}; `{self._release}` ends that, "
                f"then {self._how}"
            )
        if self.yielded is None:
            return ""
        return f"{self.yielded.cause.value.format(name=self.yielded.name)}; {self._how}"

    def stay(self, origin: str) -> None:
        """A goal of goal_pose or of an action (`origin`) has ended: the robot stays until a resume
        or the next goal.
        """
        if self.yielded is None:
            self.yielded = Yielded(Cause.GOAL, origin)

    def set_out(self) -> None:
        """The next such goal has arrived: the robot need not stay at the one before."""
        if self.yielded is not None and self.yielded.cause is Cause.GOAL:
            self.yielded = None

    def update(self, status: CommandStatus) -> None:
        """Take the newest status. A restarted sim has forgotten which source drove, this policy has
        not.
        """
        if self._resumed is not None and status.resumed > self._resumed:
            self.yielded = None
        self._resumed = status.resumed
        self.stopped = status.stopped
        if status.stopped:
            self.yielded = Yielded(Cause.STOP, status.stopped)
        elif status.obeyed and status.obeyed != self._source:
            self.yielded = Yielded(Cause.SOURCE, status.obeyed)
        elif status.held and self.yielded is None:
            self.yielded = Yielded(Cause.EARLIER)
