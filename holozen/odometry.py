"""A robot's odometry as feedback for driving it: whether it is stale or lost, and whether the robot is at rest."""

import time

from holozen.bus import Bus, Latest
from holozen.messages import Odometry
from holozen.wire import topic

RESTS = 0.01  # m/s and rad/s; slower counts as at rest
LOST = 0.4  # s without odom, once some arrived, so as not to drive blind; less than the sim's command timeout


class OdometryFeedback(Latest[Odometry]):
    """The newest odometry on `key`."""

    def __init__(self, bus: Bus, key: str) -> None:
        row = topic("odom")
        assert row is not None
        self._silence = row.silence
        super().__init__(bus.state(key, Odometry))

    @property
    def stale_after(self) -> float:
        """The age in s beyond which it is too old to show, or to act on, as current."""
        return self.patience(self._silence)

    @property
    def is_stale(self) -> bool:
        """Whether it is too old to show as current, or there was none yet."""
        return self.read()[1] > self.stale_after

    @property
    def is_lost(self) -> bool:
        """Whether it has stopped arriving."""
        return self.count > 0 and self.read()[1] > max(LOST, self.stale_after)

    def rests(self, since: float) -> bool:
        """Whether what was received after `since` (s, monotonic) shows a robot at rest."""
        odom, age = self.read()
        return odom is not None and time.monotonic() - age > since and odom.twist.twist.is_slow(RESTS)
