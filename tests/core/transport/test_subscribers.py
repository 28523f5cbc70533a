"""Readers of a key: a bad sample is a reason and not an exception, and the newest message has an
age.
"""

import math
import queue
import threading
from types import SimpleNamespace

import pytest
import zenoh

from holozen.messages import Twist, TwistStamped
from holozen.messages.codec import decoder, encode
from holozen.testing import wait_for
from holozen.transport.errors import BusError
from holozen.transport.pubsub import SLOWEST, Arrivals, Latest, Subscription
from holozen.transport.samples import RawSubscriber


class Stream:
    """What a subscriber of Zenoh is to a Tap, filled by a test."""

    def __init__(self) -> None:
        self._samples: queue.SimpleQueue[SimpleNamespace | None] = queue.SimpleQueue()
        self.handler = self
        self.tap = RawSubscriber(self, limit=65_536)

    def add(
        self, payload: bytes, encoding: str = "application/json", attachment: bytes = b"me@1"
    ) -> None:
        self._samples.put(
            SimpleNamespace(
                key_expr="cmd_vel",
                encoding=encoding,
                priority=5,
                attachment=attachment,
                payload=zenoh.ZBytes(payload),
            )
        )

    def try_recv(self) -> SimpleNamespace | None:
        return None if self._samples.empty() else self._samples.get()

    def recv(self) -> SimpleNamespace:
        if (sample := self._samples.get()) is None:
            raise RuntimeError("channel is empty and closed")
        return sample

    def undeclare(self) -> None:
        self._samples.put(None)


@pytest.fixture
def stream() -> Stream:
    return Stream()


def test_messages_come_in_order_and_then_nothing(stream: Stream) -> None:
    subscription = Subscription(stream.tap, decoder((Twist,)))
    assert subscription.try_recv() is None
    for x in (1.0, 2.0):
        stream.add(encode(Twist.planar(x)))
    first, second = subscription.try_recv(), subscription.recv()
    assert first is not None
    assert (first.message, second.message) == (Twist.planar(1), Twist.planar(2))
    assert (first.error, first.source) == ("", "me@1")
    assert subscription.try_recv() is None


def test_any_of_the_kinds_is_read(stream: Stream) -> None:
    subscription: Subscription[Twist | TwistStamped] = Subscription(
        stream.tap, decoder((Twist, TwistStamped))
    )
    stream.add(encode(TwistStamped()))
    assert subscription.recv().message == TwistStamped()


@pytest.mark.parametrize(
    ("payload", "encoding", "reason"),
    [
        (b'{"linaer": {}}', "application/json", "unknown field `linaer`"),
        (b"{}", "image/png", "image/png"),
        (b"", "application/json", "truncated"),
        (b"x" * 70_000, "application/json", "oversized: 70000 bytes"),
        (b"x" * 70_000, "image/png", "oversized: 70000 bytes"),
    ],
    ids=lambda value: str(value)[:20],
)
def test_a_sample_that_is_no_message_gives_the_reason(
    stream: Stream, payload: bytes, encoding: str, reason: str
) -> None:
    stream.add(payload, encoding)
    received = Subscription(stream.tap, decoder((Twist,))).recv()
    assert received.message is None
    assert reason in received.error
    assert len(received.payload) < 65_536


def test_json_with_another_encoding_is_telemetry_and_no_command(stream: Stream) -> None:
    for tolerant in (True, False):
        stream.add(b'{"linear":{"x":1}}', "image/png")
        received = Subscription(stream.tap, decoder((Twist,), tolerant)).recv()
        assert received.message == (Twist.planar(1) if tolerant else None)
        assert ("unknown encoding 'image/png'" in received.error) is not tolerant


def test_a_sample_shows_its_key_priority_source_and_size(stream: Stream) -> None:
    stream.add(b"{}")
    sample = stream.tap.recv()
    assert (sample.key, sample.priority, sample.source, sample.size) == (
        "cmd_vel",
        "DATA",
        "me@1",
        2,
    )


def test_a_closed_stream_raises_in_its_waiter(stream: Stream) -> None:
    subscription = Subscription(stream.tap, decoder((Twist,)))
    subscription.close()
    with pytest.raises(BusError):
        subscription.recv()


def test_before_the_first_message_there_is_none_and_its_age_has_no_end(stream: Stream) -> None:
    latest = Latest(Subscription(stream.tap, decoder((Twist,))))
    assert latest.read() == (None, math.inf)
    assert not latest.wait(after=0, timeout=0)
    stream.add(b'{"header": {}}')
    wait_for(lambda: latest.error == "cmd_vel: not a Twist: Object contains unknown field `header`")
    assert latest.read() == (None, math.inf)
    latest.close()


def test_the_newest_message_is_kept_with_its_age(stream: Stream) -> None:
    latest = Latest(Subscription(stream.tap, decoder((Twist,))))
    for x in (1.0, 2.0):
        stream.add(encode(Twist.planar(x)))
    assert latest.wait(after=1, timeout=10)
    message, age = latest.read()
    assert message == Twist.planar(2)
    assert 0 <= age < math.inf
    assert latest.read()[1] >= age
    assert latest.count == 2
    assert not latest.wait(after=2, timeout=0)
    latest.close()


def test_what_is_no_message_does_not_make_the_last_one_fresh(stream: Stream) -> None:
    latest = Latest(Subscription(stream.tap, decoder((Twist,))))
    stream.add(encode(Twist.planar(1)))
    assert latest.wait(after=0, timeout=10)
    before = latest.read()[1]
    stream.add(b"[]")
    wait_for(lambda: latest.error)
    message, age = latest.read()
    assert (message, latest.count) == (Twist.planar(1), 1)
    assert age >= before
    latest.close()


def test_the_keeping_thread_ends_with_its_stream(stream: Stream) -> None:
    before = set(threading.enumerate())
    latest = Latest(Subscription(stream.tap, decoder((Twist,))))
    (thread,) = set(threading.enumerate()) - before
    latest.close()
    thread.join(10)
    assert not thread.is_alive()


def seen(*times: float) -> Arrivals[Twist]:
    arrivals: Arrivals[Twist] = Arrivals()
    for number, now in enumerate(times):
        arrivals.record(Twist.planar(float(number)), now)
    return arrivals


def test_arrivals_keep_the_newest_its_age_and_the_count() -> None:
    arrivals = seen(1.0, 1.5)
    assert (arrivals.newest, arrivals.count, arrivals.age(3.0)) == (Twist.planar(1), 2, 1.5)
    assert (seen().newest, seen().count, seen().age(3.0)) == (None, 0, math.inf)


def test_a_slow_stream_is_stale_after_three_of_its_periods() -> None:
    for times, patience in [
        ((), 0.2),
        ((1.0,), 0.2),
        ((1.0, 1.02, 1.04), 0.2),
        ((1.0, 2.0), 0.2),  # one gap is no rate
        ((1.0, 2.0, 3.0), 3.0),
        ((1.0, 1.5, 2.5), 1.5),
        ((1.0, 1.02, 9.0), 0.2),  # nor is one hiccup
        ((1.0, 9.0, 9.02), 0.2),
        ((0.0, 100.0, 200.0), SLOWEST),
    ]:
        assert seen(*times).patience(0.2) == pytest.approx(patience)


def test_an_attachment_that_is_too_long_is_no_name_and_makes_a_sample_oversized() -> None:
    stream = Stream()
    stream.add(encode(Twist()), attachment=b"x" * 2000)
    received = Subscription(stream.tap, decoder((Twist,))).recv()
    assert received.error.startswith("oversized: ")
    assert (received.source, received.payload) == ("", b"")
