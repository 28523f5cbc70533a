"""Operators that drive one robot each, in a terminal each, over a line that can break."""

import contextlib
import math
import signal
import threading
from bisect import bisect
from collections.abc import Sequence
from pathlib import Path
from typing import Self

from holozen.bus import Bus
from holozen.messages import Odometry
from holozen.testing import Wire, wait_for
from holozen.testing.wire import command
from holozen.transport.connection import Connection
from holozen.transport.errors import BusError
from holozen.wire import key_for
from tests.faults.proxy import Proxy
from tests.integration.robots import sent_at, speeds, time_of

from .motion import press_until
from .played import KITTY, REPEAT, Played, event

FORWARD, BACKWARD = map(ord, "i,")
SPEED = 0.5  # m/s
RESTS = 1e-6  # m/s, rad/s
MOVES = 1e-4  # m/s, rad/s; a body that has come to rest may still settle by less
RATE = 240  # Hz of sim time; every step publishes how the robot moves

BOX = f"""<robot name="box">
  <link name="base_link">
    <inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision>
  </link>
  <gazebo>
    <plugin name="planar_move" filename="libgazebo_ros_planar_move.so">
      <commandTopic>cmd_vel</commandTopic><odometryTopic>odom</odometryTopic><odometryFrame>odom</odometryFrame>
      <odometryRate>{RATE}</odometryRate><robotBaseFrame>base_link</robotBaseFrame>
    </plugin>
  </gazebo>
</robot>
"""  # noqa: E501


class Witness:
    """How one robot moves by its odom of every step and the sim's own clock."""

    def __init__(self, bus: Bus, robot: str) -> None:
        self.seen: list[tuple[float, float]] = []  # time of the sim in s, the fastest of its speeds
        self._sent: list[float] = []  # when the sim sent each, s as of time.monotonic
        self._odom = bus.subscribe(key_for("odom", robot), Odometry, depth=1000)
        threading.Thread(target=self._watch, daemon=True).start()

    def now(self) -> float:
        """The time of the newest odom."""
        return self.seen[-1][0]

    def time_at(self, at: float) -> float:
        """The time of the last odom that was sent before `at`, as of time.monotonic; waits for the
        next one.
        """
        wait_for(lambda: self._sent and self._sent[-1] > at, what="odom")
        return self.seen[bisect(self._sent, at) - 1][0]

    def moving(self) -> bool:
        """Whether it drives now."""
        return bool(self.seen) and self.seen[-1][1] > 0.9 * SPEED

    def rest_after(self, time: float) -> float:
        """Wait until it is at rest after `time`. Returns when that was."""
        begin = bisect(self.seen, (time, math.inf))

        def rest() -> float | None:
            return next((at for at, speed in self.seen[begin:] if speed < RESTS), None)

        return wait_for(rest, what="the robot to rest") or 0.0

    def moved_after(self, time: float) -> bool:
        """Whether it moved at any time after `time`."""
        return any(speed > MOVES for _, speed in self.seen[bisect(self.seen, (time, math.inf)) :])

    def _watch(self) -> None:
        with contextlib.suppress(BusError):
            while True:
                received = self._odom.recv()
                if odom := received.message:
                    self.seen.append((time_of(odom), max(map(abs, speeds(odom)))))
                    self._sent.append(sent_at(received))


class Operator:
    """An operator of one robot, of the sim with this process id."""

    def __init__(self, wire: Wire, bus: Bus, robot: str, sim: int) -> None:
        self.robot, self.sim, self.witness = robot, sim, Witness(bus, robot)
        self._wire, self._count = wire, 0
        self.terminal: Played | None = None
        self.line: Proxy | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.leave()

    def sit_down(
        self, script: Path | None = None, shell: bool = False, line: bool = False
    ) -> Played:
        """Start the teleop, or this script in its place, in a shell with job control, over a line
        that can be cut.
        """
        flags: Sequence[str] = self._wire.flags
        if line:
            self.line = Proxy(self._wire.port)
            flags = Connection(mode="client", connect=(self.line.endpoint,), listen=()).arguments()
        words = command("teleop", *([self.robot] if self.robot else []), *flags)
        if script:
            words[1:4] = [str(script)]
        if shell:  # it waits for Enter when the teleop was stopped, and then lets it go on
            words = ["bash", "-m", "-c", '"$@"\n' + "read -r\nfg\n" * 100, "shell", *words]
        self.terminal = Played(words, KITTY)
        self.terminal.wait_for_text("listening sim")
        wait_for(lambda: self.at.flags == 15, what="the releases to be asked for")
        return self.terminal

    @property
    def at(self) -> Played:
        """The operator's terminal."""
        assert self.terminal is not None
        return self.terminal

    def drive(self) -> None:
        """Hold a key until the robot moves; to and fro, so that it stays in place."""
        self._count += 1
        self.key = (FORWARD, BACKWARD)[self._count % 2]
        press_until(
            self.witness.moving, lambda: self.at.press(self.key), self.let_go, self.at.screen
        )

    def hold_on(self) -> None:
        """Go on holding the key: it repeats."""
        self.at.type(event(self.key, kind=REPEAT))

    def let_go(self) -> None:
        """Release the key."""
        self.at.release(self.key)

    def job(self) -> int:
        """The process that runs in the operator's shell."""
        shell = self.at.process.pid
        return int(Path(f"/proc/{shell}/task/{shell}/children").read_text().split()[0])

    def foreground(self) -> None:
        """Bring the job to the foreground once it has stopped."""
        job = self.job()
        wait_for(
            lambda: Path(f"/proc/{job}/stat").read_text().rpartition(")")[2].split()[0] == "T",
            what="its stop",
        )
        self.at.type("\r")

    def cut(self) -> None:
        """Cut the line."""
        assert self.line is not None
        self.line.stall()

    def restore(self) -> None:
        """Restore the line."""
        assert self.line is not None
        self.line.resume()

    def leave(self) -> None:
        """End the teleop, if it lives, and close the terminal."""
        if self.terminal:
            with contextlib.suppress(ProcessLookupError):
                self.terminal.process.signal(signal.SIGKILL)  # its last lines are not waited for
            self.terminal.close()
        if self.line:
            self.line.close()
        self.terminal = self.line = None
