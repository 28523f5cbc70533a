"""Requests are answered in spin; errors reach the caller."""

import threading
from collections.abc import Callable
from typing import Any

import pytest

from holozen.bus import Bus
from holozen.messages import TriggerReply, TriggerRequest
from holozen.ros import rclpy
from holozen.ros.generated import find
from holozen.ros.rclpy.callback_groups import ReentrantCallbackGroup
from holozen.ros.rclpy.service import Refusal
from holozen.testing import Wire
from holozen.transport.errors import ServiceError

Trigger: Any = find("std_srvs/srv/Trigger")
SetBool: Any = find("std_srvs/srv/SetBool")
Spin = Callable[..., Any]


def asked(bus: Bus, key: str = "go") -> Callable[[], Any]:
    """A function that gives the reply or the refusal, and None before."""
    found: list[Any] = []

    def ask() -> None:
        try:
            found.append(bus.call(key, TriggerRequest(), TriggerReply, 10))
        except ServiceError as error:
            found.append(str(error))

    threading.Thread(target=ask, daemon=True).start()
    return lambda: found and found[0]


def test_a_request_of_our_bus_is_answered_in_spin(ros: Wire, spin_for: Spin) -> None:
    node, requests = rclpy.create_node("tom"), list[Any]()

    def answer(request: Any, response: Any) -> Any:
        requests.append(request)
        response.success, response.message = True, "done"
        return response

    service = node.create_service(Trigger, "~/go", answer)
    assert service.service_name == "/tom/go"
    reply = asked(ros.bus("bus"), "tom/go")
    assert spin_for(reply, node) == TriggerReply(True, "done")
    assert requests == [Trigger.Request()]
    assert node.destroy_service(service)
    assert node.count_services("/tom/go") == 0


def test_a_callback_that_returns_no_response_is_reported_to_both(ros: Wire, spin_for: Spin) -> None:
    node, bus, returned = rclpy.create_node("tom"), ros.bus("bus"), list[Any]()
    node.create_service(Trigger, "go", lambda _request, _response: returned.pop())
    for wrong, expected in [
        (None, "a NoneType; write `return response` at its end"),
        (3, "an int"),
        (SetBool.Response(), "a SetBool_Response"),
    ]:
        returned.append(wrong)
        reply = asked(bus)
        text = f"the callback of /go must return a Trigger.Response, and gave {expected}"
        with pytest.raises(TypeError) as error:
            spin_for(reply, node)
        assert str(error.value) == text
        assert spin_for(reply, node) == text


def test_an_exception_ends_the_spin_and_reaches_the_caller(ros: Wire, spin_for: Spin) -> None:
    node = rclpy.create_node("tom")
    node.create_service(Trigger, "go", lambda _request, _response: 1 / 0)
    reply = asked(ros.bus("bus"))
    with pytest.raises(ZeroDivisionError):
        spin_for(reply, node)
    assert spin_for(reply, node) == "/go: its callback failed: ZeroDivisionError: division by zero"


def test_a_refusal_of_ours_does_not_end_the_spin(ros: Wire, spin_for: Spin) -> None:
    def refuse(_request: Any, _response: Any) -> Any:
        raise Refusal("not now")

    node = rclpy.create_node("tom")
    node.create_service(Trigger, "go", refuse)
    assert spin_for(asked(ros.bus("bus")), node) == "not now"


def test_an_async_callback_answers_later_or_fails(ros: Wire, spin_for: Spin) -> None:
    node, bus, gate = rclpy.create_node("tom"), ros.bus("bus"), rclpy.Future()

    async def answer(_request: Any, response: Any) -> Any:
        response.message = await gate
        if response.message == "bad":
            raise ValueError("bad")
        return response

    node.create_service(Trigger, "go", answer)
    # The service's own group is busy until the answer.
    node.create_timer(
        0.01, lambda: gate.set_result("good"), callback_group=ReentrantCallbackGroup()
    )
    assert spin_for(asked(bus), node) == TriggerReply(False, "good")
    gate = rclpy.Future()
    gate.set_result("bad")
    reply = asked(bus)
    with pytest.raises(ValueError, match="bad"):
        spin_for(reply, node)
    assert spin_for(reply, node) == "/go: its callback failed: ValueError: bad"


def test_a_request_that_cannot_be_read_is_refused_without_the_callback(
    ros: Wire, spin_for: Spin
) -> None:
    node, called, bus = rclpy.create_node("tom"), list[Any](), ros.bus("bus")
    node.create_service(Trigger, "go", lambda request, response: called.append(request))
    reply = asked_with(bus, b'{"wrong": 1}')
    assert "unknown field" in spin_for(reply, node)
    around = asked_with(bus, b"{}", "*")
    spin_for(lambda: around() == "nothing", node)
    assert called == []


def asked_with(bus: Bus, payload: bytes, key: str = "go") -> Callable[[], Any]:
    """`asked` with any bytes; what a wildcard gets is "nothing"."""
    found: list[str] = []

    def ask() -> None:
        while not found:
            answers = [
                str(answer)
                for answer in bus.ask(key, 10.0, payload=payload, encoding="application/json")
            ]
            found.extend(answers or (["nothing"] if "*" in key else []))

    threading.Thread(target=ask, daemon=True).start()
    return lambda: found and found[0]
