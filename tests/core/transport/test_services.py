"""Requests are typed, and every failure is a reply with the reason."""

import json
import math
import sys
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from types import SimpleNamespace
from typing import Any, TypeVar

import pytest

from holozen.background import background
from holozen.bus import Bus
from holozen.messages import NextGoalReply, NextGoalRequest, TriggerReply, TriggerRequest
from holozen.messages.codec import WIRES, encoding
from holozen.testing import Wire, wait_for
from holozen.transport import services
from holozen.transport.beat import boot_ns
from holozen.transport.errors import NoReply, ServiceError
from holozen.transport.samples import Replies, Sample
from holozen.transport.services import (
    MAX_REQUEST_BYTES,
    PROOFS,
    RepeatedRequest,
    Server,
    answer_in_turn,
    call_bytes,
    refusal,
)

R = TypeVar("R")


def goal(request: NextGoalRequest) -> NextGoalReply:
    if request.request_goal < 0:
        raise ServiceError("goal -1: there is none\nat all")
    return NextGoalReply(x_goal=10 / request.request_goal)


@pytest.fixture
def caller(wire: Wire) -> Bus:
    """A bus beside one that serves next_goal."""
    server, caller = wire.bus("server"), wire.bus("caller")
    server.serve("next_goal", NextGoalRequest, NextGoalReply, goal).start()
    return caller


def failure(caller: Bus, payload: bytes, encoding: str = "application/json") -> str:
    with pytest.raises(ServiceError) as error:
        call_bytes(caller, "next_goal", payload, encoding, 10)
    assert not isinstance(error.value, NoReply)
    return str(error.value)


def test_a_request_gets_its_reply(caller: Bus) -> None:
    assert caller.call("next_goal", NextGoalRequest(4), NextGoalReply) == NextGoalReply(2.5)
    assert caller.call("next_goal", NextGoalRequest(5), NextGoalReply) == NextGoalReply(2.0)


@pytest.mark.parametrize("name", WIRES)
def test_a_server_speaks_its_wire_and_understands_the_others(wire: Wire, name: str) -> None:
    wire.bus("server", wire=name).serve("next_goal", NextGoalRequest, NextGoalReply, goal).start()
    for other in WIRES:
        caller = wire.bus("caller", wire=other)
        assert caller.call("next_goal", NextGoalRequest(4), NextGoalReply) == NextGoalReply(2.5)
    (answer,) = call_bytes(caller, "next_goal", b'{"request_goal": 1}', "", 10)
    assert answer.encoding == encoding(name, NextGoalReply)


def test_a_refusal_arrives_in_the_words_of_the_service(caller: Bus) -> None:
    with pytest.raises(ServiceError, match=r"^goal -1: there is none\nat all$"):
        caller.call("next_goal", NextGoalRequest(-1), NextGoalReply)


def test_an_answer_of_a_wrong_type_is_logged_with_both(
    wire: Wire, capsys: pytest.CaptureFixture[str]
) -> None:
    answer: Any = lambda _: NextGoalRequest(1)  # noqa: E731
    wire.bus("server").serve("next_goal", NextGoalRequest, NextGoalReply, answer).start()
    caller = wire.bus("caller")
    capsys.readouterr()  # a busy machine may have made it wait for an answer
    with pytest.raises(ServiceError, match=r"^next_goal: internal error, see the server's log$"):
        caller.call("next_goal", NextGoalRequest(4), NextGoalReply, 30.0)
    logged = "next_goal: TypeError: its answer is a NextGoalRequest, not a NextGoalReply\n"
    assert capsys.readouterr().err == logged


def test_sys_exit_in_a_handler_is_logged_and_the_service_goes_on(
    wire: Wire, capsys: pytest.CaptureFixture[str]
) -> None:
    ends = iter([3])

    def answer(_request: TriggerRequest) -> TriggerReply:
        for code in ends:
            sys.exit(code)
        return TriggerReply(True)

    wire.bus().serve("dock", TriggerRequest, TriggerReply, answer).start()
    client = wire.bus()
    capsys.readouterr()  # a busy machine may have made it wait for an answer
    with pytest.raises(ServiceError, match=r"^dock: internal error, see the server's log$"):
        client.call("dock", TriggerRequest(), TriggerReply, 30.0)
    assert client.call("dock", TriggerRequest(), TriggerReply, 30.0).success
    assert (
        capsys.readouterr().err
        == "dock: sys.exit(3) in its thread ends nothing; the service goes on\n"
    )


def test_sys_exit_in_a_handler_ends_a_loop_that_answers(wire: Wire) -> None:
    server = wire.bus().serve("dock", TriggerRequest, TriggerReply, lambda _: sys.exit(3))
    refused = background(lambda: wire.bus().call("dock", TriggerRequest(), TriggerReply))
    with pytest.raises(SystemExit, match="3"):
        wait_for(server.answer_pending)
    with pytest.raises(ServiceError, match="internal error"):
        refused()


def test_an_exception_in_a_handler_is_logged_and_does_not_reach_the_caller(
    caller: Bus, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()  # a busy machine may have made it wait for an answer
    with pytest.raises(ServiceError, match=r"^next_goal: internal error, see the server's log$"):
        caller.call("next_goal", NextGoalRequest(0), NextGoalReply, 30.0)
    assert capsys.readouterr().err == "next_goal: ZeroDivisionError: division by zero\n"
    assert caller.call("next_goal", NextGoalRequest(1), NextGoalReply) == NextGoalReply(10)


@pytest.mark.parametrize(
    ("payload", "encoding", "expected"),
    [
        (b'{"request_gaol": 1}', "application/json", "contains unknown field `request_gaol`"),
        (b"[]", "application/json", "not a NextGoalRequest: Expected `object`, got `array`"),
        (b"{}", "image/png", "unknown encoding 'image/png'"),
    ],
)
def test_a_request_that_is_none_is_refused_with_the_reason(
    caller: Bus, payload: bytes, encoding: str, expected: str
) -> None:
    assert expected in failure(caller, payload, encoding)


def test_a_request_that_is_too_large_is_not_read(caller: Bus) -> None:
    size = MAX_REQUEST_BYTES + 1
    assert (
        failure(caller, b"x" * size)
        == f"request of {size} bytes; at most {MAX_REQUEST_BYTES} are read"
    )


def selected(caller: Bus, selector: str) -> str:
    def ask() -> str:
        (reply,) = list(caller.session.get(selector, timeout=10)) or (None,)
        end = reply and (reply.ok or reply.err)
        return bytes(end.payload).decode() if end else ""

    return str(wait_for(ask))


def test_a_get_without_payload_asks_by_its_parameters(caller: Bus) -> None:
    assert '"x_goal":2.5' in selected(caller, "next_goal?request_goal=4")
    assert "`int`" in selected(caller, "next_goal?request_goal=four")
    assert "unknown field `gaol`" in selected(caller, "next_goal?gaol=4")
    bare = "the request is empty; send request_goal, or {} for the defaults"
    assert selected(caller, "next_goal") == json.dumps({"error": bare}), (
        "a look at a key is no request"
    )


def test_a_wildcard_query_asks_for_no_action(wire: Wire) -> None:
    asked = []

    def resume(request: TriggerRequest) -> TriggerReply:
        asked.append(request)
        return TriggerReply(True)

    server, caller = wire.bus("sim"), wire.bus("caller")
    for key in ("resume", "Fred/resume"):
        server.serve(key, TriggerRequest, TriggerReply, resume).start()
    assert caller.call("resume", TriggerRequest(), TriggerReply).success
    for key in ("**", "*", "*/resume", "Fred/*"):
        assert list(caller.session.get(key, timeout=10)) == []
    assert len(asked) == 1


def test_requests_wait_until_the_server_looks(wire: Wire) -> None:
    """The sim answers between two steps."""
    asked = []

    def resume(request: TriggerRequest) -> TriggerReply:
        asked.append(request)
        return TriggerReply(True)

    server_bus, caller = wire.bus("sim"), wire.bus("caller")
    server = server_bus.serve("resume", TriggerRequest, TriggerReply, resume)
    server.answer_pending()  # nothing waits
    with ThreadPoolExecutor() as pool:
        reply = pool.submit(caller.call, "resume", TriggerRequest(), TriggerReply, 10)

        def answered() -> bool:
            server.answer_pending()
            return reply.done()

        wait_for(answered)
    assert reply.result() == TriggerReply(True)
    assert asked == [TriggerRequest()]


def test_a_closed_server_answers_no_more(wire: Wire) -> None:
    bus = wire.bus("server")
    server = bus.serve("resume", TriggerRequest, TriggerReply, lambda _: TriggerReply(True))
    server.start()
    assert bus.call("resume", TriggerRequest(), TriggerReply).success
    server.close()
    with pytest.raises(NoReply):
        bus.call("resume", TriggerRequest(), TriggerReply, timeout=0.05)
    assert server.answer_pending() == 0


def test_the_reason_is_shown_for_our_nodes_and_for_foreign_ones() -> None:
    for payload, text in [
        (b'{"error": "no such goal"}', "no such goal"),
        (b'{"error": 7}', "7"),
        (b"plain words", "plain words"),
        (b'"error"', '"error"'),
        (b'["error"]', '["error"]'),
        (b"{}", "{}"),
        (b"", "the service answered with an error and no reason"),
        (b"\xff", "�"),
        (b"[" * 50_000, "[" * 50_000),
    ]:
        assert str(refusal(payload)) == text


def test_a_server_knows_its_caller(wire: Wire) -> None:
    callers = list[str]()

    def answer(_request: TriggerRequest) -> TriggerReply:
        callers.append(server.caller)
        return TriggerReply(True)

    server = wire.bus("server").serve("stop", TriggerRequest, TriggerReply, answer)
    server.start()
    caller = wire.bus("caller")
    caller.call("stop", TriggerRequest(), TriggerReply)
    list(caller.session.get("stop"))
    assert callers == [caller.source, ""]


class Guarded:
    """A service that obeys only what was sent after `event`, in s, and a caller that knows it."""

    def __init__(self, wire: Wire) -> None:
        self.event, self.caller = -math.inf, wire.bus("caller")
        bus = wire.bus("server")
        self.server, self.server_id = (
            bus.serve("release", TriggerRequest, TriggerReply, self._answer),
            bus.id,
        )
        wait_for(self.caller.served("release"))

    def _answer(self, _request: TriggerRequest) -> TriggerReply:
        self.server.require_sent_after(self.event, "send it again")
        return TriggerReply(True)


def ask(guarded: Guarded, attempts: RepeatedRequest) -> ServiceError | None:
    """Send a request once; why it was refused, or None."""

    def replies() -> list[Sample | bytes]:
        return list(guarded.caller.ask("release", 60.0, number=attempts.number))

    (reply,) = answered_while(guarded.server, replies)
    return None if isinstance(reply, Sample) else refusal(reply)


def test_a_request_that_was_sent_after_an_event_is_obeyed(wire: Wire) -> None:
    guarded = Guarded(wire)
    for guarded.event in (-math.inf, time.monotonic() - 1.0):
        call = partial(guarded.caller.call, "release", TriggerRequest(), TriggerReply, 60.0)
        assert answered_while(guarded.server, call).success


def test_a_request_that_was_sent_before_an_event_is_refused(wire: Wire) -> None:
    guarded = Guarded(wire)
    guarded.event = time.monotonic()
    attempts, asked = RepeatedRequest(guarded.event - 1.0), 0
    while (refused := ask(guarded, attempts)) and attempts.were_asked(refused):
        asked += 1
    assert (str(refused), asked) == ("send it again", PROOFS)


def test_an_event_after_the_caller_was_asked_counts_too(wire: Wire) -> None:
    guarded = Guarded(wire)
    guarded.event, attempts = 0.0, RepeatedRequest(time.monotonic())
    refused = ask(guarded, attempts)
    assert refused and attempts.were_asked(refused)
    guarded.event = time.monotonic()
    assert ask(guarded, attempts), "however short the time since"


def test_the_time_of_another_server_and_one_that_is_still_to_come_prove_nothing(wire: Wire) -> None:
    guarded = Guarded(wire)
    guarded.event, attempts = 0.0, RepeatedRequest(time.monotonic())
    for beat in (f"0123abcd:{2**62}", f"{guarded.server_id}:{2**62}"):
        assert attempts.were_asked(ServiceError("", beat=beat))
        assert ask(guarded, attempts), beat
    for wrong in (7, "", "0123abcd", "0123abcd:x", "a:1,b:2", "\N{DIGIT ONE}:\N{SUPERSCRIPT TWO}"):
        assert not attempts.were_asked(ServiceError("", beat=wrong))


def test_what_is_asked_after_a_reply_was_sent_after_what_it_tells(wire: Wire) -> None:
    """However late the caller reads what the server sends."""
    guarded = Guarded(wire)
    heard = guarded.caller.server_times
    call = partial(guarded.caller.call, "release", TriggerRequest(), TriggerReply, 60.0)
    assert answered_while(guarded.server, call).success
    assert [*heard] == [guarded.server_id]
    # s; less by as long as the test is held up between its looks at both clocks
    guarded.event = time.monotonic() - (boot_ns() - heard[guarded.server_id]) * 1e-9 - 1e-5
    for earlier, obeyed in ((0, True), (10**10, False)):
        attempts = RepeatedRequest(
            time.monotonic() - 60.0, {guarded.server_id: heard[guarded.server_id] - earlier}
        )
        refused = ask(guarded, attempts)
        assert refused and attempts.were_asked(refused), "whether it still waits"
        assert (ask(guarded, attempts) is None) == obeyed


def test_a_foreign_request_which_tells_no_number_is_believed(wire: Wire) -> None:
    guarded = Guarded(wire)
    guarded.event = time.monotonic() + 60.0
    assert (
        answered_while(guarded.server, lambda: outcome(guarded.caller.ask("release", 60.0)))
        == "answered"
    )


def outcome(replies: Replies) -> str:
    """The one reply to a request: "answered", or the reason why not."""
    (reply,) = list(replies)
    return "answered" if isinstance(reply, Sample) else str(refusal(reply))


def answered_while(server: Server, work: Callable[[], R]) -> R:
    """What `work` gives, done in a thread while the server answers."""
    with ThreadPoolExecutor() as pool:
        done = pool.submit(work)

        def over() -> bool:
            server.answer_pending(most=1)
            return done.done()

        wait_for(over, 60)
        return done.result()


def test_each_of_a_thousand_requests_at_once_gets_an_answer_or_the_word_busy(wire: Wire) -> None:
    server = wire.bus("server").serve(
        "resume", TriggerRequest, TriggerReply, lambda _: TriggerReply(), room=100
    )
    caller = wire.bus("caller")
    wait_for(caller.served("resume"))
    asked = [caller.ask("resume", 60.0) for _ in range(1000)]
    outcomes = Counter(answered_while(server, lambda: [outcome(replies) for replies in asked]))
    assert set(outcomes) == {"answered", "resume is busy: 100 requests wait already; ask again"}
    assert outcomes["answered"] >= 100


def test_a_caller_with_many_requests_delays_no_other(wire: Wire) -> None:
    callers = list[str]()

    def answer(_request: TriggerRequest) -> TriggerReply:
        callers.append(server.caller)
        return TriggerReply()

    def is_refused(replies: Replies) -> bool:
        server.take_in()
        return replies.try_recv() is not None

    server = wire.bus("server").serve("resume", TriggerRequest, TriggerReply, answer, room=10)
    greedy, modest = wire.bus("greedy"), wire.bus("modest")
    for bus in (greedy, modest):
        wait_for(bus.served("resume"))
    kept = [greedy.ask("resume", 60.0) for _ in range(20)]
    wait_for(lambda: is_refused(kept[-1]), what="all of them to come")
    kept.append(modest.ask("resume", 60.0))
    wait_for(
        lambda: is_refused(kept[9]),
        what="the modest one's to take the place of the greedy one's newest",
    )
    while server.answer_pending(most=1) and modest.source not in callers:
        pass
    assert callers.index(modest.source) <= 10


def test_a_call_asks_a_busy_service_again(wire: Wire) -> None:
    server = wire.bus("server").serve(
        "resume", TriggerRequest, TriggerReply, lambda _: TriggerReply(), room=1
    )
    callers = [wire.bus(f"caller{number}") for number in range(8)]

    def ask(caller: Bus) -> TriggerReply:
        return caller.call("resume", TriggerRequest(), TriggerReply, 60)

    with ThreadPoolExecutor(len(callers)) as pool:
        assert answered_while(server, lambda: list(pool.map(ask, callers))) == [TriggerReply()] * 8


def test_a_service_that_stays_busy_is_an_error_with_that_reason(
    wire: Wire, monkeypatch: pytest.MonkeyPatch
) -> None:
    passed = 0.0

    def sleep(_seconds: float) -> None:
        """Only where it has heard that the service is busy, its time passes."""
        nonlocal passed
        passed += 25.0

    monkeypatch.setattr(services, "time", SimpleNamespace(monotonic=lambda: passed, sleep=sleep))
    server = wire.bus("server").serve(
        "resume", TriggerRequest, TriggerReply, lambda _: TriggerReply(), room=0
    )
    caller = wire.bus("caller")
    wait_for(caller.served("resume"))
    with ThreadPoolExecutor() as pool:
        call = pool.submit(caller.call, "resume", TriggerRequest(), TriggerReply, 60.0)
        wait_for(lambda: server.take_in() or call.done())
    with pytest.raises(ServiceError, match=r"^resume is busy: 0 requests wait already; ask again$"):
        call.result()


def test_services_of_one_loop_take_turns(wire: Wire) -> None:
    order = list[str]()

    def noting(name: str) -> Callable[[TriggerRequest], TriggerReply]:
        def answer(_request: TriggerRequest) -> TriggerReply:
            order.append(name)
            return TriggerReply()

        return answer

    bus, caller = wire.bus("server"), wire.bus("caller")
    servers = [
        bus.serve(name, TriggerRequest, TriggerReply, noting(name)) for name in ("spawn", "delete")
    ]
    kept = list[Replies]()
    for name, many in (("spawn", 50), ("delete", 2)):
        wait_for(caller.served(name))
        kept += [caller.ask(name, 60.0) for _ in range(many)]
    wait_for(lambda: [server.take_in() for server in servers] == [50, 2])
    for _ in range(4):
        answer_in_turn(servers, 0.0)
    assert order == ["spawn", "delete", "spawn", "delete"]
    answer_in_turn(servers, 60.0)
    assert len(order) == 52
