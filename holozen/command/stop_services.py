"""The services of one robot: stop, release, resume."""

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
from holozen.wire import key_for

MAX_REQUESTS = 16  # of one service answered per poll; a flood of them must not stall the steps
RELEASED = (
    "sources that commanded during the stop have to let go first;"
    " an autopilot also waits for `holozen controller --resume`"
)


class RobotServices:
    """Serves them in the namespace of the key `command`, for all `arbiters` alike. `changed` is called with the
    time, in s, before a stop or a release is confirmed. `reporter` begins the lines that tell of it.
    """

    VERBS = ("release", "resume", "stop")

    def __init__(
        self, bus: Bus, command: str, arbiters: tuple[Arbiter, ...], changed: Callable[[float], None],
        reporter: str = "sim",
    ) -> None:  # fmt: skip
        self._arbiters, self._changed, self._reporter = arbiters, changed, reporter
        answers = (self._on_release, self._on_resume, self._on_stop)
        self._namespace = namespace = command.rpartition("/")[0]
        self._release, self._resume, self._stop = self._servers = tuple(
            bus.serve(key_for(verb, namespace), TriggerRequest, TriggerReply, answer, dealt=True)
            for verb, answer in zip(self.VERBS, answers, strict=True)
        )
        in_order = (self._stop, self._release, self._resume)
        readers = [Reader(server.channel, partial(self._read, server)) for server in in_order]
        self.stop, self.others = readers[:1], readers[1:]
        self._now = 0.0

    def _read(self, server: Server, request: Any, moment: Moment) -> bool:
        """Answer `request`, the first of `server`, and those that wait at any of them; returns whether more do."""
        self._now = moment.now
        if request is not None:
            server.keep(request)
        self._answer()
        return any(server.is_waiting for server in self._servers)

    def _answer(self) -> None:
        if self._stop.take_in():  # a stop wins over requests that wait with it
            for server in (self._release, self._resume):
                server.take_in(RING)  # now: a release that is sent once the stop is confirmed counts
            self._stop.answer_pending(MAX_REQUESTS)
            for server in (self._release, self._resume):
                server.refuse_waiting(f"a stop came at the same time; {self._namespace or 'the robot'} is stopped")
        for server in (self._release, self._resume):
            server.answer_pending(MAX_REQUESTS)

    def close(self) -> None:
        """Close the services."""
        for server in self._servers:
            server.close()

    @property
    def _setter(self) -> str:
        return self._arbiters[0].software_stop.setter

    def _on_stop(self, _request: TriggerRequest) -> TriggerReply:
        before = self._setter
        for arbiter in self._arbiters:
            arbiter.stop(self._stop.caller, self._now)
        if not before:
            self._report_change(f"is stopped by {self._setter}")
        return TriggerReply(True, f"stopped by {self._setter}")

    def _on_release(self, _request: TriggerRequest) -> TriggerReply:
        if not self._setter:
            return TriggerReply(True, "the robot was not stopped")
        for arbiter in self._arbiters:
            arbiter.software_stop.release()
        self._report_change(f"was released by {self._release.caller or 'an unknown caller'}")
        return TriggerReply(True, RELEASED)

    def _on_resume(self, _request: TriggerRequest) -> TriggerReply:
        refusals = [arbiter.resume_refusal(self._now) for arbiter in self._arbiters]
        if reason := next(filter(None, refusals), ""):  # of any: no source is let go while another is refused
            raise ServiceError(reason)
        for arbiter in self._arbiters:
            arbiter.resume(self._now)
        return TriggerReply(True, "every source may drive")

    def _report_change(self, what: str) -> None:
        report(f"{self._reporter}: {self._namespace or 'the robot'} {what}")
        self._changed(self._now)
