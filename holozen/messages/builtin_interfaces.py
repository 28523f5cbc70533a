"""Time stamps."""

from typing import Annotated

from msgspec import Meta

from holozen.messages.message import Int32, Message


class Time(Message):
    """Seconds and nanoseconds since the clock's start. Zero means "no stamp"."""

    sec: Int32 = 0
    nanosec: Annotated[int, Meta(ge=0, lt=1_000_000_000, extra={"ros": "uint32"})] = 0

    @classmethod
    def of(cls, seconds: float) -> "Time":
        """The Time nearest to `seconds`."""
        return cls(*divmod(round(seconds * 1e9), 1_000_000_000))

    def seconds(self) -> float:
        """This time as one number, in seconds."""
        return self.sec + self.nanosec * 1e-9


class Duration(Message):
    """A span of time. Of a negative one `sec` is negative, and `nanosec` counts up from it."""

    sec: Int32 = 0
    nanosec: Annotated[int, Meta(ge=0, lt=1_000_000_000, extra={"ros": "uint32"})] = 0

    @classmethod
    def of(cls, seconds: float) -> "Duration":
        """The Duration nearest to `seconds`."""
        return cls(*divmod(round(seconds * 1e9), 1_000_000_000))
