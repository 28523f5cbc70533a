"""Test robots with real processes, real Zenoh and a real pseudo-terminal; pytest loads the fixtures
automatically.

    def test_the_robot_stands_after_half_a_second_of_silence(wire, wait_for):
        wire.start("sim")
        with wire.bus("my_test") as bus:
            odom, commands = bus.latest("odom", Odometry), bus.publisher("cmd_vel", Twist)
            wait_for(lambda: odom.count)

            def drives():  # a single command may be too old where the machine is busy
                commands.put(Twist.planar(x=0.3))
                return odom.read()[0].twist.twist.linear.x > 0.2

            wait_for(drives)
            wait_for(lambda: abs(odom.read()[0].twist.twist.linear.x) < 0.01)

Or without waiting, in a paused sim that makes only the steps that the test asks for:

    def test_the_robot_drives_on_for_half_a_second(lock_step):
        sim = lock_step()
        sim.drive(x=0.3)
        assert sim.step(120).twist.twist.linear.x > 0.29
        assert abs(sim.step(12).twist.twist.linear.x) < 0.01

The fixtures are in `holozen.testing.plugin`. Nothing heavy is imported here, since pytest loads
this in every run.
"""

from holozen.testing.lock_step import LockStep
from holozen.testing.process import Process, wait_for
from holozen.testing.terminal import Terminal
from holozen.testing.wire import Wire

__all__ = ["LockStep", "Process", "Terminal", "Wire", "wait_for"]
