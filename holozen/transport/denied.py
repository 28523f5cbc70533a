"""What the router of the secure set-up drops: it tells no sender."""

import time
from collections.abc import Iterable

from holozen.transport.connection import Connection
from holozen.transport.node import Node

PATIENCE = 1.0  # s until what was announced is known elsewhere


def denied(node: Node, where: Connection, keys: Iterable[str]) -> dict[str, str]:
    """The keys on which nobody hears what `node`, which is connected to `where`, publishes, each
    with a line that says why.

    A member may announce the publishers that it may have, and no others (by its role). So this
    looks through the router, with a session of its own, for those that the node has announced.
    """
    if node.member is None:
        return {}
    missing = set(keys)
    with Node("check", where) as other:
        deadline = time.monotonic() + max(PATIENCE, 3 * other.took)
        while missing and time.monotonic() < deadline:
            missing -= {end.key for end in other.endpoints(f"@holozen/{node.id}/*/pub/**")}
    why = (
        f"the router drops what {node.member.name} publishes there; `holozen secure show` lists "
        "members and roles"
    )
    return {key: f"{key}: {why}" for key in sorted(missing)}
