"""`holozen topic`: inspect topics, and publish to them."""

from __future__ import annotations

import argparse

from holozen.background import background
from holozen.cli.verb import (
    DURABILITIES,
    Noun,
    Verb,
    add_count,
    by_name,
    key_argument,
    list_arguments,
    on_node,
    open_bus,
    type_and_value,
)
from holozen.flags import Instead, add_packages, count, key, number
from holozen.process import deferred_interrupt

LISTEN = 1.0  # s to listen for samples of foreign nodes, also by `info -v`
PUB_PATIENCE = 3.0  # s for a subscriber of `pub` to appear
PUB_EXAMPLE = """cmd_vel '{"linear": {"x": 0.3}}'"""


def pub(args: argparse.Namespace) -> int:
    """Publish a value once, N times, or until interrupted; a robot that it moved is stopped at the
    end.
    """
    args.type, args.value = type_and_value(args, "msg", "VALUE")
    if args.stdin and args.value is not None:
        args.error(
            f"{args.key}: {args.value!r} is one argument too many; with --stdin the values come "
            "from there"
        )
    if args.value is None and not (args.type or args.stdin):
        args.error(f"{args.key}: a value is missing; write holozen topic pub {PUB_EXAMPLE}")
    args.no_wait |= args.wait == 0
    if not (args.wait or args.max_wait):
        args.max_wait = PUB_PATIENCE
    with open_bus(args) as bus:
        looking = bus.endpoints if args.no_wait else background(bus.endpoints)
        with deferred_interrupt():  # while the session opens and queries the graph
            from holozen.cli.publish import publish

        return publish(bus, args, looking)


def _list_arguments(parser: argparse.ArgumentParser) -> None:
    list_arguments("topic")(parser)
    add = parser.add_argument
    add(
        "-v",
        "--verbose",
        action="store_true",
        help="with types, and how many publish and subscribe",
    )
    text = "also keys on which a message from any node arrives within S seconds"
    add("--heard", type=number(0.01, 1e6, "s"), metavar="S", help=text)


def _info_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("key", type=key)
    text = f"listen for {LISTEN:g} s, and show the priority, encoding and delivery of its messages"
    parser.add_argument("-v", "--verbose", action="store_true", help=text)


def _find_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("type", help="such as geometry_msgs/msg/Twist, or Twist")
    add_count(parser, "topic")


def _echo_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("key", type=key, help="a key or key expression, such as odom or */odom")
    add("type", nargs="?", metavar="TYPE", help="the same as --type")
    text = "the type of CDR payloads, where no node states it, such as geometry_msgs/msg/Twist"
    add("--type", dest="type_flag", metavar="TYPE", help=text)
    add_packages(parser)
    add("--once", action="store_true", help="end after the first message")
    add(
        "--timeout",
        type=number(0.01, 1e6, "s"),
        metavar="S",
        help="exit code 1 after S seconds without any",
    )
    add(
        "--field",
        metavar="A.B",
        help="only this field, such as pose.pose.position or transforms[0].child_frame_id",
    )
    add(
        "--filter",
        metavar="EXPR",
        help="only messages of which this is true, such as 'm.linear.x > 0.2'",
    )
    add("--csv", action="store_true", help="values separated by commas, one message per line")
    add("--raw", action="store_true", help="the bytes as they came; on a terminal, escaped")
    add("-n", action=Instead, advice="--once ends after the first message")
    add("-p", action=Instead, advice="--csv prints a message on one line")
    add("--flow-style", action=Instead, advice="--json prints each message on one line")
    add("--no-arr", action="store_true", help="only the length of lists")
    add("--no-str", action="store_true", help="only the length of texts")
    text = (
        "show at most N values of a list and characters of a text (default: 128 values of a list)"
    )
    add("-l", "--truncate-length", type=count(1), default=0, metavar="N", help=text)
    add("-f", "--full-length", action="store_true", help="lists in full")
    add(
        "--qos-durability",
        choices=DURABILITIES,
        default="system_default",
        metavar="NAME",
        help="transient_local: begin with the last message of each publisher, on any key; "
        "volatile: on none"
        " (default: on tf_static, robot_description and map)",
    )


def _pub_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("key", type=key)
    add(
        "words",
        nargs="*",
        metavar="[TYPE] VALUE",
        help="JSON or YAML; - reads it from standard "
        "input."
        " The type, where no node states it, such as geometry_msgs/msg/Twist",
    )
    add(
        "-r",
        "--rate",
        type=number(0.01, 10_000, "Hz"),
        metavar="HZ",
        help="(default: the topic's own rate, or 1)",
    )
    add("-1", "--once", action="store_true", help="publish once, as soon as there is a subscriber")
    add("-t", "--times", type=count(1), metavar="N", help="publish N times")
    add(
        "-w",
        "--wait",
        "--wait-matching-subscriptions",
        type=count(),
        metavar="N",
        help="wait for N subscribers, for ever; 0: do not wait (default: for one, "
        f"{PUB_PATIENCE:g} s)",
    )
    add(
        "--max-wait",
        "--max-wait-time-secs",
        type=number(0.01, 1e6, "s"),
        metavar="S",
        help="wait at most S seconds",
    )
    add("--no-wait", action="store_true", help="do not wait for a subscriber")
    add("--force", action="store_true", help="also send numbers that are not finite")
    add_packages(parser)
    add("--stdin", action="store_true", help="one value per line on standard input")


VERBS = by_name(
    Noun(
        "topic",
        "inspect topics, and publish to them",
        {**dict.fromkeys(("hz", "bw", "delay"), "holozen.cli.stats"), "plot": "holozen.cli.plot"},
    ),
    Verb(
        "topic list",
        "list the keys that nodes read and write",
        "-t",
        _list_arguments,
        on_node("keys", "list_topics"),
    ),
    Verb(
        "topic info",
        "show a key's type, publishers and subscribers",
        "cmd_vel",
        _info_arguments,
        on_node("keys", "topic_info"),
    ),
    Verb("topic type", "show a key's type", "odom", key_argument, on_node("keys", "topic_type")),
    Verb(
        "topic find",
        "find the keys of a type",
        "nav_msgs/msg/Odometry",
        _find_arguments,
        on_node("keys", "find_topics"),
    ),
    Verb(
        "topic echo",
        "print the messages of a key",
        "odom --once",
        _echo_arguments,
        on_node("echo", "echo"),
    ),
    Verb("topic pub", "write messages to a key", PUB_EXAMPLE, _pub_arguments, pub),
)
