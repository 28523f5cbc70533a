"""UUID: the id of a goal."""

from typing import Annotated

from msgspec import Meta, field

from holozen.messages.message import Message


class UUID(Message):
    uuid: Annotated[list[int], Meta(min_length=16, max_length=16, extra={"ros": "uint8[16]"})] = (
        field(default_factory=lambda: [0] * 16)
    )
