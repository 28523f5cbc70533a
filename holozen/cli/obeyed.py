"""Whether a robot obeys who publishes, by its CommandStatus. Pure but for Watcher."""

from typing import TYPE_CHECKING

from holozen.messages import CommandStatus
from holozen.tap import Sample
from holozen.tell import say

if TYPE_CHECKING:
    from holozen.bus import Bus

ASK = 0.3  # s
LIMITED = "over the limits"  # how the sim begins to tell that it drives slower than it was told
HELD = "held, since a higher source took over; `holozen service call resume` lets it drive again"


def refusal(status: CommandStatus, source: str, refused: int = 0) -> str:
    """Why the robot does not do what `source` says; empty if it does, or where the sim has not heard it yet.

    `refused`: how many commands had been refused when `source` began.
    """
    mine = next((each for each in status.sources if each.source == source), None)
    if status.stopped:
        return f"{status.stopped} has set the software stop"
    last = status.last_refusal.removeprefix(f"{source}: ")
    told = last if last != status.last_refusal and sum(status.refused.values()) > refused else ""
    if status.obeyed == source or (mine and mine.obeyed):
        return told if told.startswith(LIMITED) else ""
    if mine and mine.held:
        return HELD
    return f"{status.obeyed} drives" if status.obeyed else told


class Watcher:
    """Tells a person whenever the robot on a command key begins or ceases to obey."""

    def __init__(self, bus: "Bus", key: str) -> None:
        self._bus, self._key, self._told = bus, f"{key}_status", ""
        self._latest = bus.latest(self._key, CommandStatus)
        self._refused: int | None = None

    def ask(self) -> None:
        """Look once, at what the sim said last, and tell."""
        from holozen import codec

        for answer in self._bus.ask(self._key, ASK):
            if isinstance(answer, Sample):
                try:
                    self._tell(codec.decode(answer.payload, answer.encoding, (CommandStatus,)))
                except codec.CodecError:
                    return
                return

    def look(self) -> None:
        """Tell what is new, if anything is."""
        status, age = self._latest.read()
        if status and age < 1.0:
            self._tell(status)

    def _tell(self, status: CommandStatus) -> None:
        if self._refused is None:
            self._refused = sum(status.refused.values())
        why = refusal(status, self._bus.source, self._refused)
        if why != self._told:
            say(why if why.startswith(LIMITED) else f"not obeyed: {why}" if why else "obeyed again")
        self._told = why
