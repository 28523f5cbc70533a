"""A warning of a robot's topics that have no other end, while a robot with a name has them below
it.
"""

import threading

from holozen import wire
from holozen.ros.rclpy import names
from holozen.ros.rclpy.handle import NodeHandle
from holozen.ros.rclpy.waitable import Waker
from holozen.transport.errors import BusError
from holozen.transport.graph import Endpoint, on_key

AFTER = 2.0  # s from a node's first topic of a robot to the check: nodes start one after the other
LACKS = {"sub": ("pub", "nothing publishes"), "pub": ("sub", "nothing reads")}
"""Kind of an endpoint -> that of its other end, and what there is without one."""


def is_of_robot(topic: str) -> bool:
    """Whether a topic is one that robots have, such as `/odom`."""
    return wire.topic(names.key(topic)) is not None


class TopicCheck:
    """Looks once, in a thread of its own, and logs the warning. Nothing is logged once it was
    cancelled.
    """

    def __init__(self, handle: NodeHandle) -> None:
        self._handle, self._cancelled = handle, Waker()
        self.thread = threading.Thread(target=self._look, daemon=True)
        self.thread.start()

    def cancel(self) -> None:
        """End the wait for the check; takes no lock, as for a signal."""
        self._cancelled.wake()

    def _look(self) -> None:
        if self._cancelled.wait(AFTER):
            return
        try:
            ends = self._handle.bus.endpoints()
        except BusError:  # the node was destroyed
            return
        if text := _warning(ends, self._handle.bus.id):
            self._handle.logger.warning(text)


def _warning(ends: list[Endpoint], session: str) -> str:
    """What to log of the endpoints of one session; empty if all have another end, or none has one
    elsewhere.
    """
    lost: dict[str, list[str]] = {}
    rules = ""
    for end in sorted(ends):
        if end.session != session or end.kind not in LACKS or not is_of_robot(end.key):
            continue
        kind, text = LACKS[end.kind]
        keys = [other.key for other in ends if other.kind == kind and "*" not in other.key]
        named = [other for other in keys if other.endswith(f"/{end.key}")]
        if named and not on_key(ends, end.key, kind):
            lost.setdefault(text, []).append(end.key)
            rules += f" -r /{end.key}:=/{min(named)}"  # with slashes it holds in any namespace
    what = ", ".join(f"{text} {' and '.join(topics)}" for text, topics in lost.items())
    return rules and f"{what}; a robot with a name has its own: remap with --ros-args{rules}"
