"""`holozen topic pub`: its flags. What it does is loaded while the session opens and looks around."""

from holozen.cli.noun import Verb, add_packages, open_bus
from holozen.flags import count, key, number
from holozen.meanwhile import meanwhile

TYPE_CHECKING = False
if TYPE_CHECKING:
    import argparse

    from holozen.graph import Endpoint

PATIENCE = 3.0  # s until somebody has to subscribe


def pub(args: "argparse.Namespace") -> int:
    """Publish a value once, some times, or until interrupted; a robot that it moved is stopped at the end."""
    with open_bus(args, early=True) as bus:

        def look() -> "list[Endpoint]":
            return bus.graph().settled(bus.connected)

        looking = look if args.no_wait else meanwhile(look)
        from holozen.cli.publishing import publish

        return publish(bus, args, looking)


def _arguments(parser: "argparse.ArgumentParser") -> None:
    add = parser.add_argument
    add("key", type=key)
    add("words", nargs="*", metavar="[TYPE] VALUE", help="JSON or YAML; - reads it from standard input."
        " The type, where nobody tells it, such as geometry_msgs/msg/Twist")  # fmt: skip
    add("-r", "--rate", type=number(0.01, 10_000, "Hz"), metavar="HZ", help="(default: the topic's own rate, or 1)")
    add("-1", "--once", action="store_true", help="publish once, as soon as somebody subscribes")
    add("-t", "--times", type=count(1), metavar="N", help="publish N times")
    add("-w", "--wait", "--wait-matching-subscriptions", type=count(1), metavar="N",
        help=f"wait for N subscribers, for ever (default: for one, {PATIENCE:g} s)")  # fmt: skip
    add("--max-wait", "--max-wait-time-secs", type=number(0.01, 1e6, "s"), metavar="S", help="wait at most S seconds")
    add("--no-wait", action="store_true", help="do not wait for a subscriber")
    add("--force", action="store_true", help="send numbers too that are not finite")
    add_packages(parser)
    add("--stdin", action="store_true", help="one value a line on standard input")


EXAMPLE = """holozen topic pub cmd_vel '{"linear": {"x": 0.3}}'"""
VERBS = {"pub": Verb("write messages to a key", EXAMPLE, _arguments, pub)}
