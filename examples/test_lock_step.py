"""A test in lock-step with the sim: it never sleeps, and gives the same numbers on every
computer.
"""

from collections.abc import Callable

from holozen.testing import LockStep


def test_the_robot_drives_half_a_second_after_its_last_command(
    lock_step: Callable[..., LockStep],
) -> None:
    sim = lock_step()  # `holozen sim --paused` with hb_bot; flags of the sim may follow
    sim.drive(x=0.4)
    odom = sim.step(120)  # 0.5 s of 1/240 s each
    assert abs(odom.pose.pose.position.x - 0.2) < 0.002
    assert abs(odom.twist.twist.linear.x - 0.4) < 0.001
    assert abs(sim.step(12).twist.twist.linear.x) < 0.001
