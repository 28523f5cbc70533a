"""How processes of one machine find each other: nobody waits for ever, and nobody is missed."""

import os
import socket
import threading
import time
from collections.abc import Iterator
from types import SimpleNamespace

import pytest

from holozen.testing.wire import free_port
from holozen.transport import meeting
from holozen.transport.connection import Connection
from holozen.transport.errors import BusError
from holozen.transport.loopback import listen_error


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server


def free_endpoint() -> str:
    return f"tcp/127.0.0.1:{free_port()}"


def endpoint_of(listener: socket.socket) -> str:
    return f"tcp/127.0.0.1:{listener.getsockname()[1]}"


def test_an_endpoint_without_a_listener_is_free(listener: socket.socket) -> None:
    endpoint = endpoint_of(listener)
    assert listen_error(endpoint)
    listener.close()
    assert not listen_error(endpoint)


def test_what_is_no_endpoint_of_this_machine_is_not_free() -> None:
    for endpoint in [
        "tcp/127.0.0.1:port",
        "tcp/127.0.0.1:99999",
        "tcp/",
        "",
        "tcp/no.such.host.invalid:1",
    ]:
        assert listen_error(endpoint)


def test_an_id_is_greater_than_those_of_all_earlier_sessions() -> None:
    ids = [meeting.new_id() for _ in range(20)]
    # as Zenoh compares them
    numbers = [int.from_bytes(bytes.fromhex(one.zfill(32)), "little") for one in ids]
    assert numbers == sorted(numbers)
    assert all(len(one) <= 32 and one[0] != "0" for one in ids)


def test_one_process_at_a_time_joins_and_one_that_hangs_in_it_holds_up_no_other_for_long(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    passed = 0.0
    tried = threading.Event()

    def sleep(seconds: float) -> None:
        tried.set()
        time.sleep(seconds)

    clock = SimpleNamespace(monotonic=lambda: passed, sleep=sleep)
    monkeypatch.setattr(meeting, "time", clock)
    where = Connection(connect=(free_endpoint(),))._replace(listen=())
    where = where._replace(listen=where.connect)
    with meeting.turn(where):

        def join() -> None:
            with meeting.turn(where):
                pass

        other = threading.Thread(target=join)
        other.start()
        assert tried.wait(30)
        assert other.is_alive()
        passed = meeting.TURN
        other.join(30)
        assert not other.is_alive()


@pytest.fixture
def silent() -> Iterator[str]:
    """An endpoint where the kernel accepts connections and no process ever answers."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield endpoint_of(server)


NEVER = threading.Event()


def test_without_subscribers_there_is_nothing_to_wait_for() -> None:
    for lasting in (False, True):
        meeting.wait_for_link(
            lambda: False, meeting.Endpoints([free_endpoint()], 60), lasting, 60, NEVER
        )
    meeting.wait_for_link(lambda: False, meeting.Endpoints([], 60), False, 60, NEVER)


def test_a_holder_that_does_not_answer_is_named_with_what_to_do(
    silent: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for lasting in (False, True):
        with pytest.raises(
            BusError,
            match=rf"{silent} is held by .*\(pid {os.getpid()}\), which does not answer; it",
        ):
            meeting.wait_for_link(
                lambda: False,
                meeting.Endpoints([free_endpoint(), silent], 1.2),
                lasting,
                1.2,
                NEVER,
            )
    assert f"waiting for an answer from {silent}" in capsys.readouterr().err


def test_a_holder_that_answers_late_is_waited_for(silent: str) -> None:
    answers = iter([False] * 20)
    meeting.wait_for_link(
        lambda: next(answers, True), meeting.Endpoints([silent], 60), False, 60, NEVER
    )


def test_a_holder_that_goes_is_not_waited_for(silent: str, listener: socket.socket) -> None:
    threading.Timer(0.2, listener.close).start()
    meeting.wait_for_link(
        lambda: False, meeting.Endpoints([endpoint_of(listener)], 60), False, 60, NEVER
    )


def test_a_waiter_that_is_asked_to_end_waits_no_longer(silent: str) -> None:
    stop = threading.Event()
    stop.set()
    with pytest.raises(SystemExit) as end:
        meeting.wait_for_link(lambda: False, meeting.Endpoints([silent], 60), True, 60, stop)
    assert end.value.code == 0
