"""The services stop, release and resume of one robot."""

from collections.abc import Callable
from functools import partial
from typing import Any

from holozen.bus import Bus
from holozen.command.arbiter import Arbiter
from holozen.command.wait_set import Moment, Reader
from holozen.console import report
from holozen.messages import TriggerReply, TriggerRequest
from holozen.transport.errors import ServiceError
from holozen.transport.services import RING, Server
from holozen.wire import key_for, resume_command

MAX_REQUESTS = 16  # of one service answered per poll; a flood of them must not stall the steps
# s; a command that was sent before a resume may be read so much after that was wanted
SIMULTANEOUS = 0.05
OUTDATED = "this {verb} may have been sent before {event}, so it is void; send it again"
RELEASED = (
    "whoever commanded during the stop lets go of the keys first; a controller also waits for "
    "`{resume}`"
)


class RobotServices:
    """Serves stop, release and resume in the namespace of the key `command`. Each is for all
    `arbiters` together.

    Before a stop or a release is confirmed, also a stop that changes nothing, `changed` is called
    with the time (s). It returns what the caller should know besides, or "". Reports begin with
    `reporter`.
    """

    VERBS = ("release", "resume", "stop")

    def __init__(
        self,
        bus: Bus,
        command: str,
        arbiters: tuple[Arbiter, ...],
        changed: Callable[[float], str],
        reporter: str = "sim",
    ) -> None:
        self._arbiters, self._changed, self._reporter = arbiters, changed, reporter
        answers = (self._on_release, self._on_resume, self._on_stop)
        self._namespace = namespace = command.rpartition("/")[0]
        self._release, self._resume, self._stop = self._servers = tuple(
            bus.serve(
                key_for(verb, namespace),
                TriggerRequest,
                TriggerReply,
                answer,
                dealt=True,
                stops=verb == "stop",
            )
            for verb, answer in zip(self.VERBS, answers, strict=True)
        )
        in_order = (self._stop, self._release, self._resume)
        readers = [Reader(server.channel, partial(self._read, server)) for server in in_order]
        self.stop, self.others = readers[:1], readers[1:]
        self._now = 0.0

    def _read(self, server: Server, request: Any, moment: Moment) -> bool:
        """Answer `request`, the first of `server`, and those that wait at any server. Returns
        whether more wait.
        """
        self._now = moment.now
        if request is not None:
            server.keep(request)
        self._answer()
        return any(server.is_waiting for server in self._servers)

    def _answer(self) -> None:
        if self._stop.take_in():  # a stop wins over requests that wait with it
            for server in (self._release, self._resume):
                # before the stop is confirmed: a release sent after that counts
                server.take_in(RING)
            self._stop.answer_pending(MAX_REQUESTS)
            for server in (self._release, self._resume):
                server.refuse_waiting(
                    f"a stop came at the same time: {self._namespace or 'the robot'} is stopped"
                )
        for server in (self._release, self._resume):
            server.answer_pending(MAX_REQUESTS)

    def close(self) -> None:
        """Close the services."""
        for server in self._servers:
            server.close()

    @property
    def _setter(self) -> str | None:
        return self._arbiters[0].stopped_by

    def _on_stop(self, _request: TriggerRequest) -> TriggerReply:
        before = self._setter
        for arbiter in self._arbiters:
            arbiter.stop(self._stop.caller, self._now)
        if not before:
            self._report(f"is stopped by {self._setter}")
        problem = (
            f"; the request cannot be read: {self._stop.problem}" if self._stop.problem else ""
        )
        return TriggerReply(True, f"stopped by {self._setter}{problem}{self._apply_change()}")

    def _on_release(self, _request: TriggerRequest) -> TriggerReply:
        if not self._setter:
            return TriggerReply(True, "the robot was not stopped")
        stopped = [arbiter.stopped_at for arbiter in self._arbiters]
        self._require_sent_after(
            self._release, stopped, f"the last stop of {self._namespace or 'the robot'}"
        )
        for arbiter in self._arbiters:
            arbiter.release(self._now)
        self._report(f"was released by {self._release.caller or 'an unknown caller'}")
        return TriggerReply(
            True, f"{RELEASED.format(resume=resume_command(self._namespace))}{self._apply_change()}"
        )

    def _on_resume(self, _request: TriggerRequest) -> TriggerReply:
        refusals = [arbiter.resume_refusal(self._now) for arbiter in self._arbiters]
        # if one arbiter refuses, none of them resumes
        if reason := next(filter(None, refusals), ""):
            raise ServiceError(reason)
        taken = [
            at and at - SIMULTANEOUS for at in (arbiter.taken_at for arbiter in self._arbiters)
        ]
        self._require_sent_after(
            self._resume, taken, f"a source took over or stopped {self._namespace or 'the robot'}"
        )
        for arbiter in self._arbiters:
            arbiter.resume(self._now)
        return TriggerReply(True, "every source may drive")

    def _require_sent_after(self, server: Server, events: list[float | None], what: str) -> None:
        verb = "release" if server is self._release else "resume"
        for event in events:
            server.require_sent_after(event, OUTDATED.format(verb=verb, event=what))

    def _report(self, what: str) -> None:
        report(f"{self._reporter}: {self._namespace or 'the robot'} {what}")

    def _apply_change(self) -> str:
        """Let the robot act on the change. Returns the end of the reply."""
        warning = self._changed(self._now)
        return f"; {warning}" if warning else ""
