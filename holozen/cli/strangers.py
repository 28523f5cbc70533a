"""Keys of strangers, who hold no tokens: they are known by what they send, and by what they answer."""

import time

from holozen.bus import Bus
from holozen.errors import BusError
from holozen.replies import Replies
from holozen.tap import Sample

LISTEN = 1.0  # s
LOOK = 0.002  # s


def met(bus: Bus, key: str) -> tuple[Sample, bool] | None:
    """The first sample of a key that comes within a second, and whether it is an answer to our question for it."""
    if not bus.connected():
        return None
    # Asked is for all below the key, which includes it: so one looks around, and nobody takes it for a request.
    tap, replies, deadline = bus.tap(key), bus.ask(f"{key}/**", LISTEN), time.monotonic() + LISTEN
    while time.monotonic() < deadline:
        if sample := tap.try_recv():
            return sample, False
        if answer := _answer(replies, key):
            return answer, True
        time.sleep(LOOK)
    return None


def type_in(encoding: str) -> str:
    """The type that an encoding tells, as in `application/cdr;geometry_msgs/msg/Twist`; empty if it tells none."""
    schema = encoding.partition(";")[2]
    return schema if schema.count("/") == 2 else ""


def _answer(replies: Replies, key: str) -> Sample | None:
    try:
        reply = replies.try_recv()
    except BusError:  # all have answered
        return None
    return reply if isinstance(reply, Sample) and key in (reply.key, "**") else None
