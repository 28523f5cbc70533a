"""The permissions of the secure set-up: roles, and the access control of the router that enforces
them.
"""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

NODES = "@holozen/**"  # tokens, beats, definitions, and descriptions of nodes
ABOUT, DEFINITIONS = "@holozen/*/about", "@holozen/*/definition/**"
BEATS = "@holozen/*/beat", "@holozen/*/goal_beat"  # of robots, and of those that drive to goals
EVERY = ("**", NODES)  # `**` alone does not match a chunk that begins with @
COMMANDS = ("**/cmd_vel", "**/joint_command", "**/$*_force", "**/goal_pose")
READS = (
    ABOUT,
    DEFINITIONS,
    *(
        f"**/{key}"
        for key in (
            "cmd_vel_status",
            "odom",
            "tf",
            "joint_states",
            "clock",
            "get_pose",
            "get_entities",
            "get_entity_state",
            "get_scene",
            "get_simulation_state",
            "robot_description",
            "list_parameters",
            "get_parameters",
            "describe_parameters",
        )
    ),
)
"""Keys of queries that change nothing."""
STOP = "**/stop"
ACTIONS = tuple(f"**/{key}/_action/*" for key in ("navigate_to_pose", "follow_waypoints"))
"""Those that send an autopilot to goals."""


class Role(NamedTuple):
    """What the certificates of a role may do; all may read every topic. Each field but the first is
    of key expressions.

    `top`: the highest priority of its commands, a name of Zenoh's; empty: it sends none.
    `announce`: the endpoints that its nodes may claim to have, besides subscribers.
    """

    top: str
    put: tuple[str, ...]
    ask: tuple[str, ...]  # queries: the requests of services, and gets of last values
    serve: tuple[str, ...]
    announce: tuple[str, ...]


_OWN = (ABOUT, DEFINITIONS)
_PARAMETERS = tuple(f"{verb}_parameters" for verb in ("list", "get", "set", "describe"))
_GOALS = (
    "next_goal",
    "get_pose",
    *(f"{node}/{verb}" for node in ("controller", "pose_service") for verb in _PARAMETERS),
)
_DRIVES = tuple(f"@holozen/*/*/pub/*/*/*/{key}" for key in COMMANDS)

ROLES = {
    "sim": Role("", EVERY, READS, EVERY, (NODES,)),
    "operator": Role("REAL_TIME", COMMANDS, EVERY, _OWN, _DRIVES),
    "autopilot": Role(
        "DATA_LOW",
        (*COMMANDS, *ACTIONS, BEATS[1]),
        (*READS, *BEATS, "**/next_goal", STOP, *ACTIONS),
        (*_OWN, *_GOALS, *ACTIONS, BEATS[1]),
        (
            "@holozen/*/*/goal_beat",
            *_DRIVES,
            *(f"@holozen/*/*/srv/*/*/*/{key}" for key in (*_GOALS, *ACTIONS)),
            *(f"@holozen/*/*/pub/*/*/*/{key}" for key in ACTIONS),
        ),
    ),
    "script": Role(
        "DATA", COMMANDS, (*READS, *BEATS, "**/next_goal", STOP, *ACTIONS), _OWN, _DRIVES
    ),
    "viewer": Role("", (), READS, (ABOUT,), ()),
}
"""The roles of a router's clients."""
ROUTER = "router"  # the name, and the role, of what they connect to

_ALL = [
    "put",
    "delete",
    "declare_subscriber",
    "query",
    "reply",
    "declare_queryable",
    "liveliness_token",
    "declare_liveliness_subscriber",
    "liveliness_query",
]


def access_control(members: Mapping[str, str]) -> dict[str, object]:
    """Zenoh's access control for members, name -> role: what is not allowed here is denied, to
    members and others.
    """
    rules = [
        _rule("receive", "egress", _ALL, EVERY),
        _rule("subscribe", "ingress", ["declare_subscriber"], EVERY),
        _rule("graph", "ingress", ["declare_liveliness_subscriber", "liveliness_query"], [NODES]),
        _rule(
            "live", "ingress", ["liveliness_token"], ["@holozen/*/*/node", "@holozen/*/*/sub/**"]
        ),
    ]
    policies = []
    for name, role in ROLES.items():
        if not (holders := sorted(member for member in members if members[member] == name)):
            continue
        mine = [
            _rule(f"{name} {verb}", "ingress", messages, keys)
            for verb, messages, keys in (
                ("put", ["put", "delete"], role.put),
                ("ask", ["query"], role.ask),
                ("serve", ["declare_queryable", "reply"], role.serve),
                ("announce", ["liveliness_token"], role.announce),
            )
            if keys
        ]
        rules += mine
        policies.append(
            {
                "rules": ["receive", "subscribe", "graph", "live", *(rule["id"] for rule in mine)],
                "subjects": holders,
            }
        )
    subjects = [
        {"id": member, "cert_common_names": [member]}
        for member in sorted(members)
        if members[member] in ROLES
    ]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def _rule(name: str, flow: str, messages: list[str], keys: Iterable[str]) -> dict[str, object]:
    return {
        "id": name,
        "permission": "allow",
        "flows": [flow],
        "messages": messages,
        "key_exprs": [*keys],
    }
