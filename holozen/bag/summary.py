"""What is in a bag: how much of what, how often, and where it broke off. Made in one pass, in little memory."""

import time
from dataclasses import dataclass, field

from holozen.bag.reader import Bag, Channel

SETTLED = 5  # intervals; before that nobody knows the usual one
GAP = 3.0  # usual intervals without a message


@dataclass
class Stream:
    """The messages of one channel. Times in ns."""

    channel: Channel
    count: int = 0
    bytes: int = 0
    first: int = 0
    last: int = 0
    longest: int = 0
    gaps: int = 0  # how often nothing came for GAP times the interval that was usual until then

    def see(self, at: int, size: int) -> None:
        """A message of `size` bytes came at `at`."""
        if self.count:
            self._see_interval(at - self.last)
        else:
            self.first = at
        self.count, self.bytes, self.last = self.count + 1, self.bytes + size, at

    @property
    def rate(self) -> float:
        """Messages a second; 0 where there are not two."""
        return (self.count - 1) / (self.last - self.first) * 1e9 if self.last > self.first else 0.0

    def _see_interval(self, interval: int) -> None:
        self.longest = max(self.longest, interval)
        if self.count > SETTLED:
            self.gaps += interval > GAP * (self.last - self.first) / (self.count - 1)

    def figures(self) -> dict[str, object]:
        """For people and JSON; times in seconds."""
        return {
            "key": self.channel.key,
            "type": self.channel.type,
            "encoding": self.channel.encoding,
            "messages": self.count,
            "bytes": self.bytes,
            "rate": round(self.rate, 3),
            "longest_gap": round(self.longest / 1e9, 4),
            "gaps": self.gaps,
        }


@dataclass
class Summary:
    """All channels of a bag. Times in ns."""

    path: str
    size: int
    streams: dict[Channel, Stream] = field(default_factory=dict)
    cut_off: bool = False

    @property
    def count(self) -> int:
        """The number of messages."""
        return sum(stream.count for stream in self.streams.values())

    @property
    def start(self) -> int:
        """When the first message came."""
        return min((stream.first for stream in self.streams.values()), default=0)

    @property
    def end(self) -> int:
        """When the last message came."""
        return max((stream.last for stream in self.streams.values()), default=0)

    def figures(self) -> dict[str, object]:
        """For JSON; times in seconds."""
        return {
            "file": self.path,
            "bytes": self.size,
            "messages": self.count,
            "start": self.start / 1e9,
            "duration": (self.end - self.start) / 1e9,
            "cut_off": self.cut_off,
            "topics": [stream.figures() for stream in self._sorted()],
        }

    def lines(self) -> list[str]:
        """For people."""
        size = f"{self.size / 1e6:.2f} MB" if self.size >= 1e4 else f"{self.size} bytes"
        head = f"{self.path}: {size}, {self.count} messages in {(self.end - self.start) / 1e9:.2f} s"
        lines = [head + (f", from {_date(self.start)}" if self.count else "")]
        if self.cut_off:
            lines.append("the recording was cut off: the file has no end, but all that is listed here can be used")
        return lines + _table([stream.figures() for stream in self._sorted()])

    def _sorted(self) -> list[Stream]:
        return sorted(self.streams.values(), key=lambda stream: stream.channel)


def summarize(bag: Bag) -> Summary:
    """Reads a bag from end to end. Raises BagError."""
    summary = Summary(str(bag.path), bag.size)
    for channel, at, payload in bag.messages():
        if (stream := summary.streams.get(channel)) is None:
            stream = summary.streams[channel] = Stream(channel)
        stream.see(at, len(payload))
    summary.cut_off = bag.cut_off
    return summary


def _table(rows: list[dict[str, object]]) -> list[str]:
    if not rows:
        return []
    cells = [["key", "type", "encoding", "messages", "rate", "longest gap", "gaps"]]
    for row in rows:
        rate = f"{row['rate']:.2f} Hz" if row["rate"] else ""
        words = [row["key"], row["type"] or "?", row["encoding"], row["messages"], rate]
        cells.append([str(word) for word in [*words, f"{row['longest_gap']} s", row["gaps"]]])
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return ["  ".join(word.ljust(width) for word, width in zip(row, widths, strict=True)).rstrip() for row in cells]


def _date(at: int) -> str:
    try:
        return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(at / 1e9))
    except (OverflowError, ValueError, OSError):
        return f"{at / 1e9:.3f} s"
