"""A request is applied once, or its caller learns that it was not: its service dies, its reply is
lost, many wait.
"""

import os
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from holozen.bus import Bus
from holozen.messages import NextGoalReply, NextGoalRequest, Odometry, TriggerReply, TriggerRequest
from holozen.testing import Process, Wire, wait_for
from holozen.transport.connection import Connection
from holozen.transport.errors import BusError, NoReply
from holozen.transport.samples import Replies
from holozen.transport.services import RING

from .proxy import Proxy

SLOW = 30.0 if os.environ.get("HOLOZEN_LONG") == "1" else 1.0  # s that a service takes
DIES = """
import os, sys
from holozen.bus import Bus, Connection
from holozen.messages import TriggerReply, TriggerRequest
bus = Bus("dies", Connection("client", connect=(sys.argv[1],)))
server = bus.serve("stop", TriggerRequest, TriggerReply, lambda request: os._exit(3))
print("serves", flush=True)
server.start()
server.thread.join()
"""


def test_a_caller_learns_that_its_service_died_and_the_next_one_answers(wire: Wire) -> None:
    caller = wire.bus("caller")
    with Process([sys.executable, "-c", DIES, wire.endpoint]) as dying:
        dying.wait_for_line("serves")
        wait_for(caller.served("stop"))
        with pytest.raises(NoReply, match="no reply from 'stop' within 2 s"):
            caller.call("stop", TriggerRequest(), TriggerReply, 2.0)
        assert dying.wait() == 3
    answers: list[TriggerRequest] = []

    def answer(request: TriggerRequest) -> TriggerReply:
        answers.append(request)
        return TriggerReply(True)

    wire.bus("next").serve("stop", TriggerRequest, TriggerReply, answer).start()
    assert caller.call("stop", TriggerRequest(), TriggerReply).success
    assert len(answers) == 1, "the request that was given up is not made again"


def test_a_slow_service_is_given_up_by_who_waits_no_longer_and_delays_no_other(wire: Wire) -> None:
    begun, go = threading.Event(), threading.Event()

    def answer(_request: TriggerRequest) -> TriggerReply:
        begun.set()
        go.wait(60.0)
        return TriggerReply(True)

    server, caller = wire.bus("server", lasting=True), wire.bus("caller")
    server.serve("slow", TriggerRequest, TriggerReply, answer).start()
    server.serve("quick", TriggerRequest, TriggerReply, lambda _: TriggerReply(True)).start()
    with ThreadPoolExecutor() as pool:
        patient = pool.submit(caller.call, "slow", TriggerRequest(), TriggerReply, SLOW + 60.0)
        assert begun.wait(30.0)
        with pytest.raises(NoReply, match=r"no reply from 'slow' within 0.2 s"):
            caller.call("slow", TriggerRequest(), TriggerReply, 0.2)
        go.wait(SLOW)
        assert caller.call("quick", TriggerRequest(), TriggerReply).success
        assert not patient.done()
        go.set()
        assert patient.result() == TriggerReply(True)


def test_a_robot_stands_while_its_next_goal_is_slow_to_come_and_then_drives_there(
    wire: Wire,
) -> None:
    asked, go = list[int](), threading.Event()

    def answer(request: NextGoalRequest) -> NextGoalReply:
        asked.append(request.request_goal)
        go.wait(60.0)
        return NextGoalReply(0.3, 0.0, 0.0, 1)

    bus = wire.bus("pose_service", lasting=True)
    server, odom = (
        bus.serve("next_goal", NextGoalRequest, NextGoalReply, answer),
        bus.latest("odom", Odometry),
    )
    wire.start("sim").wait_for_line("listens on")
    controller = wire.start("controller", "--laps", "1")
    server.start()
    wait_for(lambda: asked)
    go.wait(SLOW)
    before = wait_for(lambda: odom.read()[0])
    assert before and before.twist.twist.is_slow(0.001)
    go.set()
    controller.wait_for_line("goal 0: (0.30, 0.00")
    wait_for(lambda: (now := odom.read()[0]) and abs(now.pose.pose.position.x - 0.3) < 0.05)


def test_a_request_whose_reply_is_lost_is_applied_once_and_its_caller_gets_the_reply(
    wire: Wire, proxy: Proxy
) -> None:
    applied: list[int] = []

    def apply(_request: TriggerRequest) -> TriggerReply:
        applied.append(len(applied))
        if len(applied) == 1:
            proxy.set(lost=True)
            proxy.reset()
        return TriggerReply(True, f"number {len(applied)}")

    server = wire.bus("server", lasting=True)
    server.serve("count", TriggerRequest, TriggerReply, apply).start()
    with (
        Bus("caller", Connection("client", connect=(proxy.endpoint,))) as caller,
        ThreadPoolExecutor() as pool,
    ):
        wait_for(caller.served("count"))
        links = caller.session.info.links()
        asked = pool.submit(caller.call, "count", TriggerRequest(), TriggerReply, 20.0)
        wait_for(lambda: applied)
        wait_for(lambda: caller.session.info.links() != links, what="the link to break")
        proxy.set(lost=False)
        assert asked.result() == TriggerReply(True, "number 1")
        assert caller.call("count", TriggerRequest(), TriggerReply, 20.0).message == "number 2"
    assert applied == [0, 1]


def test_of_more_requests_than_can_wait_each_is_answered_or_ends_without_a_reply(
    wire: Wire,
) -> None:
    answered: list[TriggerRequest] = []

    def answer(request: TriggerRequest) -> TriggerReply:
        answered.append(request)
        return TriggerReply(True)

    bus, more = wire.bus("server", lasting=True), 500
    server = bus.serve("count", TriggerRequest, TriggerReply, answer)
    with Bus("caller", Connection("client", connect=(wire.endpoint,))) as caller:
        wait_for(caller.served("count"))
        asked = [caller.ask("count", 60.0) for _ in range(RING + more)]
        last = caller.ask("count", 60.0)
        wait_for(
            lambda: sum(_has_ended(replies) for replies in asked[:more]) == more,
            60,
            "the oldest to be dropped",
        )
        server.start()
        outcomes = [list(replies) for replies in (*asked[more:], last)]
        busy = sum(isinstance(replies[0], bytes) for replies in outcomes if replies)
        replied = sum(bool(replies) for replies in outcomes)
        assert len(answered) == replied - busy > 0
        assert caller.call("count", TriggerRequest(), TriggerReply, 60.0).success


def _has_ended(replies: Replies) -> bool:
    """Whether a request has ended without a reply."""
    try:
        assert replies.try_recv() is None
    except BusError:
        return True
    return False
