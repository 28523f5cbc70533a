"""Whether a robot follows the commands of a source, and why not, by its `cmd_vel_status`."""

import threading
import time
from collections.abc import Callable
from typing import Any

from holozen import wire
from holozen.bus import Latest
from holozen.command.outcome import OVER_LIMITS, Outcome
from holozen.console import report as report_line

FRESH = 1.0  # s; after that a robot whose status came is gone
COVERED = 3  # statuses after a command, of which the last was sent after the command has been read
EVERY = 0.1  # s between two looks in a pause
HELD_WITHIN = 0.3  # s within which a status tells who is held after a stop; it comes at 10 Hz
# prefixes of its reasons for commands that took too long
LATE = (Outcome.HELD_UP.value, Outcome.OLD.value)
OVERRULED = "overruled"  # prefix of its reason when a higher source drives
STOPPED = "the robot is stopped by "
DRIVES = " drives"
STOP_FIRST = "; it has to stop first"
SILENT = (
    "its status no longer comes: its sim has ended, hangs, or cannot be reached; `holozen doctor` "
    "looks why"
)
NOT_RECEIVED = "the sim has not received it: it hangs, or is flooded; `holozen doctor` looks why"
ONLY_TURNS = "linear.y is ignored: this robot's drive only goes forward, backward and turns"
HELD = "held, since another source took over"
AGAIN = "; `{command}` lets it drive again"
NOW_HELD = "this stop also holds {driver}, which drove; `{command}` lets it drive again"


def verdict(status: Any, source: str) -> str | None:
    """Why the robot does not follow the commands of `source`, or follows them within its limits
    alone (OVER_LIMITS), by a CommandStatus; empty if it follows them. None if the sim has not
    received any yet: a status sent before the command arrived does not cover it.
    """
    mine = next((each for each in status.sources if each.source == source), None)
    own_refusal = _own(status.last_refusal, source)
    if status.stopped:
        return f"{STOPPED}{status.stopped}"
    if status.obeyed == source or (mine and mine.obeyed):
        return _own(status.last_clamped, source)
    kind = own_refusal.partition(":")[0]
    if kind == "held" or (mine and mine.held and kind == ""):
        return HELD
    if mine and status.obeyed and kind in ("", OVERRULED):
        return f"{status.obeyed}{DRIVES}"
    return own_refusal or None


def _own(report: str, source: str) -> str:
    """The reason in a status's report of a refused or clamped command; empty if that is of another
    source.
    """
    whose, _, reason = report.partition(": ")
    return reason if whose == source else ""


def verdict_on_part(status: Any, before: Any, source: str) -> str | None:
    """As `verdict`, of commands to joints or forces, whose sources a status names only where they
    drive or are refused. `before` is the status before it, if any: a command that is accepted after
    a refusal is known by the counts.
    """
    why = verdict(status, source)
    if not why or status.stopped or before is None or status.refused != before.refused:
        return why
    return (
        ""
        if status.accepted > before.accepted and not status.obeyed and not status.sources
        else None
    )


class CommandFeedback:
    """Reports when a robot starts or stops obeying a `source`, by the `latest` status on `key`.

    With `is_velocity` the commands are velocities; others are judged by `verdict_on_part`. `more`
    adds to a report why the robot does not obey, given the source that drives instead (empty:
    none). It takes round trips to find out, so it is called in a thread, while this one goes on to
    send commands; `told` waits until all is reported.
    """

    def __init__(
        self,
        source: str,
        key: str,
        latest: Latest[Any],
        is_velocity: bool = True,
        report: Callable[[str], None] = report_line,
        more: Callable[[str], str] | None = None,
    ) -> None:
        self._source, self._latest, self._is_velocity = source, latest, is_velocity
        self._report, self._more = report, more
        robot = key.rpartition("/")[0]
        self._resume, self._release = wire.resume_command(robot), wire.release_command(robot)
        self._reported = self._driver = ""
        self._judged: Any = None  # the last status that was judged
        self._why: str | None = None  # its verdict
        self._strafes = self._has_noted = (
            False  # sideways commands were sent; that the drive makes none is reported
        )
        self.refusal = ""
        """Why the robot does not obey, by the latest look; empty if it does, or is not known to."""
        self.stands = False
        """Whether it is certain that no source drives the robot, by the latest look."""
        self._telling: threading.Thread | None = None  # the last one that reports
        # whether a status that came after the last command says what became of it
        self._is_judged = False

    def sent(self, command: Any) -> None:
        """Report any change after a command was sent. `command` is any object with its fields."""
        if self._is_velocity and (getattr(command, "linear", None) or command.twist.linear).y != 0:
            self._strafes = True
        self._is_judged = False
        self.look()

    @property
    def statuses(self) -> int:
        """The number of statuses that have come so far."""
        return self._latest.count

    def pause(self, stop: threading.Event, seconds: float) -> None:
        """Wait `seconds` after a command was sent, and look meanwhile what becomes of it: at the
        end of a long pause the robot stands again, and its status does not tell any more.
        """
        end, before = time.monotonic() + seconds, self.statuses
        while (left := end - time.monotonic()) > 0 and not stop.wait(min(left, EVERY)):
            self._is_judged = self._is_judged or (self.statuses > before and self.look())

    def look(self) -> bool:
        """Report any change; returns whether the sim has judged the commands yet."""
        status, age = self._latest.read()
        why = (self._verdict(status) if age < FRESH else SILENT) if status else None
        if not status or why is None:
            return False
        self._driver = status.obeyed if why.endswith(DRIVES) else ""
        self.stands = age < FRESH and bool(status.stopped or not status.obeyed)
        is_late = why.startswith(LATE)
        # each names another age
        if why != self._reported and not (is_late and self._reported.startswith(LATE)):
            if why and not why.startswith(OVER_LIMITS):
                stopped = why.startswith(STOPPED)
                command = self._resume if why == HELD else self._release if stopped else ""
                advice = AGAIN.format(command=command) if command else ""
                self._tell(f"not obeyed: {why}{advice}", None if is_late else self._driver)
            else:
                self._tell(why or "obeyed again")
        if (
            self._strafes
            and status.obeyed == self._source
            and not (status.strafes or self._has_noted)
        ):
            self._report(ONLY_TURNS)
            self._has_noted = True
        self._reported, self.refusal = why, "" if why.startswith(OVER_LIMITS) else why
        return True

    def wait(self, stop: threading.Event, seconds: float, after: int = 0) -> None:
        """Wait until the sim has judged the commands, by more than `after` statuses; report if it
        has not after so many `seconds`.
        """
        deadline, received = time.monotonic() + seconds, self._latest.count
        while not (self._is_judged or (self.statuses > after and self.look())) and not stop.wait(
            0.002
        ):
            if not self._is_velocity and self._latest.count >= received + COVERED:
                break  # it says nothing of what it accepts
            if time.monotonic() > deadline:
                if self._latest.read()[1] < FRESH and self._is_velocity:
                    self.refusal = NOT_RECEIVED
                    self._report(f"not obeyed: {self.refusal}")
                break
        self.told()

    def told(self) -> None:
        """Wait until all is reported."""
        if self._telling:
            self._telling.join()

    def report_held(self) -> None:
        """After a stop was sent while another source drove: report that this one now waits for
        `resume`, once a status says so.
        """
        deadline = time.monotonic() + HELD_WITHIN
        while self._driver and (left := deadline - time.monotonic()) > 0:
            status, _ = self._latest.read()
            if status and any(each.source == self._driver and each.held for each in status.sources):
                if not (self._more and self._more(self._driver)):
                    self._report(NOW_HELD.format(driver=self._driver, command=self._resume))
                return
            self._latest.wait(self._latest.count, left)

    def _tell(self, text: str, driver: str | None = None) -> None:
        """Report a text after those before it, with what `more` says of a driver; None: nothing."""
        first = STOP_FIRST if driver else ""
        if not self._more:
            return self._report(f"{text}{first}")
        more, before = self._more, self._telling

        def tell() -> None:
            if before:
                before.join()
            self._report(text if driver is None else f"{text}{more(driver) or first}")

        self._telling = threading.Thread(target=tell, daemon=True)
        return self._telling.start()

    def _verdict(self, status: Any) -> str | None:
        if status is not self._judged:
            before, self._judged = self._judged, status
            if self._is_velocity:
                self._why = verdict(status, self._source)
            else:
                self._why = verdict_on_part(status, before, self._source)
        return self._why
