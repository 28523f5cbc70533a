"""Nodes of zenoh-ros2-sdk, an implementation of rmw_zenoh's protocol that shares no code with ours;
and the bridge.
"""

import contextlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from holozen.messages.definitions import whole_text
from holozen.messages.registry import Registry
from holozen.testing import Wire, wait_for
from tests.built import built, needs

BRIDGE = built("bridge")
ASK_AGAIN = 0.5  # s for the answer to a late subscriber, until another one is made

HASHES = {
    "std_msgs/msg/String": "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",  # noqa: E501
    "geometry_msgs/msg/Twist": "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",  # noqa: E501
    "nav_msgs/msg/Odometry": "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",  # noqa: E501
    "tf2_msgs/msg/TFMessage": "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",  # noqa: E501
    "std_srvs/srv/Trigger": "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",  # noqa: E501
    "example_interfaces/srv/AddTwoInts": "RIHS01_e118de6bf5eeb66a2491b5bda11202e7b68f198d6f67922cf30364858239c81a",  # noqa: E501
    "example_interfaces/action/Fibonacci_SendGoal": (
        "RIHS01_d1a57fb2a4afe8c21e34fb10db206f16ce6729b28531141472df92277c55b557"
    ),
    "example_interfaces/action/Fibonacci_GetResult": (
        "RIHS01_1b0de0d5d29dc955d92f546706568428632771db13ec84c15ec1c1a59f424a57"
    ),
    "example_interfaces/action/Fibonacci_FeedbackMessage": (
        "RIHS01_c1de71afd52e49a89c53d8262366884185bc0a02f78ce051c4e46b0a7fe59bb2"
    ),
}
"""Hashes that other programs print: those of rmw_zenoh's design.md, and of programs that were tried
with ROS 2.
"""

TRIGGER = {"request_definition": "", "response_definition": "bool success\nstring message"}


class Theirs:
    """Publishers, subscribers, clients and servers of ROS 2 nodes, on a wire. In the form of
    `humble` on request.
    """

    def __init__(self, wire: Wire) -> None:
        self._wire, self._ends, self.humble = wire, contextlib.ExitStack(), False

    def _made(self, kind: str, *words: Any, **more: Any) -> Any:
        import zenoh_ros2_sdk  # type: ignore[import-untyped]

        hashed = "TypeHashNotSupported" if self.humble else HASHES[words[1]]
        made = getattr(zenoh_ros2_sdk, kind)(
            *words, router_port=self._wire.port, type_hash=hashed, **more
        )
        self._ends.callback(made.close)
        return made

    def publisher(self, topic: str, kind: str, node: str = "talker") -> Any:
        """A publisher: `publish(field=value, ...)`."""
        return self._made(
            "ROS2Publisher", topic, kind, msg_definition=definition(kind), node_name=node
        )

    def subscriber(
        self, topic: str, kind: str, callback: Callable[[Any], None], **more: Any
    ) -> Any:
        """A subscriber that calls `callback` with each message."""
        return self._made(
            "ROS2Subscriber", topic, kind, callback, msg_definition=definition(kind), **more
        )

    def latched(self, topic: str, kind: str) -> Any:
        """The last message of a topic, as a late subscriber has it. That asks once, as it is made:
        before its link to the publisher is up it would find none, so others are made until one has.
        """
        from zenoh_ros2_sdk.qos import QosDurability, QosProfile  # type: ignore[import-untyped]

        found: list[Any] = []
        qos = QosProfile(durability=QosDurability.TRANSIENT_LOCAL, history_depth=1)

        due = 0.0

        def has_come() -> bool:
            nonlocal due
            if not found and time.monotonic() > due:
                self.subscriber(topic, kind, found.append, qos=qos)
                due = time.monotonic() + ASK_AGAIN
            return bool(found)

        wait_for(has_come, what=f"the last message of {topic}")
        return found[0]

    def trigger(self, name: str) -> Any:
        """A client of a service with the type Trigger: `call()`."""
        return self._made(
            "ROS2ServiceClient", name, "std_srvs/srv/Trigger", timeout=10.0, **TRIGGER
        )

    def client(self, name: str, kind: str) -> Any:
        """A client of a service, also of a part of an action: `call(field=value, ...)`."""
        found = Registry().find(kind)
        assert found.request
        assert found.response
        texts = {
            "request_definition": whole_text(found.request),
            "response_definition": whole_text(found.response),
        }
        return self._made("ROS2ServiceClient", name, kind, timeout=20.0, **texts)

    def serve_trigger(self, name: str, message: str) -> Any:
        """A server of a service with the type Trigger, which replies with `message`."""

        def answer(_request: Any) -> Any:
            return server.response_msg_class(success=True, message=message)

        server = self._made("ROS2ServiceServer", name, "std_srvs/srv/Trigger", answer, **TRIGGER)
        return server

    def type(self, name: str) -> Any:
        """The class of a message type that a publisher or subscriber uses."""
        return self._shared().store.types[name]

    def _shared(self) -> Any:
        from zenoh_ros2_sdk import ZenohSession

        return ZenohSession.get_instance("127.0.0.1", self._wire.port)

    def topics(self) -> dict[str, list[str]]:
        """What `ros2 topic list -t` shows: topics and their types."""
        from zenoh_ros2_sdk import get_topic_names_and_types

        return dict(get_topic_names_and_types(router_port=self._wire.port, timeout=1.0))

    def services(self) -> dict[str, list[str]]:
        """What `ros2 service list -t` shows, with the parts of actions."""
        from zenoh_ros2_sdk import get_service_names_and_types

        return dict(get_service_names_and_types(router_port=self._wire.port, timeout=1.0))

    def close(self) -> None:
        """End all of them."""
        self._ends.close()
        self._shared().close()


def definition(name: str) -> str:
    """The definition of a type, with those that it is made of."""
    return whole_text(Registry().find(name))


@pytest.fixture
def theirs(wire: Wire) -> Iterator[Theirs]:
    """ROS 2 nodes on this test's wire, at a router."""
    # as rmw_zenohd, without which its nodes do not meet
    wire.start("router").wait_for_line("listens at")
    made = Theirs(wire)
    yield made
    made.close()


@pytest.fixture
def published() -> dict[str, str]:
    """Published hashes of types."""
    return HASHES


@pytest.fixture(scope="module")
def bridge() -> Path:
    """The program zenoh-bridge-ros2dds."""
    needs(BRIDGE, "bridge")
    return BRIDGE
