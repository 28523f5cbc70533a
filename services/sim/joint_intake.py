"""What arrives on one robot's joint_command: checked, and handed to the arbiters of wheels and of other joints."""

from holozen.messages import JointState
from holozen.readers import PRIORITIES, Received
from holozen.robot.errors import listed

from .arbiter import Arbiter
from .ledger import Ledger, source_of
from .motion import JointMotion, motion_of


class JointIntake:
    """Judges joint commands. The wheels obey the arbiter of cmd_vel too, so that a person at the teleop comes first."""

    def __init__(
        self, key: str, ledger: Ledger, groups: list[tuple[frozenset[str], Arbiter]], known: list[str]
    ) -> None:
        self.key = key
        self._ledger, self._groups, self._known = ledger, groups, known

    def take(self, received: Received[JointState], now: float, heard: float) -> None:
        """Judge one sample at `now` (s, monotonic) that came at `heard` at the earliest."""
        message, source = self._ledger.open(received, (self.key,), now), source_of(received)
        if message is None:
            return
        try:
            motion = self._checked(motion_of(message))
        except ValueError as error:
            return self._ledger.refuse(self.key, "malformed", str(error), source, now)
        rank = PRIORITIES.index(received.sample.priority)
        for names, arbiter in self._groups:
            if part := motion.only(names):
                self._offer(arbiter, source, rank, part, now, heard)

    def _checked(self, motion: JointMotion) -> JointMotion:
        moved = frozenset[str]().union(*(names for names, _ in self._groups))
        for name, _ in motion.values:
            if name not in self._known:
                raise ValueError(f"there is no joint {name!r}; the joints are {listed(self._known)}")
            if name not in moved:
                raise ValueError(f"joint {name!r} follows the drive; only {listed(list(moved))} take commands")
        return motion

    def _offer(self, arbiter: Arbiter, source: str, rank: int, motion: JointMotion, now: float, heard: float) -> None:
        if reason := arbiter.offer(source, rank, motion, now, heard):
            self._ledger.refuse(self.key, reason.partition(":")[0], reason, source, now)
        else:
            self._ledger.accepted += 1
