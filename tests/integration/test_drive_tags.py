"""The tags of a planar drive for its odometry and its acceleration."""

from collections.abc import Callable
from pathlib import Path
from statistics import fmean, stdev

import pytest

from holozen import entities
from holozen.messages import Odometry, Pose
from holozen.testing import LockStep

from .robots import place, speeds, time_of

NOISE = 0.05
TAGS = {
    "first": "<gaussianNoise>0.05</gaussianNoise>",
    "second": "<odometryOrigin>start</odometryOrigin><maxLinearAcceleration>0.5</maxLinearAcceleration>"  # noqa: E501
    "<max_angular_velocity>0.3</max_angular_velocity>",
}


def text(tags: str) -> str:
    return f"""<robot name="r"><link name="base"><inertial><mass value="1"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial><collision><geometry>
<box size="0.3 0.3 0.1"/></geometry></collision></link><gazebo><plugin name="d" filename="libgazebo_ros_planar_move.so">
{tags}<odometryRate>60</odometryRate></plugin></gazebo></robot>"""  # noqa: E501


def test_origin_noise_and_limits_are_those_of_the_tags(
    lock_step: Callable[..., LockStep], tmp_path: Path
) -> None:
    flags = []
    for name, tags in TAGS.items():
        (tmp_path / f"{name}.urdf").write_text(text(tags))
        flags += ["--robot", f"{tmp_path / name}.urdf={name}"]
    sim = lock_step(*flags, robot="second")
    noisy = sim.bus.subscribe("first/odom", Odometry, depth=5000)

    def next_odom() -> Odometry:
        odom = noisy.recv().message
        assert odom is not None
        return odom

    def noise() -> dict[float, tuple[float, ...]]:
        """x, y, yaw and their rates at up to 400 times after a reset: a busy machine loses some."""
        sim.reset()
        while time_of(next_odom()):
            pass  # of before the reset
        end, found = time_of(sim.step(1600)), dict[float, tuple[float, ...]]()
        while end not in found:
            odom = next_odom()
            found[time_of(odom)] = (*place(odom), *speeds(odom))
        return found

    once = noise()
    for values in zip(*once.values(), strict=True):
        assert abs(fmean(values)) < 4 * NOISE / len(once) ** 0.5
        assert stdev(values) == pytest.approx(NOISE, rel=0.25)
    both = once.keys() & (again := noise()).keys()
    assert {time: again[time] for time in both} == {time: once[time] for time in both}, (
        "the same after a reset"
    )
    assert len(both) > 100

    start = sim.reset()
    assert entities.pose(sim.bus, "second").position.y > 0.5
    assert place(start) == pytest.approx((0, 0, 0), abs=1e-3), "where it starts"
    sim.drive(x=1.0)
    assert speeds(sim.step(120))[0] == pytest.approx(0.25, abs=5e-3), "0.5 m/s^2 for 0.5 s"
    assert place(sim.odom) == pytest.approx((0.0625, 0, 0), abs=2e-3)
    sim.drive(turn=1.0)
    assert speeds(sim.step(60)) == pytest.approx((0, 0, 0.3), abs=1e-3)
    entities.delete(sim.bus, "second")
    entities.spawn(
        sim.bus, "second", text(TAGS["second"]), Pose.of((0, 2, 0), (0, 0, 0.5**0.5, 0.5**0.5))
    )
    sim.step()
    sim.drive(x=1.0)
    assert place(sim.step(120)) == pytest.approx((0.0625, 0, 0), abs=2e-3), (
        "forward, whichever way it faced"
    )
    assert entities.pose(sim.bus, "second").position.y == pytest.approx(2.0625, abs=2e-3)
    sim.drive()
    assert max(map(abs, speeds(sim.step(2)))) < 1e-3, "a stop is immediate"
