"""The last odom of every robot, with the time it arrived."""

import threading
import time

from holozen.errors import BusError, ServiceError
from holozen.messages import GetPoseReply, GetPoseRequest, Odometry
from holozen.readers import Arrivals, Subscription
from holozen.wire import key_for, robot_name, topic


class Tracker:
    """Reads the odom of all robots and answers where one of them is."""

    def __init__(self, odoms: Subscription[Odometry]) -> None:
        row = topic("odom")
        assert row is not None
        self._silence = row.silence
        self._odoms = odoms
        self._last: dict[str, Arrivals[Odometry]] = {}
        threading.Thread(target=self._follow, daemon=True).start()

    def get_pose(self, request: GetPoseRequest) -> GetPoseReply:
        """The last odom of a robot. Raises ServiceError for a wrong name, when there was none, or when it is stale."""
        try:
            key = key_for("odom", robot_name(request.name) if request.name else "")
        except ValueError as error:
            raise ServiceError(str(error)) from None
        arrivals = self._last.get(key)
        if arrivals is None or arrivals.newest is None:
            raise ServiceError(f"no {key} has been heard; robots heard: {self._names() or 'none'}")
        age = arrivals.age(time.monotonic())
        if age > arrivals.patience(self._silence):
            raise ServiceError(f"{key} is stale: the last one came {age:.1f} s ago; does the sim run?")
        return GetPoseReply(arrivals.newest, age)

    def _names(self) -> str:
        return ", ".join(sorted(key.removesuffix("odom").rstrip("/") or "'' (at the root)" for key in self._last))

    def _follow(self) -> None:
        while True:
            try:
                received = self._odoms.recv()
            except BusError:
                return
            if received.message is not None and received.sample.key.count("/") < 2:
                arrivals = self._last.get(received.sample.key) or Arrivals()
                arrivals.see(received.message, time.monotonic())
                self._last = self._last | {received.sample.key: arrivals}
