"""Test robots with real processes, real Zenoh and a real pseudo-terminal; pytest loads the fixtures automatically.

    def test_the_robot_stands_after_half_a_second_of_silence(wire, wait_for):
        wire.start("sim")
        with wire.bus("my_test") as bus:
            odom, commands = bus.latest("odom", Odometry), bus.publisher("cmd_vel", Twist)
            wait_for(lambda: odom.count)
            commands.put(Twist.planar(x=0.3))
            wait_for(lambda: odom.read()[0].twist.twist.linear.x > 0.2)
            wait_for(lambda: abs(odom.read()[0].twist.twist.linear.x) < 0.01)

The fixtures are in `holozen.testing.plugin`. Nothing heavy is imported here: pytest loads this in every run.
"""

from holozen.testing.process import Process, wait_for
from holozen.testing.terminal import Terminal
from holozen.testing.wire import Wire

__all__ = ["Process", "Terminal", "Wire", "wait_for"]
