"""What a link or a stranger has garbled is a message or an error of the codec, and never another
error.
"""

import random
from collections.abc import Callable

import pytest

from holozen import messages as m
from holozen.messages.codec import CodecError, decode, encode, encoding

COMMANDS = [
    m.Twist.planar(0.3, -0.1, 0.5),
    m.TwistStamped(twist=m.Twist.planar(1.0)),
    m.JointState(name=["a", "b"], velocity=[1.0, -2.5]),
]


@pytest.mark.parametrize("wire", ["json", "cdr"])
def test_a_garbled_command_is_a_message_or_a_codec_error(
    wire: str, trials: Callable[[int, int], int]
) -> None:
    chance, refused = random.Random(seed := random.randrange(10**9)), 0
    for _ in range(count := trials(3_000, 350_000)):
        command = chance.choice(COMMANDS)
        kind = type(command)
        payload = bytearray(encode(command, wire))
        for _ in range(chance.randint(1, 4)):
            at = chance.randrange(len(payload) + 1)
            change = chance.randrange(4)
            if change == 0:
                del payload[at:]
            elif change == 1:
                payload[at:at] = chance.randbytes(chance.randint(1, 20))
            elif change == 2:
                payload[at:] = payload[:at]
            elif at < len(payload):
                payload[at] ^= 1 << chance.randrange(8)
        try:
            assert isinstance(decode(bytes(payload), encoding(wire, kind), (kind,)), kind), (
                f"seed {seed}"
            )
        except CodecError as error:
            refused += 1
            assert str(error).isprintable(), f"seed {seed}"
    assert refused > count / 5
