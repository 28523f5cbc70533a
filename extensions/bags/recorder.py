"""Recording: samples are received as fast as they arrive, and written when the disk is ready."""

import contextlib
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple, Self

from holozen.bags.formats import (
    REGISTRY,
    Format,
    as_cdr,
    format_of,
    interface_as_cdr,
    json_schema,
    known,
    types_of,
)
from holozen.bags.writer import CHANNELS, BagWriter
from holozen.messages import Clock, Message
from holozen.messages.codec import CodecError
from holozen.messages.definitions import InterfaceError
from holozen.transport.graph import Graph, is_latched, on_key
from holozen.transport.samples import RawSubscriber, Sample
from holozen.wire import ROS_TOPIC

DEPTH = 8192  # samples that a subscriber holds while its thread is not scheduled
QUEUE = 256 << 20  # bytes that may wait for the writer: a slow disk must not exhaust the memory
PUBLISHERS = 65_536  # most publishers whose sequence numbers are kept
LARGEST = 128 << 20  # bytes of a sample; a bag with larger ones could not be read again
BATCH = 1000  # samples
OVERHEAD = 300  # bytes of memory of a queued sample besides its payload
PATIENCE = 0.5  # s

CLOCK = "clock"  # the key of the sim's time
# ns; between two ticks the sim's time advances by at most this, as the sim may be paused
LONGEST_TICK = 100_000_000


class SimTime:
    """The sim's time when a sample arrives, also between two ticks. All times are arguments, in
    ns.
    """

    def __init__(self) -> None:
        # what the sim's clock showed last, and when, by our own
        self._tick: tuple[int, int] | None = None
        self._last = 0  # the latest time that was given

    def tick(self, shows: int, at: int) -> None:
        """The sim's clock showed `shows` at `at` of our own."""
        if self._tick is not None and shows < self._tick[0]:  # the sim was reset
            self._last = shows
        self._tick = shows, at

    def of(self, at: int) -> int | None:
        """The sim's time at `at`; None before the first tick. It goes back only with a reset."""
        if self._tick is None:
            return None
        shown, came = self._tick
        self._last = max(self._last, shown + min(at - came, LONGEST_TICK))
        return self._last


class Waiting(NamedTuple):
    """A sample to write. `at`: when it arrived, in ns since 1970; `missed`: how many of its key
    were lost before it.
    """

    at: int
    key: str
    payload: bytes
    encoding: str
    missed: int = 0


class Intake:
    """Samples of several subscribers on `wanted` keys, in the order of arrival. Those that do not
    fit are dropped and counted.

    Use it in a `with` block inside that of the bus.
    """

    def __init__(
        self, room: int = QUEUE, wanted: Callable[[str], bool] = lambda _key: True
    ) -> None:
        self.wanted = wanted
        self.received = self.dropped = 0
        self.deletions = 0  # samples that delete their key, and hold no message
        self.lost = 0  # samples that never arrived, by their sequence numbers
        self.keys: set[str] = set()  # on which anything arrived, up to PUBLISHERS
        self._latched: set[int] = set()  # hashes of the messages on latched keys, up to PUBLISHERS
        self._numbers: dict[tuple[str, str], int] = {}  # the last one of each key and sender
        # samples of a key that were lost or dropped since the last one kept
        self._missed: dict[str, int] = {}
        self._room, self._held = room, 0
        self._waiting: deque[Waiting] = deque()
        self._lock = threading.Lock()
        self._listeners: list[_Listener] = []
        # The system's clock may be set while this runs; the times in a bag never go back.
        self._epoch = time.time_ns() - time.monotonic_ns()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    @property
    def overran(self) -> int:
        """How often a subscriber was full, and may have lost samples unnoticed."""
        return sum(listener.overran for listener in self._listeners)

    def listen(self, subscriber: RawSubscriber) -> None:
        """Take in the samples of `subscriber`, which holds `DEPTH` of them."""
        self._listeners.append(_Listener(self, subscriber))

    def take(self) -> list[Waiting]:
        """The next samples to write, the oldest first; at most BATCH."""
        with self._lock:
            batch = [self._waiting.popleft() for _ in range(min(BATCH, len(self._waiting)))]
            self._held -= sum(len(sample.payload) + OVERHEAD for sample in batch)
        return batch

    def drop(self, count: int) -> None:
        """Count samples that were taken but could not be written."""
        with self._lock:
            self.dropped += count

    def close(self) -> None:
        """Stop listening. What arrived before can still be taken."""
        for listener in self._listeners:
            listener.close()

    def add(
        self, key: str, payload: bytes, encoding: str, number: tuple[str, int] | None = None
    ) -> None:
        """Add a sample. `number`: see Sample.number."""
        size = len(payload) + OVERHEAD
        with self._lock:
            self.received += 1
            if len(self.keys) < PUBLISHERS:
                self.keys.add(key)
            if is_latched(key) and len(self._latched) < PUBLISHERS:
                self._latched.add(hash((key, payload)))
            missed = self._missed.pop(key, 0) + (
                self._lost_before((key, number[0]), number[1]) if number else 0
            )
            if self._held + size > self._room or size > LARGEST:
                self.dropped += 1
                if len(self._missed) < PUBLISHERS:
                    self._missed[key] = missed + 1
                return
            self._held += size
            at = self._epoch + time.monotonic_ns()
            self._waiting.append(Waiting(at, key, payload, encoding, missed))

    def add_latched(self, sample: Sample) -> None:
        """Add the last message of a latched key, unless it arrived."""
        if self.wanted(sample.key) and hash((sample.key, sample.payload)) not in self._latched:
            self.add(sample.key, sample.payload, sample.encoding)

    def _lost_before(self, sender: tuple[str, str], number: int) -> int:
        if len(self._numbers) >= PUBLISHERS:
            self._numbers.clear()
        lost = max(0, number - self._numbers.get(sender, number - 1) - 1)
        self._numbers[sender] = number
        self.lost += lost
        return lost


class _Listener:
    """A thread that reads one subscriber."""

    def __init__(self, intake: Intake, subscriber: RawSubscriber) -> None:
        self.overran = 0
        self._intake, self._subscriber = intake, subscriber
        self._idle = self._closing = False
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Wait until the subscriber is empty, since closing it discards its samples, then close
        it.
        """
        if self._closing:
            return
        deadline = time.monotonic() + PATIENCE
        while not self._idle and self._thread.is_alive() and time.monotonic() < deadline:
            time.sleep(0.0005)
        self._closing = True
        self._subscriber.close()
        self._thread.join(PATIENCE)

    def _listen(self) -> None:
        in_a_row = 0
        try:
            while True:
                waiting = self._subscriber.try_recv()
                in_a_row = in_a_row + 1 if waiting else 1
                if in_a_row == DEPTH:
                    self.overran, in_a_row = self.overran + 1, 0
                sample = waiting or self._wait()
                key = sample.key
                if not self._intake.wanted(key):
                    continue
                if sample.is_deletion:  # replayed, it would be an empty message
                    self._intake.deletions += 1
                else:
                    self._intake.add(key, sample.payload, sample.encoding, sample.number)
        except Exception:  # raised by a closed subscriber; anything else is an error
            if not self._closing:
                raise

    def _wait(self) -> Sample:
        self._idle = True
        sample = self._subscriber.recv()
        self._idle = False
        return sample


class LeftOut(NamedTuple):
    """How many messages of a key a bag for ROS 2 cannot hold, and why."""

    messages: int
    why: str


class Recorder:
    """Writes the samples of an intake.

    The types of keys are those of the wire table, or those that their publishers announce; `define`
    returns the definition of an unknown type, from its publisher. With `ros`, messages are written
    as by ROS 2: in CDR, on topics with a leading slash. Those of unknown types, and those on keys
    that are not valid topics in ROS 2, are left out (`left_out`). Without `ros`, messages stay as
    they arrived. With `time`, times are those of the sim, and samples before its first tick are
    left out.
    """

    def __init__(
        self,
        intake: Intake,
        writer: BagWriter,
        graph: Graph,
        ros: bool = False,
        time: SimTime | None = None,
        define: Callable[[str], str] = lambda _: "",
    ) -> None:
        self._intake, self._writer, self._graph, self._ros, self._time = (
            intake,
            writer,
            graph,
            ros,
            time,
        )
        self._define = define
        self._learned: dict[str, str] = {}  # key -> its type, if it has no Struct
        self._types: dict[str, tuple[type[Message], ...]] = {}
        self.refused = 0  # samples beyond the number of channels that a bag can have
        self.left_out: dict[str, LeftOut] = {}  # by key
        self.early = 0  # samples from before the sim's clock was known

    def write_some(self) -> bool:
        """Write a batch of waiting samples; returns whether there were any. Raises BagError."""
        batch = self._intake.take()
        for number, sample in enumerate(batch):
            if self._writer.full:  # the space left is for the end of the file
                self._intake.drop(len(batch) - number)
                break
            self._write(sample)
        return bool(batch)

    def _write(self, sample: Waiting) -> None:
        form, message = format_of(sample.payload, sample.encoding, self._types_of(sample.key))
        payload, at = sample.payload, self._time_of(sample, message)
        if at is None:
            self.early += 1
            return
        topic = sample.key
        if self._ros:
            topic = f"/{sample.key}"
            try:
                form, payload = self._as_ros(sample, form, message)
            except (CodecError, InterfaceError) as error:
                self._leave_out(sample.key, str(error))
                return
        elif (
            form.encoding == "json" and not form.schema and (name := self._learned.get(sample.key))
        ):
            schema = json_schema(name)
            form = form._replace(
                schema=name, schema_encoding="jsonschema" if schema else "", schema_data=schema
            )
        self.refused += not self._writer.write(topic, form, payload, at, sample.missed)

    def _time_of(self, sample: Waiting, message: Message | None) -> int | None:
        if not self._time:
            return sample.at
        if isinstance(message, Clock) and sample.key == CLOCK:
            self._time.tick(message.clock.sec * 10**9 + message.clock.nanosec, sample.at)
        return self._time.of(sample.at)

    def _as_ros(
        self, sample: Waiting, form: Format, message: Message | None
    ) -> tuple[Format, bytes]:
        """A sample in CDR. Raises CodecError or InterfaceError with the reason why it cannot be."""
        if not ROS_TOPIC.fullmatch(sample.key):
            raise CodecError(
                "a topic of ROS 2 has letters, digits and '_' alone, and no part that begins with "
                "a digit"
            )
        if form.encoding == "cdr" and form.schema_encoding:
            return form, sample.payload
        if message is not None:
            return as_cdr(message)
        if name := self._learned.get(sample.key):
            return interface_as_cdr(name, sample.payload, sample.encoding)
        raise CodecError("the type is not known")

    def _leave_out(self, key: str, why: str) -> None:
        count = self.left_out[key].messages if key in self.left_out else 0
        if count or len(self.left_out) < CHANNELS:
            self.left_out[key] = LeftOut(count + 1, why)

    def _types_of(self, key: str) -> tuple[type[Message], ...]:
        if key not in self._types:
            if len(self._types) >= CHANNELS:
                self._types.clear()  # something publishes on ever new keys
                self._learned.clear()
            self._types[key] = types_of(key, lambda: self._named(key))
        return self._types[key]

    def _named(self, key: str) -> set[str]:
        names = {endpoint.type for endpoint in on_key(self._graph.endpoints(), key, "pub")}
        for name in sorted(names - known().keys()):
            with contextlib.suppress(InterfaceError):
                REGISTRY.learn(name, self._define)
                self._learned[key] = name
        return names
