"""Flags of ros2 that change nothing here, taken so that its command lines work as they are written."""

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

TITLE = "taken for ros2's sake"
EVERY = ("--spin-time S", "--no-daemon")
QOS = (
    "--qos-profile NAME", "--qos-depth N", "--qos-history NAME", "--qos-reliability NAME", "--qos-durability NAME",
    "--qos-liveliness NAME", "--qos-liveliness-lease-duration-seconds S",
)  # fmt: skip
NODES, TOPICS, SERVICES = "--include-hidden-nodes", "--include-hidden-topics", "--include-hidden-services"
OF = {
    "topic list": (TOPICS,), "topic find": (TOPICS,), "topic type": (TOPICS,), "topic info": (TOPICS,),
    "topic echo": (*QOS, TOPICS, "--lost-messages", "--no-lost-messages"), "topic pub": (*QOS, "--keep-alive S"),
    "service list": (SERVICES,), "service find": (SERVICES,),
    "node list": ("-a", "--all"), "node info": ("--include-hidden",), "param list": (NODES,), "param get": (NODES,),
    "param set": (NODES,), "param describe": (NODES,), "param dump": (NODES,), "param load": (NODES,),
}  # fmt: skip


def add(parser: "Any", noun: str, verb: str) -> None:
    """Add those of a verb."""
    group = parser.add_argument_group(TITLE, "They change nothing here.")
    for flag in (*EVERY, *OF.get(f"{noun} {verb}", ())):
        name, _, value = flag.partition(" ")
        if value:
            group.add_argument(name, metavar=value)
        else:
            group.add_argument(name, action="store_true")
