"""Waits for one message of a topic, without spin."""

import time
from typing import TYPE_CHECKING, Any

from holozen.ros import names
from holozen.ros.inbox import Waker
from holozen.ros.qos import QoSProfile, checked
from holozen.ros.subscription import Subscription

if TYPE_CHECKING:
    from holozen.ros.node import Node

__all__ = ["wait_for_message"]

LONGEST = 0.1  # s between two looks whether rclpy has ended


def wait_for_message(
    msg_type: Any, node: "Node", topic: str, *, qos_profile: QoSProfile | int = 1, time_to_wait: float = -1
) -> tuple[bool, Any]:
    """(True, the next message), or (False, None) after `time_to_wait` seconds; below zero it waits for ever.

    Raises ExternalShutdownException when a signal ends rclpy meanwhile, RCLError after `rclpy.shutdown()`.
    """
    deadline = None if time_to_wait < 0 else time.monotonic() + time_to_wait
    full, got, waker = node.resolve_topic_name(topic), list[Any](), Waker()
    waker.waiting = True
    node._holozen.check_open()
    # Not one of the node's: whoever spins it meanwhile would take the message.
    subscription = Subscription(
        node, msg_type, full, names.key(full), got.append, None, checked(qos_profile), raw=False
    )
    try:
        while not got:
            node.context.check_running(f"wait for a message on {full}")
            subscription.arm(waker)
            if (work := subscription.take()) is not None:
                work()
                continue
            left = LONGEST if deadline is None else min(LONGEST, deadline - time.monotonic())
            if left <= 0:
                return False, None
            waker.wait(left)
    finally:
        subscription.destroy()
    return True, got[0]
