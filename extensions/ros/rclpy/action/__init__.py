"""Actions: goals that take time, with progress, a result, and a way to cancel them."""

from typing import Any

from holozen.ros.rclpy.action.client import ActionClient
from holozen.ros.rclpy.action.server import ActionServer, CancelResponse, GoalResponse
from holozen.ros.rclpy.handle import NamesAndTypes, names_and_types
from holozen.transport.actions import found_in

__all__ = [
    "ActionClient",
    "ActionServer",
    "CancelResponse",
    "GoalResponse",
    "get_action_client_names_and_types_by_node",
    "get_action_names_and_types",
    "get_action_server_names_and_types_by_node",
]


def get_action_names_and_types(node: Any) -> NamesAndTypes:
    """Every action that a node serves or reads the feedback of, with its types."""
    return names_and_types(found_in(node._holozen.endpoints()))


def get_action_server_names_and_types_by_node(
    node: Any, remote_node_name: str, remote_node_namespace: str
) -> NamesAndTypes:
    """The actions that a node serves."""
    return names_and_types(
        found_in(node._holozen.endpoints_of(remote_node_name, remote_node_namespace, "srv"))
    )


def get_action_client_names_and_types_by_node(
    node: Any, remote_node_name: str, remote_node_namespace: str
) -> NamesAndTypes:
    """The actions that a node has clients of."""
    return names_and_types(
        found_in(node._holozen.endpoints_of(remote_node_name, remote_node_namespace, "sub"))
    )
