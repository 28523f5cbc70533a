"""From a bag onto the keys: the payloads and Encodings as they were recorded."""

import time
from typing import Any

from holozen import codec
from holozen.bag.plan import Plan
from holozen.bag.reader import Channel, Message
from holozen.bus import Bus
from holozen.messages import Twist, TwistStamped

STOPS, STOP_EVERY = 5, 0.02  # s; more than one stop: a congested link drops some
STOPPED = {kind.ROS: kind for kind in (Twist, TwistStamped)}
SETTLE = 0.3  # s for readers to match, so that the first messages reach them


class Outlet:
    """Publishers for what a plan plays, with the priority of plain data: a person at a teleop is stronger."""

    def __init__(self, bus: Bus, plan: Plan) -> None:
        self._source = bus.source.encode()
        self._targets, self._commands = plan.targets, plan.commands
        self._tokens = [
            bus.announce("pub", channel.type or "any/msg/Any", key) for channel, key in plan.targets.items()
        ]
        self._publishers: dict[Channel, Any] = {
            # Data may wait for its neighbours: sent one by one, more of it is lost on a busy machine.
            channel: bus.session.declare_publisher(key, encoding=channel.encoding, express=key in plan.commands)
            for channel, key in plan.targets.items()
        }
        self._driven: set[Channel] = set()  # commands that were played since the last stop

    def settle(self) -> None:
        """Wait a moment for readers."""
        deadline = time.monotonic() + SETTLE
        while time.monotonic() < deadline:
            if any(publisher.matching_status.matching for publisher in self._publishers.values()):
                return
            time.sleep(0.005)

    def publish(self, message: Message) -> None:
        """Send a message, if it is in the plan."""
        if publisher := self._publishers.get(message.channel):
            publisher.put(message.payload, attachment=self._source)
            if self._targets[message.channel] in self._commands:
                self._driven.add(message.channel)

    def stop(self) -> None:
        """Stop every robot that was moved. Joints hold still by themselves after a short silence."""
        drives = [channel for channel in self._driven if not _is_joints(channel.key, self._targets[channel])]
        stops = [(self._publishers[channel], *_stop(channel)) for channel in drives]
        for _ in range(STOPS if stops else 0):
            for publisher, payload, encoding in stops:
                publisher.put(payload, encoding=encoding, attachment=self._source)
            time.sleep(STOP_EVERY)
        self._driven.clear()


def _is_joints(*keys: str) -> bool:
    return any(key.rpartition("/")[2] == "joint_command" for key in keys)


def _stop(channel: Channel) -> tuple[bytes, str]:
    """A stop as the channel's readers understand it, and its Encoding."""
    name = channel.encoding.partition(";")[0]
    wire = next((wire for wire, encoding in codec.WIRES.items() if encoding == name), "json")
    kind = STOPPED.get(channel.type, Twist)
    return codec.encode(kind(), wire), codec.encoding(wire, kind)
