"""Plays a bag on a bus of its own, from the time that a page sets."""

import threading
import time
from pathlib import Path

from holozen.bags import Channel, Message
from holozen.bags.player import Outlet, Pace, plan
from holozen.bags.reader import Bag, summarize
from holozen.bus import Bus, Connection

ALONE = Connection(connect=(), listen=())


class Playback:
    """Publishes a bag's messages at their pace; paused at its start and at its end. Times in s
    since its start.

    Raises BagError for a file that cannot be read.
    """

    def __init__(self, bus: Bus, file: str) -> None:
        path = Path(file)
        with Bag(path) as bag:
            summary = summarize(bag)
        self._path, self._start = path, summary.start
        self.duration = (summary.end - summary.start) / 1e9
        self._outlet = Outlet(
            bus, plan([one.channel for one in summary.streams.values()], [], commands=True)
        )
        self._pace, self._at = Pace(1.0), self._start  # ns
        self._target: int | None = self._start  # ns; the time to jump to
        self.paused = True  # whether it stands still
        self._changed, self._ending = threading.Condition(), False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def position(self) -> float:
        """The present time in the bag."""
        return (self._at - self._start) / 1e9

    def toggle(self) -> None:
        """Pause it, or go on; at the end, start again."""
        with self._changed:
            if self.paused and self.position >= self.duration:
                self._target = self._start
            self.paused = not self.paused
            self._pace.jump(self._at, time.monotonic())
            self._changed.notify_all()

    def seek(self, to: float) -> None:
        """Jump to another time, and go on from there unless it is paused."""
        with self._changed:
            self._target = self._start + round(to * 1e9)
            self._changed.notify_all()

    def close(self) -> None:
        """End it."""
        with self._changed:
            self._ending = True
            self._changed.notify_all()
        self._thread.join()

    def _run(self) -> None:
        while not self._ending:
            with self._changed:
                start, self._target = self._target, None
            if start is None or self._play(start):
                with self._changed:
                    self.paused = self.paused or start is not None  # it is at the end
                    self._changed.wait_for(lambda: self._ending or self._target is not None)

    def _play(self, start: int) -> bool:
        """Publish the last message of each channel before `start`, then those that follow. False if
        a page wants something else.
        """
        held: dict[Channel, Message] = {}
        begun = False
        with Bag(self._path) as bag:
            for message in bag.messages():
                if not begun and message.at <= start:
                    held[message.channel] = message
                    if self._ending or self._target is not None:
                        return False
                    continue
                begun = begun or self._begin(start, held)
                if not self._wait_for(message.at):
                    return False
                self._outlet.publish(message)
                self._at = max(self._at, message.at)
        return begun or self._begin(start, held)

    def _begin(self, start: int, held: dict[Channel, Message]) -> bool:
        with self._changed:
            self._at = start
            self._pace.jump(start, time.monotonic())
        for message in held.values():
            self._outlet.publish(message)
        return True

    def _wait_for(self, at: int) -> bool:
        """Wait until a message is due; False if a page wants something else."""
        with self._changed:
            while not self._ending and self._target is None:
                left = self._pace.due(at) - time.monotonic()
                if not self.paused and left <= 0:
                    return True
                self._changed.wait(None if self.paused else left)
        return False
