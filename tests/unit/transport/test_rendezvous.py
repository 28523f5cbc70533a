"""Meeting points are held by one process each, and by the next as soon as that one is gone."""

import os
import socket
import threading
from collections.abc import Callable, Iterator

import pytest

from holozen.testing import wait_for
from holozen.testing.wire import free_port
from holozen.transport import rendezvous
from holozen.transport.errors import BusError

Keep = Callable[..., tuple[threading.Event, threading.Thread]]


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server


def endpoint_of(listener: socket.socket) -> str:
    return f"tcp/127.0.0.1:{listener.getsockname()[1]}"


def test_an_endpoint_without_a_listener_is_free(listener: socket.socket) -> None:
    endpoint = endpoint_of(listener)
    assert not rendezvous.is_free(endpoint)
    listener.close()
    assert rendezvous.is_free(endpoint)


def test_what_is_no_endpoint_of_this_machine_is_not_free() -> None:
    for endpoint in ["tcp/127.0.0.1:port", "tcp/127.0.0.1:99999", "tcp/", "", "tcp/no.such.host.invalid:1"]:
        assert not rendezvous.is_free(endpoint)


class Points:
    """Stands for Zenoh: opens sockets at meeting points, and remembers where it tried."""

    def __init__(self) -> None:
        self.tries: list[str] = []
        self.open: dict[str, socket.socket] = {}
        self.lucky = True

    def __call__(self, endpoint: str) -> Callable[[], None] | None:
        self.tries.append(endpoint)
        if not self.lucky:
            return None
        self.open[endpoint] = socket.create_server(("127.0.0.1", int(endpoint.rpartition(":")[2])))
        return lambda: self.open.pop(endpoint).close()


@pytest.fixture
def points(monkeypatch: pytest.MonkeyPatch) -> Points:
    monkeypatch.setattr(rendezvous, "POLL", 0.001)
    return Points()


@pytest.fixture
def keep(points: Points) -> Iterator[Keep]:
    """Keeps points until the end of the test, or until the event that it returns is set."""
    begun = []

    def begin(*endpoints: str) -> tuple[threading.Event, threading.Thread]:
        closing = threading.Event()
        begun.append((closing, rendezvous.hold(endpoints, closing, points)))
        return begun[-1]

    yield begin
    for closing, thread in begun:
        closing.set()
        thread.join(10)


def free_endpoint() -> str:
    return f"tcp/127.0.0.1:{free_port()}"


def test_a_point_is_taken_over_when_its_holder_goes_and_given_up_at_the_end(
    listener: socket.socket, points: Points, keep: Keep
) -> None:
    closing, keeper = keep(endpoint_of(listener))
    wait_for(lambda: keeper.is_alive())
    assert not points.tries  # a session that cannot listen would take long to close
    listener.close()
    wait_for(lambda: points.open)
    closing.set()
    keeper.join(10)
    assert not keeper.is_alive()
    assert not points.open and not rendezvous.held


def test_a_point_that_another_was_faster_to_open_is_looked_at_again(points: Points, keep: Keep) -> None:
    points.lucky = False
    keep(free_endpoint())
    wait_for(lambda: len(points.tries) > 2)


def test_the_holder_of_a_later_point_moves_to_an_earlier_one_when_that_is_free(
    listener: socket.socket, points: Points, keep: Keep
) -> None:
    first, later = endpoint_of(listener), free_endpoint()
    keep(first, later)
    wait_for(lambda: list(points.open) == [later])
    listener.close()
    wait_for(lambda: list(points.open) == [first] and rendezvous.held == {first})


def test_a_process_holds_one_point_and_leaves_the_others_to_others(points: Points, keep: Keep) -> None:
    first, later = free_endpoint(), free_endpoint()
    closing, _ = keep(first, later)
    wait_for(lambda: points.open)
    keep(first, later)
    other = free_endpoint()
    keep(other)  # of another network
    wait_for(lambda: other in points.open)
    assert set(points.open) == {first, other}
    closing.set()
    wait_for(lambda: points.tries.count(first) == 2)  # the second one takes over


@pytest.fixture
def silent() -> Iterator[str]:
    """An endpoint where the kernel accepts connections and no process ever answers."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield endpoint_of(server)


NEVER = threading.Event()


def test_without_subscribers_there_is_nothing_to_wait_for() -> None:
    for lasting in (False, True):
        rendezvous.wait_for_link(lambda: False, [free_endpoint()], lasting, 60, NEVER)
    rendezvous.wait_for_link(lambda: False, [], False, 60, NEVER)


def test_a_holder_that_does_not_answer_is_named_with_what_to_do(
    silent: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for lasting in (False, True):
        with pytest.raises(BusError, match=rf"{silent} is held by .*\(pid {os.getpid()}\), which does not answer; end"):
            rendezvous.wait_for_link(lambda: False, [free_endpoint(), silent], lasting, 1.2, NEVER)
    assert f"waiting for an answer from {silent}" in capsys.readouterr().err


def test_a_holder_that_answers_late_is_waited_for(silent: str) -> None:
    answers = iter([False] * 20)
    rendezvous.wait_for_link(lambda: next(answers, True), [silent], False, 60, NEVER)


def test_a_holder_that_goes_is_not_waited_for(silent: str, listener: socket.socket) -> None:
    threading.Timer(0.2, listener.close).start()
    rendezvous.wait_for_link(lambda: False, [endpoint_of(listener)], False, 60, NEVER)


def test_a_waiter_that_is_asked_to_end_waits_no_longer(silent: str) -> None:
    stop = threading.Event()
    stop.set()
    with pytest.raises(SystemExit) as end:
        rendezvous.wait_for_link(lambda: False, [silent], True, 60, stop)
    assert end.value.code == 0
