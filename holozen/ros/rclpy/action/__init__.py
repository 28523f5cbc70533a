"""Actions: goals that take time, with progress, a result, and a way to cancel them."""

from holozen.ros.rclpy.action.client import ActionClient
from holozen.ros.rclpy.action.graph import (
    get_action_client_names_and_types_by_node,
    get_action_names_and_types,
    get_action_server_names_and_types_by_node,
)
from holozen.ros.rclpy.action.server import ActionServer, CancelResponse, GoalResponse

__all__ = [
    "ActionClient", "ActionServer", "CancelResponse", "GoalResponse", "get_action_client_names_and_types_by_node",
    "get_action_names_and_types", "get_action_server_names_and_types_by_node",
]  # fmt: skip
