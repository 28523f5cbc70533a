"""What comes while an executor is busy waits in the ring, in order, the newest of it."""

import math
import threading
from collections.abc import Callable
from functools import partial
from typing import Any

from holozen.bus import Bus
from holozen.ros import rclpy
from holozen.ros.rclpy.waitable import Inbox, Waker
from holozen.testing import Wire, wait_for
from holozen.transport.samples import Sample


def boxed(bus: Bus, depth: int) -> Inbox[Sample]:
    tap = bus.subscribe_raw("a", depth)
    return Inbox(tap.recv, tap.try_recv, depth)


def taken(inbox: Inbox[Sample]) -> list[bytes]:
    return [sample.payload for sample in iter(inbox.take, None)]


def test_no_thread_reads_until_an_executor_waits(wire: Wire) -> None:
    bus = wire.bus()
    inbox = boxed(bus, 3)
    for number in range(5):
        bus.session.put("a", str(number))
    assert taken(inbox) == [b"2", b"3", b"4"]
    assert inbox.thread is None


def test_a_waiting_executor_is_woken_and_finds_the_message(wire: Wire) -> None:
    bus, waker = wire.bus(), Waker()
    inbox = boxed(bus, 3)
    waker.waiting = True
    inbox.arm(waker)
    for text in ("x", "y"):
        bus.session.put("a", text)
        assert waker.wait(10)
        assert wait_for(partial(taken, inbox)) == [text.encode()]


def test_the_thread_stops_reading_while_no_executor_waits_and_the_next_one_finds_the_newest(
    wire: Wire,
) -> None:
    bus, waker = wire.bus(), Waker()
    inbox = boxed(bus, 2)
    waker.waiting = True
    inbox.arm(waker)
    waker.waiting = False
    bus.session.put("a", "0")
    wait_for(lambda: inbox.parked)
    for number in range(1, 6):
        bus.session.put("a", str(number))
    assert taken(inbox) == [b"4", b"5"]
    for number in (6, 7, 8):
        bus.session.put("a", str(number))
    waker.waiting = True
    inbox.arm(waker)
    assert taken(inbox) == [b"7", b"8"]


def test_nothing_is_lost_or_turned_round_while_waits_and_looks_take_turns(wire: Wire) -> None:
    bus, waker = wire.bus(), Waker()
    inbox = boxed(bus, 10_000)
    count = 3000

    def write() -> None:
        for number in range(count):
            bus.session.put("a", str(number))

    writer = threading.Thread(target=write)
    writer.start()
    got: list[bytes] = []
    while len(got) < count:
        waker.waiting = True
        inbox.arm(waker)
        found = taken(inbox)
        if not found:
            waker.wait(10)
        waker.waiting = False
        got += [*found, *taken(inbox)]
    writer.join()
    assert got == [str(number).encode() for number in range(count)]


def test_an_executor_that_begins_to_wait_as_the_thread_parks_is_still_served(wire: Wire) -> None:
    bus = wire.bus()
    inbox = boxed(bus, 2)
    arms: list[threading.Thread] = []

    class Asked(Waker):
        @property
        def waiting(self) -> bool:
            """No executor waits, and the next moment one does."""
            arm = threading.Thread(target=inbox.arm, args=(last,))
            arm.start()
            arms.append(arm)
            arm.join(0.2)  # no longer, as it may rightly wait for the reader to be done
            return False

        @waiting.setter
        def waiting(self, value: bool) -> None: ...

    last = Waker()
    last.waiting = True
    inbox.arm(Asked())
    bus.session.put("a", "0")
    assert wait_for(partial(taken, inbox)) == [b"0"]
    wait_for(lambda: arms)
    arms[0].join(10)
    bus.session.put("a", "1")
    assert last.wait(10)


def test_a_closed_one_lets_its_thread_end_wherever_it_waits(wire: Wire) -> None:
    for waits_in_the_ring in (True, False):
        bus, waker = wire.bus(), Waker()
        inbox = boxed(bus, 2)
        waker.waiting = True
        inbox.arm(waker)
        if not waits_in_the_ring:
            waker.waiting = False
            bus.session.put("a", "0")
            wait_for(partial(getattr, inbox, "parked"))
        inbox.close()
        bus.close()
        assert inbox.thread
        inbox.thread.join(10)
        assert not inbox.thread.is_alive()
        inbox.arm(waker)
        assert inbox.parked or waits_in_the_ring


def test_a_wake_is_kept_for_the_next_wait_but_not_counted() -> None:
    waker = Waker()
    waker.wake()
    waker.wake()
    assert waker.wait(math.inf)
    assert not waker.wait(0.0)


def test_a_trigger_from_another_thread_wakes_the_executor(
    ros: Wire, spin_for: Callable[..., Any]
) -> None:
    node, threads = rclpy.create_node("tom"), list[threading.Thread]()
    guard = node.create_guard_condition(lambda: threads.append(threading.current_thread()))
    threading.Thread(target=guard.trigger).start()
    spin_for(lambda: threads, node)
    assert threads == [threading.main_thread()]


def test_triggers_that_wait_are_one_and_a_destroyed_one_is_silent(ros: Wire) -> None:
    node, called = rclpy.create_node("tom"), list[int]()
    guard = node.create_guard_condition(lambda: called.append(1))
    guard.trigger()
    guard.trigger()
    for _ in range(3):
        rclpy.spin_once(node, timeout_sec=0)
    assert called == [1]
    guard.trigger()
    assert node.destroy_guard_condition(guard)
    rclpy.spin_once(node, timeout_sec=0)
    assert called == [1]
