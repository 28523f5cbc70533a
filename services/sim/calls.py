"""What may be asked of one robot: stop, release, resume."""

from collections.abc import Callable

from holozen.bus import Bus
from holozen.errors import ServiceError
from holozen.messages import TriggerReply, TriggerRequest
from holozen.tell import say
from holozen.wire import key_for

from .arbiter import Arbiter

RELEASED = "whoever commanded meanwhile lets go first; an autopilot also waits for `holozen controller --resume`"


class Calls:
    """Serves them beside the key `command`, for all `arbiters` alike. `changed` is called before a stop or a release is
    confirmed.
    """

    # In this order: of those that wait together, the stop wins.
    VERBS = ("release", "resume", "stop")

    def __init__(self, bus: Bus, command: str, arbiters: tuple[Arbiter, ...], changed: Callable[[], None]) -> None:
        self._bus, self._arbiters, self._changed = bus, arbiters, changed
        answers = (self._on_release, self._on_resume, self._on_stop)
        self._place = place = command.rpartition("/")[0]
        self._release, _, self._stop = self._servers = tuple(
            bus.serve(key_for(verb, place), TriggerRequest, TriggerReply, answer)
            for verb, answer in zip(self.VERBS, answers, strict=True)
        )
        self._now = 0.0

    def answer(self, now: float) -> None:
        """Answer the calls that wait at `now` (s)."""
        self._now = now
        for server in self._servers:
            server.answer_pending()

    def close(self) -> None:
        """Leave the wire."""
        for server in self._servers:
            self._bus.drop(server)

    @property
    def _setter(self) -> str:
        return self._arbiters[0].latch.setter

    def _on_stop(self, _request: TriggerRequest) -> TriggerReply:
        before = self._setter
        for arbiter in self._arbiters:
            arbiter.stop(self._stop.caller, self._now)
        if not before:
            self._tell(f"is stopped by {self._setter}")
        return TriggerReply(True, f"stopped by {self._setter}")

    def _on_release(self, _request: TriggerRequest) -> TriggerReply:
        if not self._setter:
            return TriggerReply(True, "it was not stopped")
        for arbiter in self._arbiters:
            arbiter.latch.release()
        self._tell(f"was released by {self._release.caller or 'somebody'}")
        return TriggerReply(True, RELEASED)

    def _on_resume(self, _request: TriggerRequest) -> TriggerReply:
        for arbiter in self._arbiters:
            if reason := arbiter.resume(self._now):
                raise ServiceError(reason)
        return TriggerReply(True, "every source may drive")

    def _tell(self, what: str) -> None:
        say(f"sim: {self._place or 'the robot'} {what}")
        self._changed()
