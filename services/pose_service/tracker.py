"""The last odom of every robot, with the time it arrived."""

import threading
import time

from holozen.messages import GetPoseReply, GetPoseRequest, Odometry
from holozen.transport.errors import BusError, ServiceError
from holozen.transport.pubsub import Arrivals, Subscription
from holozen.wire import key_for, robot_name, topic

MAX_ROBOTS = 1000  # whose names come over the wire; beyond, the one with the oldest odom is dropped
MAX_NAMES = 50  # in one reply
MAX_ODOM_BYTES = 65_536  # larger payloads are not read


class Tracker:
    """Tracks the odom of all robots and answers get_pose."""

    def __init__(self, odoms: Subscription[Odometry]) -> None:
        row = topic("odom")
        assert row is not None
        self._silence = row.silence
        self._odoms = odoms
        self._last: dict[str, Arrivals[Odometry]] = {}  # by key, the one with the oldest odom first
        self._lock = threading.Lock()
        threading.Thread(target=self._receive, daemon=True).start()

    def get_pose(self, request: GetPoseRequest) -> GetPoseReply:
        """The last odom of a robot. Raises ServiceError for an invalid name, without odom, and if it is stale."""
        try:
            key = key_for("odom", robot_name(request.name) if request.name else "")
        except ValueError as error:
            raise ServiceError(str(error)) from None
        with self._lock:
            arrivals = self._last.get(key)
            if arrivals is None or arrivals.newest is None:
                raise ServiceError(f"no {key} was received; robots with odom: {self._names() or 'none'}")
            age = arrivals.age(time.monotonic())
            if age > arrivals.patience(self._silence):
                raise ServiceError(f"{key} is stale: the last one came {age:.1f} s ago; is the sim running?")
            return GetPoseReply(arrivals.newest, age)

    def _names(self) -> str:
        """The names of the robots with the most recent odom."""
        recent = list(self._last)[-MAX_NAMES:]
        return ", ".join(sorted(key.removesuffix("odom").rstrip("/") or "'' (at the root)" for key in recent))

    def _receive(self) -> None:
        while True:
            try:
                received = self._odoms.recv()
            except BusError:
                return
            if received.message is not None and received.key.count("/") < 2:
                self._record(received.key, received.message)

    def _record(self, key: str, odom: Odometry) -> None:
        with self._lock:
            arrivals = self._last.pop(key, None) or Arrivals()
            arrivals.record(odom, time.monotonic())
            self._last[key] = arrivals
            if len(self._last) > MAX_ROBOTS:
                del self._last[next(iter(self._last))]
