"""Calls wait for their service and their reply, with and without spin."""

import gc
import itertools
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from holozen.messages import TriggerReply, TriggerRequest
from holozen.ros import rclpy
from holozen.ros.generated import find
from holozen.ros.rclpy import context
from holozen.ros.rclpy.context import ExternalShutdownException
from holozen.ros.rclpy.exceptions import InvalidHandle, RCLError
from holozen.testing import Wire, wait_for
from holozen.transport import session
from holozen.transport.errors import ServiceError

Trigger: Any = find("std_srvs/srv/Trigger")
Spin = Callable[..., Any]
PACKAGE = str(Path(rclpy.__file__).parent)


def serve(wire: Wire, text: str = "done") -> None:
    """A service of our bus that answers, or refuses with "no"."""

    def answer(_request: TriggerRequest) -> TriggerReply:
        if text == "no":
            raise ServiceError("no, not now")
        return TriggerReply(True, text)

    wire.bus("server").serve("go", TriggerRequest, TriggerReply, answer).start()


def test_a_call_that_is_made_before_its_service_is_there_is_answered(ros: Wire) -> None:
    node = rclpy.create_node("tom")
    client = node.create_client(Trigger, "go")
    future = client.call_async(Trigger.Request())
    rclpy.spin_until_future_complete(node, future, timeout_sec=0.05)
    assert not future.done()
    serve(ros)
    rclpy.spin_until_future_complete(node, future, timeout_sec=10)
    assert future.result() == Trigger.Response(success=True, message="done")


def test_a_synchronous_call_needs_no_executor(ros: Wire) -> None:
    serve(ros)
    client = rclpy.create_node("tom").create_client(Trigger, "go")
    assert client.call(Trigger.Request()).message == "done"


def test_a_call_in_a_callback_of_the_same_node_is_answered(ros: Wire, spin_for: Spin) -> None:
    serve(ros)
    node, got = rclpy.create_node("tom"), list[str]()
    client = node.create_client(Trigger, "go")

    def ask() -> None:
        got.append(client.call(Trigger.Request()).message)

    node.create_timer(0.001, ask)
    spin_for(lambda: got, node)
    assert got[0] == "done"


def test_a_call_that_waits_for_the_node_itself_says_so(
    ros: Wire, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("holozen.ros.rclpy.client.LATE", 0.01)
    node = rclpy.create_node("tom")
    node.create_service(Trigger, "go", lambda _request, response: response)  # and it does not spin
    with pytest.raises(TimeoutError):
        node.create_client(Trigger, "go").call(Trigger.Request(), timeout_sec=0.5)
    assert (
        capsys.readouterr().err.count(
            "no reply yet from /go, which this node serves itself: does it spin"
        )
        == 1
    )


def test_a_synchronous_call_gives_up_in_time(ros: Wire) -> None:
    client = rclpy.create_node("tom").create_client(Trigger, "go")
    with pytest.raises(TimeoutError, match=r"^no reply from /go within 0\.05 s$"):
        client.call(Trigger.Request(), timeout_sec=0.05)
    wait_for(lambda: not any(thread.is_alive() for thread in client.threads()))


def test_a_refusal_is_raised_with_the_services_reason(ros: Wire) -> None:
    serve(ros, "no")
    node = rclpy.create_node("tom")
    future = node.create_client(Trigger, "go").call_async(Trigger.Request())
    rclpy.spin_until_future_complete(node, future, timeout_sec=10)
    assert isinstance(future.exception(), ServiceError)
    with pytest.raises(ServiceError, match=r"^no, not now$"):
        future.result()


def test_done_callbacks_run_in_spin(ros: Wire, spin_for: Spin) -> None:
    serve(ros)
    node, threads = rclpy.create_node("tom"), list[threading.Thread]()
    future = node.create_client(Trigger, "go").call_async(Trigger.Request())
    future.add_done_callback(lambda _: threads.append(threading.current_thread()))
    wait_for(future.done)
    assert threads == []
    spin_for(lambda: threads, node)
    assert threads == [threading.main_thread()]


def test_the_service_is_waited_for_also_a_foreign_one(ros: Wire) -> None:
    client = rclpy.create_node("tom").create_client(Trigger, "go")
    assert not client.service_is_ready()
    assert not client.wait_for_service(timeout_sec=0.02)
    assert not client.wait_for_service(0)
    foreign = ros.bus("foreign").session.declare_queryable("go", lambda query: query.drop())
    assert client.wait_for_service(timeout_sec=10)
    assert client.service_is_ready()
    foreign.undeclare()
    wait_for(lambda: not client.service_is_ready())


def test_a_wait_for_a_service_ends_with_rclpy(ros: Wire) -> None:
    client, ended = rclpy.create_node("tom").create_client(Trigger, "go"), list[str]()

    def wait() -> None:
        with pytest.raises(RCLError) as caught:
            client.wait_for_service()
        ended.append(str(caught.value))

    thread = threading.Thread(target=wait)
    thread.start()
    rclpy.shutdown()
    thread.join(10)
    assert ended[0].endswith("/go: rclpy was shut down")
    for look in (client.service_is_ready, lambda: client.wait_for_service(0)):
        with pytest.raises(RCLError, match="failed to look for /go: rclpy was shut down"):
            look()


def test_a_wait_for_a_service_ends_at_a_signal(ros: Wire, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(context, "GRACE", 1000.0)
    client = rclpy.create_node("tom").create_client(Trigger, "go")
    rclpy.get_default_context().interrupt()
    assert not client.service_is_ready()  # there is time for last words
    with pytest.raises(ExternalShutdownException):
        client.wait_for_service(10)


def test_a_destroyed_client_waits_for_nothing(ros: Wire) -> None:
    node = rclpy.create_node("tom")
    client = node.create_client(Trigger, "go")
    node.destroy_client(client)
    with pytest.raises(InvalidHandle, match="the client of /go was destroyed"):
        client.wait_for_service(10)


def test_a_request_of_another_type_is_reported(ros: Wire) -> None:
    client = rclpy.create_node("tom").create_client(Trigger, "go")
    for wrong, given in (
        (3, "an int"),
        (Trigger.Request, "a Trigger_Request; write Trigger.Request()"),
        (Trigger.Response(), "a Trigger_Response"),
    ):
        with pytest.raises(TypeError) as error:
            client.call_async(wrong)
        assert str(error.value) == f"/go: expected a Trigger.Request, and got {given}"


def test_a_destroyed_client_cancels_what_it_asked(ros: Wire) -> None:
    node = rclpy.create_node("tom")
    client = node.create_client(Trigger, "go")
    futures = [client.call_async(Trigger.Request()) for _ in range(3)]
    client.remove_pending_request(futures[0])
    assert futures[0].cancelled()
    assert node.destroy_client(client)
    wait_for(lambda: all(future.cancelled() for future in futures))
    with pytest.raises(InvalidHandle):
        client.call_async(Trigger.Request())


def test_a_call_that_waits_for_its_reply_ends_with_its_client(ros: Wire) -> None:
    server, node = rclpy.create_node("server"), rclpy.create_node("tom")
    # and no executor spins
    server.create_service(Trigger, "go", lambda _request, response: response)
    client = node.create_client(Trigger, "go")
    assert client.wait_for_service(10)
    future = client.call_async(Trigger.Request())
    with ThreadPoolExecutor() as pool:
        waiting = pool.submit(client.call, Trigger.Request())
        wait_for(lambda: len(client.threads()) == 2)
        node.destroy_client(client)
        with pytest.raises(
            InvalidHandle, match=r"^the client of /go was destroyed while it waited for the reply$"
        ):
            waiting.result(10)
    assert future.cancelled()


def test_a_call_that_waits_for_its_reply_ends_with_its_node(ros: Wire) -> None:
    server, node = rclpy.create_node("server"), rclpy.create_node("tom")
    # and no executor spins
    server.create_service(Trigger, "go", lambda _request, response: response)
    client = node.create_client(Trigger, "go")
    future = client.call_async(Trigger.Request())
    assert client.wait_for_service(10)
    node.destroy_node()
    wait_for(future.cancelled)
    wait_for(lambda: not any(thread.is_alive() for thread in client.threads()))


def test_ctrl_c_at_any_line_of_a_call_leaves_nothing_half_made(
    ros: Wire, monkeypatch: pytest.MonkeyPatch
) -> None:
    client = rclpy.create_node("tom").create_client(Trigger, "go")
    # an interrupt keeps what its frames hold
    complaints, kept = (list[Any](), list[KeyboardInterrupt]())
    monkeypatch.setattr(sys, "unraisablehook", complaints.append)
    monkeypatch.setattr(threading, "excepthook", complaints.append)

    def is_interrupted_at(last: int) -> bool:
        """Whether a call has a line of that number. It is interrupted there."""
        lines = iter(range(1, last + 1))

        def trace(frame: FrameType, event: str, _: Any) -> Any:
            if PACKAGE not in frame.f_code.co_filename:
                return None  # locks of Python's own threads would stay held
            if event == "line" and next(lines, 0) == last:
                raise KeyboardInterrupt
            return trace

        sys.settrace(trace)
        try:
            client.call_async(Trigger.Request())
        except KeyboardInterrupt as interrupt:
            kept.append(interrupt)
            return True
        finally:
            sys.settrace(None)
        return False

    # what is collected during a call would take the interrupt, and nobody would see it
    gc.disable()
    try:
        count = next(number for number in itertools.count(1) if not is_interrupted_at(number))
    finally:
        gc.enable()
    assert count > 15, "the lines of a call were traced"
    client.destroy()
    session.wait_for_threads(client.threads(), 10)
    kept.clear()
    assert complaints == []
