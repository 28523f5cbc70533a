"""`holozen service call`: its flags. What it does is loaded while the session opens."""

from holozen.cli.noun import Verb, add_packages, open_bus
from holozen.flags import key, number

TYPE_CHECKING = False
if TYPE_CHECKING:
    import argparse


def call(args: "argparse.Namespace") -> int:
    """Send a request and print the reply; a service's error is one line and exit code 1."""
    with open_bus(args, early=True) as bus:
        from holozen.cli.calling import call

        return call(bus, args)


def _arguments(parser: "argparse.ArgumentParser") -> None:
    add = parser.add_argument
    add("key", type=key)
    add("words", nargs="*", metavar="[TYPE] REQUEST", help="JSON or YAML (default: all zeros)")
    add("--any", action="store_true", help="send the request as it is where nobody knows the type")
    add_packages(parser)
    add("-r", "--rate", type=number(0.01, 1000, "Hz"), metavar="HZ", help="again and again, so often")
    add("--timeout", type=number(0.01, 1e6, "s"), default=5.0, metavar="S", help="seconds to wait (default: 5)")


EXAMPLE = """holozen service call next_goal '{"request_goal": 0}'"""
VERBS = {"call": Verb("call a service and print its reply", EXAMPLE, _arguments, call)}
