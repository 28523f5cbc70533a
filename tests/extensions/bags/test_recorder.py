"""Everything received is recorded or counted."""

import threading
import time
from pathlib import Path

import pytest

from holozen.bags.recorder import BATCH, LONGEST_TICK, OVERHEAD, Intake, Recorder, SimTime
from holozen.bags.writer import BagWriter
from holozen.transport.graph import Graph


def test_nothing_more_is_written_once_the_disk_is_full_so_that_the_file_can_be_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    intake, writer = Intake(), BagWriter(str(tmp_path / "a"))
    for number in range(10):
        intake.add("a", b"%d" % number, "text/plain")
    monkeypatch.setattr(
        BagWriter, "full", property(lambda writer: "no room" if writer.messages == 3 else "")
    )
    recorder = Recorder(intake, writer, Graph(lambda: None))
    assert recorder.write_some()
    assert (writer.messages, intake.dropped) == (3, 7)
    writer.close()


class FakeTap:
    """A tap by its two verbs: `samples`, then it waits until it is closed."""

    def __init__(self, *samples: object, slow: float = 0.0) -> None:
        self.samples, self.slow, self.closed = list(samples), slow, threading.Event()

    def try_recv(self) -> object:
        time.sleep(self.slow)
        return self.samples.pop(0) if self.samples else None

    def recv(self) -> object:
        self.closed.wait(10)
        raise OSError("closed")

    def close(self) -> None:
        self.samples.clear()  # as Zenoh's do
        self.closed.set()


class Sample:
    def __init__(self, number: int) -> None:
        self.key, self.payload, self.encoding = "a", b"%d" % number, "text/plain"
        self.number = None
        self.is_deletion = False


def test_samples_are_taken_in_the_order_they_came_at_times_that_never_go_back() -> None:
    intake = Intake()
    for i in range(BATCH + 5):
        intake.add("a", b"%d" % i, "")
    first, rest, nothing = intake.take(), intake.take(), intake.take()
    assert (len(first), len(rest), nothing) == (BATCH, 5, [])
    assert [sample.payload for sample in first + rest] == [b"%d" % i for i in range(BATCH + 5)]
    times = [sample.at for sample in first + rest]
    assert times == sorted(times)


def test_what_finds_no_room_is_dropped_and_counted_until_there_is_room_again() -> None:
    intake = Intake(room=3 * (OVERHEAD + 10))
    for _ in range(5):
        intake.add("a", b"0123456789", "")
    assert (intake.received, intake.dropped) == (5, 2)
    assert len(intake.take()) == 3
    intake.add("a", b"0123456789", "")
    assert (intake.dropped, len(intake.take())) == (2, 1)


def test_a_sample_that_no_bag_can_give_back_is_dropped_and_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("holozen.bags.recorder.LARGEST", OVERHEAD + 5)
    intake = Intake()
    intake.add("a", b"012345", "")
    intake.add("a", b"01234", "")
    assert (intake.dropped, len(intake.take())) == (1, 1)


def test_samples_that_never_came_are_counted_by_their_publishers_numbers() -> None:
    intake = Intake()
    for publisher, number in (
        ("a", 7),
        ("b", 0),
        ("a", 8),
        ("a", 11),
        ("b", 1),
        ("a", 0),
        ("a", 1),
        ("b", 3),
    ):
        intake.add("k", b"", "", (publisher, number))
    intake.add("k", b"", "")
    assert intake.lost == 2 + 1  # a starts over at 0
    assert [sample.missed for sample in intake.take()] == [0, 0, 0, 2, 0, 0, 0, 1, 0]


def test_closing_waits_until_the_tap_is_empty() -> None:
    intake, tap = Intake(), FakeTap(*map(Sample, range(100)), slow=0.0005)
    intake.listen(tap)  # type: ignore[arg-type]
    intake.close()
    assert tap.closed.is_set()
    assert [sample.payload for sample in intake.take()] == [b"%d" % i for i in range(100)]


def test_a_tap_that_was_full_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("holozen.bags.recorder.DEPTH", 10)
    intake = Intake()
    intake.listen(FakeTap(*map(Sample, range(9))))  # type: ignore[arg-type]
    intake.listen(FakeTap(*map(Sample, range(20))))  # type: ignore[arg-type]
    intake.close()
    assert intake.overran == 2


MS = 1_000_000


def test_there_is_no_time_before_the_first_tick() -> None:
    assert SimTime().of(5) is None


def test_between_two_ticks_it_goes_on_but_not_for_long_and_never_back() -> None:
    time = SimTime()
    time.tick(0, 1000 * MS)
    assert [time.of(1000 * MS), time.of(1015 * MS)] == [0, 15 * MS]
    time.tick(10 * MS, 1020 * MS)
    assert time.of(1021 * MS) == 15 * MS
    assert time.of(1030 * MS) == 20 * MS
    assert time.of(9000 * MS) == 10 * MS + LONGEST_TICK


def test_a_reset_takes_it_back() -> None:
    time = SimTime()
    time.tick(5000 * MS, 0)
    assert time.of(0) == 5000 * MS
    time.tick(0, 20 * MS)
    assert time.of(25 * MS) == 5 * MS
