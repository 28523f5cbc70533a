"""A service that dies while it answers: its caller learns that, and another one answers later calls."""

import sys

import pytest

from holozen.messages import TriggerReply, TriggerRequest
from holozen.testing import Process, Wire
from holozen.transport.errors import NoReply

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
