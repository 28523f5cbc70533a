"""The lesson's robots without a drive: three wheels each, pushed by a force on each of them."""

import math
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from holozen.bus import Bus
from holozen.kinematics import to_body
from holozen.messages import (
    CommandStatus,
    Odometry,
    TriggerReply,
    TriggerRequest,
    Twist,
    Vector3,
    Wrench,
)
from holozen.testing import LockStep, wait_for
from holozen.transport.pubsub import Publisher, Subscription

from .robots import place, speeds

# where they are around the middle
WHEELS = {"left": math.pi / 3, "right": -math.pi / 3, "rear": math.pi}
MASS = 1.5  # kg, with its wheels


PLANAR = """<gazebo><plugin name="d" filename="libgazebo_ros_planar_move.so"><ros>
<namespace>/hb_bot_2</namespace></ros></plugin></gazebo>"""


def robot(number: int) -> str:
    """As the lesson writes it: ROS 2's tags, a namespace in the file, a base and three wheels,
    which slide.
    """
    inertia = '<inertia ixx="0.002" iyy="0.002" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial>'
    text = f"""<?xml version="1.0"?><robot name="hb_bot_{number}"><link name="base_link"><inertial>
<origin xyz="0 0 0.06"/><mass value="1.2"/>{inertia}<collision><origin xyz="0 0 0.06"/>
<geometry><cylinder radius="0.1" length="0.04"/></geometry></collision></link>"""
    for name, angle in WHEELS.items():
        x, y = 0.15 * math.cos(angle), 0.15 * math.sin(angle)
        text += f"""<joint name="{name}_joint" type="fixed"><parent link="base_link"/>
<child link="{name}_wheel_link"/><origin xyz="{x} {y} 0.04" rpy="0 0 {angle - math.pi / 2}"/></joint>
<link name="{name}_wheel_link"><inertial><mass value="0.1"/>{inertia}<collision><geometry><sphere radius="0.04"/>
</geometry></collision></link><gazebo reference="{name}_wheel_link"><mu1>0.1</mu1><mu2>0.1</mu2></gazebo>
<gazebo><plugin name="{name}_force" filename="libgazebo_ros_force.so"><ros><namespace>/hb_bot_{number}</namespace>
<remapping>gazebo_ros_force:={name}_wheel_force</remapping></ros><link_name>{name}_wheel_link</link_name>
<force_frame>link</force_frame></plugin></gazebo>"""  # noqa: E501
    return text + "</robot>"


class Lesson:
    """Three of them in one sim, and the forces of the second one."""

    def __init__(self, sim: LockStep) -> None:
        self.sim, self.bus = sim, sim.bus
        self.forces = self.publishers(sim.bus)
        self._status: Subscription[CommandStatus] = sim.bus.subscribe(
            "hb_bot_2/cmd_vel_status", CommandStatus
        )
        self.others = [sim.bus.subscribe(f"hb_bot_{number}/odom", Odometry) for number in (1, 3)]
        wait_for(lambda: all(publisher.matched for publisher in self.forces.values()))

    def publishers(self, bus: Bus, priority: str = "DATA") -> dict[str, Publisher[Wrench]]:
        return {
            wheel: bus.publisher(f"hb_bot_2/{wheel}_wheel_force", Wrench, priority)
            for wheel in WHEELS
        }

    def status_when(
        self,
        wanted: Callable[[CommandStatus], object],
        meanwhile: Callable[[], None] = lambda: None,
    ) -> CommandStatus:
        """A status as wanted, while a person commands `meanwhile`: on a busy machine a single
        command comes late.
        """

        def look() -> CommandStatus | None:
            meanwhile()
            received = self._status.try_recv()
            return (
                received.message
                if received and received.message and wanted(received.message)
                else None
            )

        status = wait_for(look, what="such a status")
        assert status is not None
        return status

    def push(self, steps: int, forward: float = 0.0, turn: float = 0.0) -> Odometry:
        """Push forward (N) and turn (N at each wheel) for so many steps, at 20 Hz; the last
        odom.
        """
        for _ in range(0, steps, 12):
            for wheel, angle in WHEELS.items():
                self.forces[wheel].put(Wrench(Vector3(x=2 / 3 * forward * math.sin(angle) - turn)))
            self.sim.step(12)
        return self.sim.odom


@pytest.fixture
def lesson(lock_step: Callable[..., LockStep], tmp_path: Path) -> Iterator[Lesson]:
    flags = []
    for number in (1, 2, 3):
        (tmp_path / f"hb_bot_{number}.urdf").write_text(robot(number))
        flags += ["--robot", str(tmp_path / f"hb_bot_{number}.urdf")]
    sim = lock_step(*flags, robot="hb_bot_2")
    sim.step(120)
    yield Lesson(sim)


@pytest.fixture
def planar(lock_step: Callable[..., LockStep], tmp_path: Path) -> Lesson:
    file = tmp_path / "hb_bot_2.urdf"
    file.write_text(robot(2).replace("</robot>", f"{PLANAR}</robot>"))
    sim = lock_step("--robot", str(file), robot="hb_bot_2")
    sim.step(120)
    return Lesson(sim)


def test_three_forces_push_one_robot_any_way_and_each_stop_ends_them(lesson: Lesson) -> None:
    sim, start = lesson.sim, place(lesson.sim.odom)
    moved = lesson.push(120, forward=3.0)
    x, y = to_body(place(moved)[0] - start[0], place(moved)[1] - start[1], start[2])
    assert 0.05 < x < 3 / MASS * 0.5**2 / 2 and abs(y) < 0.01, "friction takes some"
    for odom in lesson.others:
        message = odom.recv().message
        assert message is not None and abs(speeds(message)[0]) < 1e-3, "the others stand"
    assert lesson.status_when(lambda status: status.obeyed).obeyed == lesson.bus.source
    assert speeds(sim.step(120))[0] > 0.1, "the last forces are 0.5 s old"
    assert max(map(abs, speeds(sim.step(360)))) < 1e-2, "without a source only friction is left"
    assert abs(speeds(lesson.push(60, turn=2.0))[2]) > 0.5
    lesson.bus.call("hb_bot_2/stop", TriggerRequest(), TriggerReply)
    assert max(map(abs, speeds(lesson.push(360, turn=2.0)))) < 1e-2
    lesson.status_when(lambda status: status.stopped and status.refused.get("stopped", 0) > 3)
    lesson.bus.call("hb_bot_2/release", TriggerRequest(), TriggerReply)
    assert max(map(abs, speeds(lesson.push(60, turn=2.0)))) < 1e-2
    lesson.status_when(lambda status: status.refused.get("let go first", 0) > 3)
    sim.step(240)  # silence lets go too
    assert abs(speeds(lesson.push(60, turn=2.0))[2]) > 0.5
    person = lesson.bus.publisher("hb_bot_2/cmd_vel", Twist, "INTERACTIVE_HIGH")
    wait_for(lambda: person.matched)
    reason = "no drive: cmd_vel moves no wheels of this robot; publish forces on hb_bot_2/left"
    lesson.status_when(
        lambda status: reason in status.last_refusal, lambda: person.put(Twist.planar(0.3))
    )
    person.put(Twist())
    assert max(map(abs, speeds(lesson.push(360, turn=2.0)))) < 1e-2, (
        "a person's stop on cmd_vel ends forces"
    )


def test_forces_and_velocities_of_a_planar_drive_have_one_driver(planar: Lesson) -> None:
    sim, person = planar.sim, planar.bus.publisher("hb_bot_2/cmd_vel", Twist, "INTERACTIVE_HIGH")
    sim.process.wait_for_line("listens on hb_bot_2/cmd_vel, hb_bot_2/left_wheel_force")
    wait_for(lambda: person.matched)
    start = place(sim.odom)
    moved = planar.push(120, forward=9.0)
    x, y = to_body(place(moved)[0] - start[0], place(moved)[1] - start[1], start[2])
    assert 0.02 < x < 9.0 / MASS * 0.05 / 2 and abs(y) < 0.01, (
        "half a second, each 0.05 s of it from rest"
    )
    assert planar.status_when(lambda status: status.obeyed).obeyed == planar.bus.source
    driver = "INTERACTIVE_HIGH"
    drives = planar.status_when(
        lambda status: status.priority == driver, lambda: person.put(Twist.planar(0.3))
    )
    assert drives.commanded.linear.x == 0.3
    assert speeds(planar.push(24, turn=4.0)) == pytest.approx((0.3, 0.0, 0.0), abs=1e-3), (
        "a person comes first"
    )
    person.put(Twist())
    assert max(map(abs, speeds(planar.push(240, turn=4.0)))) < 1e-6, (
        "and stops the forces, which do not resume"
    )
    planar.status_when(lambda status: sum(status.refused.values()) > 3)
    planar.bus.call("hb_bot_2/resume", TriggerRequest(), TriggerReply)
    assert abs(speeds(planar.push(66, turn=4.0))[2]) > 0.1
    planar.bus.call("hb_bot_2/stop", TriggerRequest(), TriggerReply)
    assert max(map(abs, speeds(planar.push(120, turn=4.0)))) < 1e-6
