"""From an intake into a bag."""

import contextlib

from holozen.bag.forms import Form, as_cdr, form_of, types_of
from holozen.bag.intake import Intake, Waiting
from holozen.bag.simtime import KEY, SimTime
from holozen.bag.writer import CHANNELS, BagWriter
from holozen.codec import CodecError
from holozen.graph import Graph, on_key
from holozen.messages import Clock, Message


class Recorder:
    """Writes what an intake took in. The types of keys are those of the table, or what their publishers say.

    With `ros`, messages of known types are written as ROS 2 does: in CDR, on topics with a leading slash. All others,
    and all without `ros`, stay as they came. With `time`, times are those of the sim, and what comes before its first
    tick is left out.
    """

    def __init__(
        self, intake: Intake, writer: BagWriter, graph: Graph, ros: bool = False, time: SimTime | None = None
    ) -> None:
        self._intake, self._writer, self._graph, self._ros, self._time = intake, writer, graph, ros, time
        self._types: dict[str, tuple[type[Message], ...]] = {}
        self.refused = 0  # samples of more keys than a bag has room for
        self.early = 0  # samples from before the sim's clock was known

    def write_some(self) -> bool:
        """Write what waits, at most a batch; whether there was any. Raises BagError."""
        batch = self._intake.take()
        for number, sample in enumerate(batch):
            if self._writer.full:  # what room there is now is for the end of the file
                self._intake.drop(len(batch) - number)
                break
            self._write(sample)
        return bool(batch)

    def _write(self, sample: Waiting) -> None:
        form, payload, message = self._formed(sample)
        at: int | None = sample.at
        if self._time:
            if isinstance(message, Clock) and sample.key == KEY:
                self._time.tick(message.clock.sec * 10**9 + message.clock.nanosec, sample.at)
            at = self._time.of(sample.at)
        if at is None:
            self.early += 1
            return
        topic = f"/{sample.key}" if self._ros else sample.key
        self.refused += not self._writer.write(topic, form, payload, at, sample.number)

    def _formed(self, sample: Waiting) -> tuple[Form, bytes, Message | None]:
        form, message = form_of(sample.payload, sample.encoding, self._types_of(sample.key))
        if self._ros and message is not None and form.encoding != "cdr":
            with contextlib.suppress(CodecError):
                return *as_cdr(message), message
        return form, sample.payload, message

    def _types_of(self, key: str) -> tuple[type[Message], ...]:
        if key not in self._types:
            if len(self._types) >= CHANNELS:
                self._types.clear()  # somebody writes on ever new keys
            self._types[key] = types_of(key, lambda: self._named(key))
        return self._types[key]

    def _named(self, key: str) -> set[str]:
        return {endpoint.type for endpoint in on_key(self._graph.endpoints(), key, "pub")}
