"""The asking side of a request: wait for the service, and for its reply."""

import time
from typing import TYPE_CHECKING, TypeVar

from holozen import codec
from holozen.errors import TIMEOUT, NoReply, ServiceError
from holozen.server import refusal
from holozen.tap import Sample

if TYPE_CHECKING:
    from holozen.bus import Bus
    from holozen.messages import Message

R = TypeVar("R", bound="Message")

FIRST_PAUSE, LONGEST_PAUSE = 0.001, 0.02  # s before it is asked again


def call(bus: "Bus", key: str, request: "Message", reply: type[R], timeout: float) -> R:
    """See Bus.call."""
    payload, wire = codec.written(request, bus.wire)
    answer = call_bytes(bus, key, payload, codec.encoding(wire, type(request)), timeout)
    try:
        return codec.decode(answer.payload, answer.encoding, (reply,))
    except codec.CodecError as error:
        raise ServiceError(f"the reply of {key!r} is {error}") from None


def call_bytes(bus: "Bus", key: str, payload: bytes, encoding: str, timeout: float) -> Sample:
    """`call` without types: the sample of the reply."""
    deadline, pause = time.monotonic() + timeout, FIRST_PAUSE
    while (left := deadline - time.monotonic()) > 0:
        for answer in bus.ask(key, left, payload=payload, encoding=encoding):
            if isinstance(answer, Sample):
                return answer
            if answer != TIMEOUT:
                raise refusal(answer)
        time.sleep(min(pause, max(left, 0)))
        pause = min(2 * pause, LONGEST_PAUSE)
    told = f"no reply from {key!r} within {timeout:g} s at {bus.where}; `holozen service list` shows who serves"
    raise NoReply(told)
