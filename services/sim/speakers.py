"""Who spoke on a robot's cmd_vel lately, and how often. No clock, no socket."""

from collections import deque

MOST = 16  # names come over the wire; beyond, the one that spoke the longest ago is forgotten
LATELY = 3.0  # s
SPAN = 1.0  # s over which commands are counted
MARK = 0.1  # s between two marks of a count


class Speaker:
    """One source: its rank, when it spoke last, and how many commands it sent."""

    __slots__ = ("_marks", "count", "last", "rank")

    def __init__(self, now: float) -> None:
        self.rank, self.last, self.count = 0, now, 0
        self._marks: deque[tuple[float, int]] = deque([(now, 0)])  # what the count was, the oldest about SPAN ago

    def rate(self, now: float) -> float:
        """Commands a second (Hz) in the last second or so."""
        marks = self._marks
        if now - marks[-1][0] >= MARK:
            marks.append((now, self.count))
        while len(marks) > 1 and now - marks[1][0] >= SPAN:
            marks.popleft()
        since, before = marks[0]
        return (self.count - before) / max(now - since, SPAN)


class Speakers:
    """Those that spoke in the last seconds. A command costs a look-up and a sum."""

    def __init__(self) -> None:
        self._all: dict[str, Speaker] = {}

    def hear(self, source: str, rank: int, now: float) -> None:
        """`source` spoke at `now` (s)."""
        speaker = self._all.get(source)
        if speaker is None:
            if len(self._all) >= MOST:
                del self._all[min(self._all, key=lambda name: self._all[name].last)]
            speaker = self._all[source] = Speaker(now)
        speaker.rank, speaker.last = rank, now
        speaker.count += 1

    def lately(self, now: float) -> list[tuple[str, int, float]]:
        """(source, rank, rate in Hz) of those that spoke lately, the strongest first."""
        self._all = {name: speaker for name, speaker in self._all.items() if now - speaker.last <= LATELY}
        told = ((name, speaker.rank, speaker.rate(now)) for name, speaker in self._all.items())
        return sorted(told, key=lambda row: (row[1], row[0]))
