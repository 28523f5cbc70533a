"""Bags for the tests of this folder."""

from pathlib import Path

from holozen.bags import Message as Found
from holozen.bags.formats import format_of
from holozen.bags.reader import Bag
from holozen.bags.writer import BagWriter
from holozen.messages import Message, Odometry, Twist
from holozen.messages.codec import encode

Types = tuple[type[Message], ...]
SECOND = 1_000_000_000  # ns
START = 1_700_000_000 * SECOND


def put(
    writer: BagWriter,
    key: str,
    payload: bytes,
    at: float = 0.0,
    encoding: str = "application/json",
    types: Types = (),
) -> bool:
    """Write one message, `at` seconds after START."""
    form, _ = format_of(payload, encoding, types)
    return writer.write(key, form, payload, START + round(at * SECOND))


def a_bag(path: Path, count: int = 20) -> Path:
    """Odometry at 10 Hz, commands at 5 Hz, and a text."""
    writer = BagWriter(str(path))
    for i in range(count):
        odom = Odometry()
        odom.pose.pose.position.x = i / 10
        put(writer, "odom", encode(odom), i / 10, types=(Odometry,))
        if i % 2:
            put(writer, "cmd_vel", encode(Twist.planar(x=i / 100)), i / 10 + 0.01, types=(Twist,))
    put(writer, "note", "grüße".encode(), count / 10, "text/plain")
    writer.close()
    return path


def played(errors: str) -> list[str]:
    """What `replay` wrote to standard error, but for its stalls on a busy machine."""
    lines = errors.splitlines()
    return [line for line in lines if not line.startswith("replay did not run for ")]


def read(path: Path) -> list[Found]:
    """All messages of a file."""
    with Bag(path) as bag:
        return list(bag.messages())
