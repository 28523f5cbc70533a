"""`holozen topic list`, `type` and `find`: which keys there are, and of what type."""

import json
import time

from holozen.cli.noun import Verb, nobody, open_bus
from holozen.flags import key, nearest, number
from holozen.graph import Endpoint
from holozen.tell import printable, say

TYPE_CHECKING = False
if TYPE_CHECKING:
    import argparse


class Topic:
    """A key: its types, and how many publish and subscribe."""

    def __init__(self, key: str, ends: list[Endpoint]) -> None:
        self.key = key
        self.types = sorted({end.type for end in ends if not end.type.startswith("any/")})
        self.publishers = sum(end.kind == "pub" for end in ends)
        self.subscriptions = sum(end.kind == "sub" for end in ends)

    def line(self, counted: str, number: int) -> str:
        """As `list -v` shows it."""
        return f" * {self.key} [{', '.join(self.types) or 'unknown'}] {number} {counted}{'s' * (number != 1)}"


def topics(endpoints: list[Endpoint]) -> list[Topic]:
    """The keys that somebody reads or writes, sorted; without expressions, and without those only looked at."""
    ends: dict[str, list[Endpoint]] = {}
    for end in endpoints:
        if end.kind in ("pub", "sub") and "*" not in end.key:
            ends.setdefault(end.key, []).append(end)
    found = (Topic(key, its) for key, its in sorted(ends.items()))
    return [topic for topic in found if topic.types or topic.publishers]


def list_topics(args: "argparse.Namespace") -> int:
    """Print each key that somebody reads or writes, once."""
    with open_bus(args) as bus:
        heard: set[str] = set()
        if args.heard:
            tap, deadline = bus.tap("**"), time.monotonic() + args.heard
            while time.monotonic() < deadline:
                while (sample := tap.try_recv()) is not None:
                    heard.add(sample.key)
                time.sleep(0.005)
        found = topics(bus.graph().settled(bus.connected))
    found += [Topic(name, []) for name in sorted(heard - {topic.key for topic in found})]
    if args.count_topics:
        print(json.dumps({"count": len(found)}) if args.json else len(found))
    elif args.json:
        for topic in found:
            print(json.dumps(vars(topic)))
    elif args.verbose:
        _print_verbose(found)
    else:
        for topic in found:
            shown = f"{topic.key} [{', '.join(topic.types) or 'unknown'}]" if args.show_types else topic.key
            print(printable(shown))
    if not found:
        say(nobody("topics", bus.where, "`holozen up` starts a robot"))
    return 0


def _print_verbose(found: list[Topic]) -> None:
    print("Published topics:")
    for topic in found:
        if topic.publishers or not topic.subscriptions:
            print(printable(topic.line("publisher", topic.publishers)))
    print("\nSubscribed topics:")
    for topic in found:
        if topic.subscriptions:
            print(printable(topic.line("subscriber", topic.subscriptions)))


def type_of(args: "argparse.Namespace") -> int:
    """Print a key's type; exit code 1 if nobody says it."""
    from holozen.cli import strangers

    with open_bus(args) as bus:
        found = topics(bus.graph().settled(bus.connected))
        types = next((topic.types for topic in found if topic.key == args.key), [])
        met = None if types else strangers.met(bus, args.key)
    if met and (told := strangers.type_in(met[0].encoding)):
        types = [told]
    for name in types:
        print(json.dumps({"key": args.key, "type": name}) if args.json else printable(name))
    if met and not types:
        say(f"holozen topic type: {args.key!r} has no type that anybody tells; what comes is {met[0].encoding}")
    elif not types:
        say(f"holozen topic type: {unknown(args.key, [topic.key for topic in found], bus.where)}")
    return 0 if types else 1


def find(args: "argparse.Namespace") -> int:
    """Print the keys of a type; exit code 1 if there are none."""
    with open_bus(args) as bus:
        found = topics(bus.graph().settled(bus.connected))
    keys = [topic.key for topic in found if any(f"/{name}".endswith(f"/{args.type}") for name in topic.types)]
    if args.count_topics:
        print(json.dumps({"count": len(keys)}) if args.json else len(keys))
    else:
        for name in keys:
            print(json.dumps({"key": name, "type": args.type}) if args.json else printable(name))
    if not keys:
        types = sorted({name for topic in found for name in topic.types})
        say(f"holozen topic find: no topic of type {args.type!r}{nearest(args.type, types)}; types: {listed(types)}")
    return 0 if keys else 1


def unknown(word: str, known: list[str], where: str) -> str:
    """What to say of a key that nobody has; `known` are those there are at `where`."""
    if not known:
        return f"unknown key {word!r}: nobody is there at {where}"
    return f"unknown key {word!r}{nearest(word, known)}; known: {listed(known)}"


def listed(words: list[str]) -> str:
    """The words with commas; `none` if there are none."""
    return ", ".join(words) or "none"


def _list_arguments(parser: "argparse.ArgumentParser") -> None:
    parser.add_argument("-t", "--show-types", action="store_true", help="with their types")
    parser.add_argument("-c", "--count-topics", action="store_true", help="only how many there are")
    parser.add_argument("-v", "--verbose", action="store_true", help="with types, and how many publish and subscribe")
    told = "also keys on which something comes within S seconds, whoever writes them"
    parser.add_argument("--heard", type=number(0.01, 1e6, "s"), metavar="S", help=told)


def _type_arguments(parser: "argparse.ArgumentParser") -> None:
    parser.add_argument("key", type=key)


def _find_arguments(parser: "argparse.ArgumentParser") -> None:
    parser.add_argument("type", help="such as geometry_msgs/msg/Twist, or Twist")
    parser.add_argument("-c", "--count-topics", action="store_true", help="only how many there are")


VERBS = {
    "list": Verb("the keys that nodes read and write", "holozen topic list -t", _list_arguments, list_topics),
    "type": Verb("a key's type", "holozen topic type odom", _type_arguments, type_of),
    "find": Verb("the keys of a type", "holozen topic find nav_msgs/msg/Odometry", _find_arguments, find),
}
