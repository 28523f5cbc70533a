"""Whether a robot follows the commands of a source, and why not, by its `cmd_vel_status`."""

import threading
import time
from collections.abc import Callable
from typing import Any

from holozen import wire
from holozen.bus import Latest
from holozen.console import report as report_line

FRESH = 1.0  # s; after that a robot whose status came is gone
COVERED = 3  # statuses after a command, of which the last was sent after the command has been read
HOLDING = 0.3  # s within which a status tells who is held after a stop; it comes at 10 Hz
LIMITED = "over the limits"  # prefix of the sim's reason when it drives slower than commanded
OVERRULED = "overruled"  # prefix of its reason when a higher source drives
DRIVES = " drives"
SILENT = "its status no longer comes: its sim has ended, hangs, or cannot be reached"
ONLY_TURNS = "linear.y is ignored: this robot's drive only goes forward, backward and turns"
HELD = "held, since another source took over"
RESUME = "; `{command}` lets it drive again"
HOLDS = "{driver} is held now, as by any stop of an equal; `{command}` lets it drive again"


def verdict(status: Any, source: str) -> str | None:
    """Why the robot does not follow the commands of `source`, by a CommandStatus; empty if it does. None if the sim has
    not received any yet: a status sent before the command arrived does not cover it.
    """
    mine = next((each for each in status.sources if each.source == source), None)
    own_refusal = status.last_refusal.removeprefix(f"{source}: ")
    if own_refusal == status.last_refusal:
        own_refusal = ""
    if status.stopped:
        return f"{status.stopped} has set the software stop"
    if status.obeyed == source or (mine and mine.obeyed):
        return own_refusal if own_refusal.startswith(LIMITED) else ""
    if (mine and mine.held) or own_refusal.startswith("held: "):
        return HELD
    if mine and status.obeyed and own_refusal.partition(":")[0] in ("", OVERRULED):
        return f"{status.obeyed}{DRIVES}"
    return own_refusal or None


def verdict_on_part(status: Any, before: Any, source: str) -> str | None:
    """As `verdict`, of commands to joints or forces, whose sources a status names only where they drive or are refused.
    `before` is the status before it, if any: a command that is accepted after a refusal is known by the counts.
    """
    why = verdict(status, source)
    if not why or status.stopped or before is None or status.refused != before.refused:
        return why
    return "" if status.accepted > before.accepted and not status.obeyed and not status.sources else None


class CommandFeedback:
    """Reports when a robot starts or stops obeying a `source`, by the `latest` status on `key`.

    If the commands are no velocities (`is_velocity`) but move joints or are forces, they are judged by
    `verdict_on_part`. `more` says more of why the robot does not obey, given the source that drives instead, if any.
    """

    def __init__(
        self,
        source: str,
        key: str,
        latest: Latest[Any],
        is_velocity: bool = True,
        report: Callable[[str], None] = report_line,
        more: Callable[[str], str] = lambda _driver: "",
    ) -> None:
        self._source, self._latest, self._is_velocity = source, latest, is_velocity
        self._report, self._more = report, more
        self._resume = wire.resume_command(key.rpartition("/")[0])
        self._reported = self._driver = ""
        self._judged: Any = None  # the last status that was judged
        self._why: str | None = None  # its verdict
        self._strafes = self._has_noted = False  # sideways commands were sent; that the drive makes none is reported
        self.refusal = ""
        """Why the robot does not obey, by the latest look; empty if it does, or is not known to."""
        self.stands = False
        """Whether it is certain that no source drives the robot, by the latest look."""

    def sent(self, command: Any) -> None:
        """Report any change after a command was sent. `command` is any object with its fields."""
        if self._is_velocity and (getattr(command, "linear", None) or command.twist.linear).y != 0:
            self._strafes = True
        self.look()

    def look(self) -> bool:
        """Report any change; returns whether the sim has judged the commands yet."""
        status, age = self._latest.read()
        why = (self._verdict(status) if age < FRESH else SILENT) if status else None
        if not status or why is None:
            return False
        self._driver = status.obeyed if why.endswith(DRIVES) else ""
        self.stands = age < FRESH and bool(status.stopped or not status.obeyed)
        if why != self._reported:
            if why and not why.startswith(LIMITED):
                resume = RESUME.format(command=self._resume) if why == HELD else ""
                self._report(f"not obeyed: {why}{resume}{self._more(self._driver)}")
            else:
                self._report(why or "obeyed again")
        if self._strafes and status.obeyed == self._source and not (status.strafes or self._has_noted):
            self._report(ONLY_TURNS)
            self._has_noted = True
        self._reported, self.refusal = why, "" if why.startswith(LIMITED) else why
        return True

    def wait(self, stop: threading.Event, seconds: float) -> None:
        """Wait until the sim has judged the commands; report if it has not after so many `seconds`."""
        deadline, received = time.monotonic() + seconds, self._latest.count
        while not self.look() and not stop.wait(0.002):
            if not self._is_velocity and self._latest.count >= received + COVERED:
                return  # it says nothing of what it accepts
            if time.monotonic() > deadline:
                if self._latest.read()[1] < FRESH and self._is_velocity:
                    self.refusal = "the sim has not received it; does anything flood it?"
                    self._report(f"not obeyed: {self.refusal}")
                return

    def report_held(self) -> None:
        """After a stop was sent while another source drove: report that it holds that one, if it does and is there."""
        deadline = time.monotonic() + HOLDING
        while self._driver and (left := deadline - time.monotonic()) > 0:
            status, _ = self._latest.read()
            if status and any(each.source == self._driver and each.held for each in status.sources):
                if not self._more(self._driver):
                    self._report(HOLDS.format(driver=self._driver, command=self._resume))
                return
            self._latest.wait(self._latest.count, left)

    def _verdict(self, status: Any) -> str | None:
        if status is not self._judged:
            before, self._judged = self._judged, status
            if self._is_velocity:
                self._why = verdict(status, self._source)
            else:
                self._why = verdict_on_part(status, before, self._source)
        return self._why
