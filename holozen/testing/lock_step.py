"""A sim in lock-step with a test: its time passes only as the test steps it."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

from holozen.testing.process import wait_for
from holozen.testing.wire import Wire

if TYPE_CHECKING:
    from holozen.messages import CommandStatus, Message, Odometry, SimulationStatus
    from holozen.transport.pubsub import Subscription

T = TypeVar("T")

# the refusals of commands that were held up, or whose echo was
HELD_UP = ("late", "old", "no echo", "void", "gone")
PATIENCE = 60.0  # s for steps, or for a sim to start


class LockStep:
    """A paused sim on a test's wire, and one of its robots, by name. Flags are those of `holozen
    sim`, options those of Process.

    A step is one of the world, 1/240 s by default. The effect of a command over a number of steps
    is the same, to the last bit, on a slow computer and on a fast one. Other processes may take
    part, and read and command as always. `odom` and `status` are the newest messages.
    """

    def __init__(self, wire: Wire, *flags: str, robot: str = "", **options: Any) -> None:
        from holozen.messages import CommandStatus, Odometry, SimulationStatus, Twist
        from holozen.wire import key_for

        self.process = wire.start("sim", "--paused", *flags, **options)
        # Another sim that is here already would answer in its place, and this one ends.
        self.process.wait_for_line(f"{robot} listens on", PATIENCE)
        self.bus = wire.bus("lock_step")
        self._times = self.bus.subscribe("simulation_status", SimulationStatus)
        self._odoms = self.bus.subscribe(key_for("odom", robot), Odometry)
        self._statuses = self.bus.subscribe(key_for("cmd_vel_status", robot), CommandStatus)
        self._commands = self.bus.publisher(key_for("cmd_vel", robot), Twist)
        self.status: SimulationStatus
        self.odom: Odometry
        self._obeyed: CommandStatus = self._wait(lambda: _newest(self._statuses), "a robot")
        self._read(lambda _: True)

    def step(self, steps: int = 1) -> "Odometry":
        """Let the sim make `steps`; returns the odom after the last one."""
        from holozen.messages import simulation_interfaces as si

        before = self.status
        self._call("step_simulation", si.StepSimulationRequest(steps), si.StepSimulationReply)
        return self._read(
            lambda now: (now.epoch, now.steps) == (before.epoch, before.steps + steps)
        )

    def reset(self, scope: int = 0) -> "Odometry":
        """Reset the sim, or what a `scope` of ResetSimulationRequest names; returns the first odom
        after it.
        """
        from holozen.messages import simulation_interfaces as si

        before = self.status
        self._call("reset_simulation", si.ResetSimulationRequest(scope), si.ResetSimulationReply)
        return self._read(lambda now: now.epoch == before.epoch + 1)

    def drive(self, x: float = 0.0, y: float = 0.0, turn: float = 0.0) -> None:
        """Send a command (m/s and rad/s in the body frame), and wait until the robot has it; it
        obeys from the next step on. AssertionError if it is refused.
        """
        from holozen.messages import Twist

        echoes = self._commands.echoes
        assert echoes
        self._wait(
            lambda: self._commands.matched and echoes.may_command(),
            "a robot that listens and beats",
        )
        refusal = HELD_UP[0]
        while refusal.startswith(HELD_UP):
            self._obeyed = _newest(self._statuses) or self._obeyed  # others may have commanded
            accepted, count = self._obeyed.accepted, _count(self._obeyed)
            self._commands.put(Twist.planar(x, y, turn))
            self._wait(partial(self._is_read, count), "the robot to read its command")
            if self._obeyed.accepted > accepted:
                return
            if _count(self._obeyed) > count:
                refusal = self._obeyed.last_refusal.removeprefix(f"{self.bus.source}: ")
        raise AssertionError(f"the command was refused: {refusal}")

    def _wait(self, condition: Callable[[], T], what: str) -> T:
        """As `wait_for`; AssertionError with what the sim wrote once it has ended."""

        def look() -> T:
            if self.process.returncode is not None:
                raise AssertionError(
                    f"{self.process}; it wrote:\n{self.process.out}{self.process.err}"
                )
            return condition()

        return wait_for(look, PATIENCE, what)

    def _call(self, key: str, request: "Message", reply: "type[Message]") -> None:
        """Call the sim. AssertionError as `_wait` if it has ended before."""
        self._wait(lambda: True, "the sim")
        self.bus.call(key, request, reply, PATIENCE)

    def _is_read(self, before: int) -> bool:
        """Whether the newest command status counts other than `before` commands: more, or those of
        a new robot.
        """
        self._obeyed = _newest(self._statuses) or self._obeyed
        return _count(self._obeyed) != before

    def _read(self, wanted: "Callable[[SimulationStatus], bool]") -> "Odometry":
        """Wait for a status that is `wanted`, and for the odom of its time."""
        from holozen.messages import Time

        def is_wanted() -> bool:
            if new := _newest(self._times):
                self.status = new
            return bool(new) and wanted(new)

        def is_published() -> bool:
            if new := _newest(self._odoms):
                self.odom = new
            return bool(new) and new.header.stamp == Time.of(self.status.time)

        self._wait(is_wanted, "the sim's status")
        self._wait(is_published, "odom")
        return self.odom


def _count(status: "CommandStatus") -> int:
    """The number of commands that the robot has read."""
    return status.accepted + sum(status.refused.values())


def _newest(subscription: "Subscription[Any]") -> Any:
    """The newest message that waits, or None."""
    messages = [
        received.message for received in iter(subscription.try_recv, None) if received.message
    ]
    return messages[-1] if messages else None
