"""Where simulated time comes from: messages on `clock`, while the parameter `use_sim_time` is true."""

import threading
import traceback
from typing import TYPE_CHECKING, Any

from holozen.errors import BusError
from holozen.messages import Clock as ClockMessage
from holozen.ros import names
from holozen.ros.clock import Clock, ROSClock
from holozen.ros.clock_type import ClockType
from holozen.ros.parameter import Parameter
from holozen.ros.time import Time

if TYPE_CHECKING:
    from holozen.readers import Subscription

USE_SIM_TIME = "use_sim_time"
TOPIC = "/clock"

__all__ = ["USE_SIM_TIME", "TimeSource"]


class TimeSource:
    """Gives a node's clocks simulated time, from a thread of its own: time passes while nobody spins.

    `node` is one whose boolean parameter `use_sim_time` was declared.
    """

    def __init__(self, node: Any) -> None:
        self._node = node
        self._clocks: list[ROSClock] = []
        self._lock = threading.Lock()
        self._reader: Subscription[ClockMessage] | None = None
        self._shown = Time(clock_type=ClockType.ROS_TIME)
        self._active = False
        node.add_post_set_parameters_callback(self._follow)
        self._follow([node.get_parameter(USE_SIM_TIME)])

    @property
    def ros_time_is_active(self) -> bool:
        """Whether the clocks show simulated time."""
        return self._active

    @ros_time_is_active.setter
    def ros_time_is_active(self, active: bool) -> None:
        """Show simulated time from now on, or the system's."""
        with self._lock:
            if active == self._active:
                return
            self._active = active
            if active:
                self._listen()
            elif self._reader:
                self._node._holozen.bus.drop(self._reader)
                self._reader = None
        for clock in self._clocks:
            clock._set_ros_time_is_active(active)

    def attach_clock(self, clock: Clock) -> None:
        """Give a clock this time as well. Raises ValueError for a clock that is not ROS's."""
        if not isinstance(clock, ROSClock):
            raise ValueError(f"only clocks of ROS_TIME show simulated time, and not a {clock!r}")
        clock.set_ros_time_override(self._shown)
        clock._set_ros_time_is_active(self._active)
        self._clocks.append(clock)

    def detach_clock(self, clock: Clock) -> None:
        """Give a clock no time any more."""
        if clock in self._clocks:
            self._clocks.remove(clock)

    def close(self) -> None:
        """Read no more; the clocks show the system's time."""
        self.ros_time_is_active = False

    def _follow(self, parameters: list[Parameter]) -> None:
        for each in parameters:
            if each.name == USE_SIM_TIME:
                self.ros_time_is_active = bool(each.value)

    def _listen(self) -> None:
        node = self._node
        topic = node.resolve_topic_name(TOPIC)
        reader = node._holozen.bus.subscribe(names.key(topic), ClockMessage, depth=1)
        self._reader = reader
        threading.Thread(target=self._read, args=(reader,), daemon=True, name="ros clock").start()

    def _read(self, reader: "Subscription[ClockMessage]") -> None:
        while self._reader is reader:
            try:
                received = reader.recv()
            except BusError:
                return
            message = received.message
            if message is None or message.clock.sec < 0:
                fault = received.error or "it is before zero"
                self._node.get_logger().warning(f"no time on {TOPIC}: {fault}", throttle_duration_sec=10.0)
                continue
            if self._reader is not reader:
                return
            self._shown = Time(
                seconds=message.clock.sec, nanoseconds=message.clock.nanosec, clock_type=ClockType.ROS_TIME
            )
            try:
                for clock in list(self._clocks):
                    clock.set_ros_time_override(self._shown)
            except Exception:  # of a callback for jumps: time must go on
                self._node.get_logger().error(f"a callback for a jump of the clock failed:\n{traceback.format_exc()}")
