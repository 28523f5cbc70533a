"""Keys of all robots under one name: one subscriber deals what comes to a ring for each."""

from typing import Any

import pytest
import zenoh

from holozen.bus import Bus
from holozen.command.wait_set import Moment, Reader, WaitSet
from holozen.messages import TriggerReply, TriggerRequest, Twist
from holozen.testing import Wire, wait_for
from holozen.transport.pubsub import Subscription

NOW = Moment(0.0, 0.0, ())


class Heard:
    """What robots that share a wait set have read."""

    def __init__(self, bus: Bus, *names: str) -> None:
        self.bus, self.inputs = bus, WaitSet()
        self.all: dict[str, list[float]] = {}
        self.readers = {name: self.add(name) for name in names}

    def add(self, name: str) -> tuple[Subscription[Twist], Reader]:
        commands = self.bus.subscribe(f"{name}/cmd_vel", Twist, depth=4, dealt=True)
        heard = self.all[name] = list[float]()

        def read(first: Any, _moment: Moment) -> bool:
            heard.extend(one.message.linear.x for one in commands.waiting(first) if one.message)
            return False

        reader = Reader(commands.raw.channel, read)
        self.inputs.add([reader])
        return commands, reader

    def remove(self, name: str) -> None:
        commands, reader = self.readers.pop(name)
        self.inputs.remove([reader])
        commands.close()

    def has(self, name: str, *values: float) -> bool:
        self.inputs.read(NOW)
        return self.all[name] == list(values)


@pytest.mark.parametrize("key", ["cmd_vel", "Fred/cmd_vel"])
def test_a_flood_pushes_nothing_of_a_higher_priority_out(wire: Wire, key: str) -> None:
    bus, read, inputs = wire.bus(), list[float](), WaitSet()
    commands = bus.subscribe(key, Twist, depth=4, dealt=True)

    def take(first: Any, _moment: Moment) -> bool:
        read.extend(one.message.linear.x for one in commands.waiting(first) if one.message)
        return False

    inputs.add([Reader(commands.raw.channel, take)])
    person, script = bus.publisher(key, Twist, "INTERACTIVE_HIGH"), bus.publisher(key, Twist)
    script.put(Twist.planar(-1))
    person.put(Twist.planar(1))
    for _ in range(100):  # within a session they arrive at once
        script.put(Twist.planar(2))
    inputs.read(NOW)
    assert read == [1, 2, 2, 2, 2]


def test_each_hears_its_own_key_the_newest_of_a_flood_and_what_is_for_all(wire: Wire) -> None:
    heard, sender = Heard(wire.bus("sim"), "Fred", "Ann"), wire.bus("sender")
    keys = {name: sender.publisher(f"{name}/cmd_vel", Twist) for name in ("Fred", "Ann", "Ghost")}
    wait_for(lambda: keys["Fred"].matched and keys["Ann"].matched and keys["Ghost"].matched)

    def put(name: str, value: int) -> None:
        """However full the link is."""
        payload = b'{"linear": {"x": %d}}' % value
        sender.session.put(
            f"{name}/cmd_vel", payload, congestion_control=zenoh.CongestionControl.BLOCK
        )

    put("Ann", 1)
    for value in range(100):
        put("Fred", value)
        put("Ghost", value)
    put("*", 0)
    wait_for(lambda: heard.has("Ann", 1.0, 0.0))
    assert heard.all["Fred"][-4:] == [97.0, 98.0, 99.0, 0.0]


def test_one_that_left_hears_nothing_and_the_next_of_its_name_does(wire: Wire) -> None:
    heard, sender = Heard(wire.bus("sim"), "Fred", "Ann"), wire.bus("sender")
    fred, ann = (sender.publisher(f"{name}/cmd_vel", Twist) for name in ("Fred", "Ann"))
    wait_for(lambda: fred.matched)
    heard.remove("Fred")
    fred.put(Twist.planar(1.0))
    ann.put(Twist.planar(1.0))
    wait_for(lambda: heard.has("Ann", 1.0))
    assert heard.all["Fred"] == []
    heard.remove("Ann")
    wait_for(lambda: not fred.matched)
    heard.add("Fred")
    wait_for(lambda: fred.matched)
    fred.put(Twist.planar(2.0))
    wait_for(lambda: heard.has("Fred", 2.0))


def test_requests_are_dealt_too_and_one_for_all_is_for_none(wire: Wire) -> None:
    bus, inputs, asked = wire.bus("sim"), WaitSet(), list[str]()

    def serve(name: str) -> None:
        def answer(_: TriggerRequest) -> TriggerReply:
            asked.append(name)
            return TriggerReply(True)

        server = bus.serve(f"{name}/stop", TriggerRequest, TriggerReply, answer, dealt=True)

        def read(request: Any, _moment: Moment) -> bool:
            server.keep(request)
            return server.answer_pending() < 0

        inputs.add([Reader(server.channel, read)])

    serve("Fred")
    serve("Ann")
    caller = wire.bus("caller")
    wait_for(caller.served("Ann/stop"))
    everyone, ann = caller.ask_all("*/stop", 60.0), caller.ask_all("Ann/stop", 60.0)

    def replied() -> bool:
        inputs.read(NOW)
        return ann.try_recv() is not None

    wait_for(replied)
    assert asked == ["Ann"]
    assert not list(everyone)
