"""Plays, pauses, steps and resets the world."""

from collections.abc import Callable

from holozen.console import report
from holozen.messages import simulation_interfaces as si
from holozen.messages.simulation_interfaces import SimulationState as State

from .entities import Entities
from .errors import EntityError
from .physics.world import World
from .schedule import Pace

MAX_STEPS = 10_000_000  # of one request
NAMES = {
    State.STATE_STOPPED: "stopped",
    State.STATE_PLAYING: "playing",
    State.STATE_PAUSED: "paused",
}
ALL = si.ResetSimulationRequest.SCOPE_ALL
TIME, STATE, SPAWNED = (
    si.ResetSimulationRequest.SCOPE_TIME,
    si.ResetSimulationRequest.SCOPE_STATE,
    si.ResetSimulationRequest.SCOPE_SPAWNED,
)


class Steps:
    """Steps to make while the sim is paused. `done` is called at their end, with the reason if that
    is early.
    """

    def __init__(self, left: int, done: Callable[[str], None]) -> None:
        self.left, self.done = left, done
        self.may_begin = False  # whether all commands sent before the request have been read


class Simulation:
    """The state of a sim. `publish` is called on each change, so that readers know it before it is
    confirmed.
    """

    def __init__(
        self, world: World, entities: Entities, pace: Pace, publish: Callable[[], None]
    ) -> None:
        self._world, self._entities, self._pace, self._publish = world, entities, pace, publish
        self.state = State.STATE_PLAYING
        self.epoch = 0  # resets so far
        self.steps: Steps | None = None

    @property
    def is_paused(self) -> bool:
        """Whether only requested steps are made: it is paused or stopped."""
        return self.state != State.STATE_PLAYING

    def play(self, now: float) -> None:
        """Play from `now` (s) on. Earlier commands no longer count, unless the robot's watchdog is
        off.
        """
        self.end_steps("it plays")
        self.state = State.STATE_PLAYING
        self._entities.fleet.play(now)
        self._pace.set_factor(self._pace.rtf, now)
        self._publish()

    def pause(self, now: float) -> None:
        """Pause from `now` (s) on, and end requested steps."""
        self.end_steps("it was paused")
        self._pause(now, State.STATE_PAUSED)
        self._publish()

    def stop(self, now: float) -> None:
        """Pause from `now` (s) on, and reset the world."""
        self._pause(now, State.STATE_STOPPED)
        self.reset(ALL, now)

    def _pause(self, now: float, state: int) -> None:
        self.state = state
        self._entities.fleet.pause(now)

    def step(self, count: int, done: Callable[[str], None]) -> None:
        """Make `count` steps, and then call `done`. Raises EntityError."""
        if self.state != State.STATE_PAUSED:
            problem = f"the sim is {NAMES[self.state]}; pause it to step: `holozen sim pause`"
            raise EntityError(si.Result.INCORRECT_STATE, problem)
        if not 0 < count <= MAX_STEPS:
            raise EntityError(si.Result.OPERATION_FAILED, f"steps is {count}; use 1 to {MAX_STEPS}")
        self.steps = Steps(count, done)

    def stepped(self) -> None:
        """Count a step; after the last one, publish the state of everything and confirm."""
        self._entities.fleet.rules.time.step(self._world.spec.step)
        if self.steps:
            self.steps.left -= 1
            if not self.steps.left:
                self.end_steps("")

    def end_steps(self, reason: str) -> None:
        """End requested steps, if there are any; early with a `reason`."""
        steps, self.steps = self.steps, None
        if steps:
            self._publish()
            steps.done(reason and f"{reason}, {steps.left} steps before the last one")

    def reset(self, scope: int, now: float) -> None:
        """Reset what `scope` names, at `now` (s). Nothing moves until it is commanded again. Raises
        EntityError.
        """
        if scope not in (*range(8), ALL):
            problem = (
                f"scope is {scope}; use 0 or 255 (all), or a sum of 1 (time), 2 (state), 4 "
                "(spawned)"
            )
            raise EntityError(si.Result.FEATURE_UNSUPPORTED, problem)
        self.end_steps("it was reset")
        scope = scope or ALL
        if scope & SPAWNED:
            self._entities.remove_spawned()
        if scope & STATE:
            self._entities.rebuild(from_start=bool(scope & SPAWNED))
        if scope & TIME:
            self._world.rewind()
        self._entities.fleet.reset()
        self.epoch += 1
        self._pace.set_factor(self._pace.rtf, now)
        report(f"sim: it was reset; epoch {self.epoch} begins")
        self._publish()
