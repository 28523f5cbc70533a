"""Which actions there are."""

from collections.abc import Iterable
from typing import Any

from holozen.transport.actions import found_in
from holozen.transport.graph import Endpoint

__all__ = [
    "get_action_client_names_and_types_by_node", "get_action_names_and_types",
    "get_action_server_names_and_types_by_node",
]  # fmt: skip

NamesAndTypes = list[tuple[str, list[str]]]


def get_action_names_and_types(node: Any) -> NamesAndTypes:
    """Every action that a node serves or reads the feedback of, with its types."""
    return _listed(node._holozen.endpoints())


def get_action_server_names_and_types_by_node(
    node: Any, remote_node_name: str, remote_node_namespace: str
) -> NamesAndTypes:
    """The actions that a node serves."""
    return _listed(node._holozen.endpoints_of(remote_node_name, remote_node_namespace, "srv"))


def get_action_client_names_and_types_by_node(
    node: Any, remote_node_name: str, remote_node_namespace: str
) -> NamesAndTypes:
    """The actions that a node has clients of."""
    return _listed(node._holozen.endpoints_of(remote_node_name, remote_node_namespace, "sub"))


def _listed(ends: Iterable[Endpoint]) -> NamesAndTypes:
    found: dict[str, set[str]] = {}
    for action in found_in(ends):
        found.setdefault(f"/{action.key}", set()).add(action.type)
    return [(name, sorted(types)) for name, types in sorted(found.items())]
