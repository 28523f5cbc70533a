"""Time stamps."""

from typing import Annotated

from msgspec import Meta

from holozen.messages.message import Int32, Message

Nanoseconds = Annotated[int, Meta(ge=0, lt=1_000_000_000, extra={"ros": "uint32"})]
"""Those beyond the whole seconds."""


class Time(Message):
    """Seconds and nanoseconds since the clock's start. Zero means "no stamp"."""

    sec: Int32 = 0
    nanosec: Nanoseconds = 0

    @classmethod
    def of(cls, seconds: float) -> "Time":
        """The Time nearest to `seconds`."""
        return cls(*divmod(round(seconds * 1e9), 1_000_000_000))

    def seconds(self) -> float:
        """This time as one number, in seconds."""
        return self.sec + self.nanosec * 1e-9


class Duration(Message):
    """A span of time. In a negative one only `sec` is negative: -0.25 s is -1 and 750,000,000."""

    sec: Int32 = 0
    nanosec: Nanoseconds = 0

    @classmethod
    def of(cls, seconds: float) -> "Duration":
        """The Duration nearest to `seconds`."""
        return cls(*divmod(round(seconds * 1e9), 1_000_000_000))
