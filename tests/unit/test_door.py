"""The door is held by one process, and by the next as soon as that one is gone."""

import contextlib
import socket
import threading
from collections.abc import Callable, Iterator

import pytest

from holozen import door
from holozen.testing import wait_for


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server


def endpoint_of(listener: socket.socket) -> str:
    return f"tcp/127.0.0.1:{listener.getsockname()[1]}"


class Looks(threading.Event):
    """Counts how often the door was looked at."""

    count = 0

    def wait(self, timeout: float | None = None) -> bool:
        self.count += timeout is not None
        return super().wait(timeout)


def test_an_endpoint_is_free_when_nobody_listens_there(listener: socket.socket) -> None:
    endpoint = endpoint_of(listener)
    assert not door.is_free(endpoint)
    listener.close()
    assert door.is_free(endpoint)


@pytest.mark.parametrize(
    "endpoint", ["tcp/127.0.0.1:port", "tcp/127.0.0.1:99999", "tcp/", "", "tcp/no.such.host.invalid:1"]
)
def test_what_is_no_endpoint_of_this_machine_is_not_free(endpoint: str) -> None:
    assert not door.is_free(endpoint)


def test_the_door_is_opened_when_its_holder_goes_and_closed_at_the_end(
    listener: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(door, "LOOK", 0.001)
    closing, tries, opened = Looks(), [], []

    def open_door(endpoint: str) -> Callable[[], None] | None:
        tries.append(endpoint)
        with contextlib.suppress(OSError):
            opened.append(socket.create_server(("127.0.0.1", int(endpoint.rpartition(":")[2]))))
            return opened[-1].close
        return None

    keeper = door.keep(endpoint_of(listener), closing, open_door)
    wait_for(lambda: closing.count > 3)
    assert not tries  # a session that cannot listen would take long to close
    listener.close()
    wait_for(lambda: opened)
    closing.set()
    keeper.join(10)
    assert not keeper.is_alive()
    assert opened[0].fileno() == -1


def test_a_door_that_another_was_faster_to_open_is_looked_at_again(
    listener: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(door, "LOOK", 0.001)
    endpoint = endpoint_of(listener)
    listener.close()
    closing, tries = Looks(), []
    keeper = door.keep(endpoint, closing, lambda _: tries.append(1))
    wait_for(lambda: len(tries) > 2)
    closing.set()
    keeper.join(10)
    assert not keeper.is_alive()
