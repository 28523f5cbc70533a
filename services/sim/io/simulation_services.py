"""The services and the action of simulation_interfaces that play, pause, step and reset the
simulation.
"""

import time
from collections.abc import Callable
from functools import partial
from typing import Any

from holozen.bus import Bus
from holozen.console import report
from holozen.messages import simulation_interfaces as si
from holozen.messages.codec import CodecError
from holozen.messages.simulation_interfaces import SimulationState as State
from holozen.transport.actions import ActionServer, Goal
from holozen.transport.actions import State as GoalState
from holozen.transport.errors import ServiceError
from holozen.transport.services import answer_in_turn, refuse

from ..errors import EntityError
from ..simulation import NAMES, Simulation

_OK = si.Result(si.Result.OK)
FEEDBACK_EVERY = 0.1  # s
OUTDATED = (
    "this play may have been sent before the sim was last paused, so it is void; send it again"
)


class SimulationServices:
    """Answers requests about the time of the world. `end` ends the sim."""

    def __init__(self, bus: Bus, simulation: Simulation, end: Callable[[], None]) -> None:
        self._simulation, self._end = simulation, end
        self._steps = bus.serve(
            "step_simulation", si.StepSimulationRequest, si.StepSimulationReply, _not_now
        )
        self._setter = bus.serve(
            "set_simulation_state",
            si.SetSimulationStateRequest,
            si.SetSimulationStateReply,
            self.set_state,
        )
        self._servers = [
            bus.serve(
                "get_simulation_state",
                si.GetSimulationStateRequest,
                si.GetSimulationStateReply,
                self.state,
            ),
            self._setter,
            bus.serve(
                "reset_simulation", si.ResetSimulationRequest, si.ResetSimulationReply, self.reset
            ),
        ]
        self._action = ActionServer(
            bus, "simulate_steps", si.SimulateSteps, lambda _: "", self._begin
        )
        self._goal: Goal | None = None  # of the steps that are being made
        self._feedback_due = time.monotonic()  # s
        self._paused_at: float | None = None  # s; the last request to pause or stop

    def answer(self) -> bool:
        """Answer waiting requests for a short time. Returns whether it answered or began any."""
        begun = False
        while not self._simulation.steps and (query := self._steps.try_recv()) is not None:
            self._step(query)
            begun = True
        if self._goal and self._goal.state is GoalState.CANCELING:
            self._simulation.end_steps("the goal was cancelled")
        if self._goal and time.monotonic() >= self._feedback_due:
            self._report_progress(self._goal)
        return begun | self._action.answer() | answer_in_turn(self._servers)

    def state(self, _request: si.GetSimulationStateRequest) -> si.GetSimulationStateReply:
        """The state of the sim."""
        return si.GetSimulationStateReply(State(self._simulation.state), _OK)

    def set_state(self, request: si.SetSimulationStateRequest) -> si.SetSimulationStateReply:
        """Change the state of the sim."""
        wanted, now = request.state.state, time.monotonic()
        if wanted in (State.STATE_STOPPED, State.STATE_PAUSED):
            self._paused_at = now
        elif wanted == State.STATE_PLAYING and self._simulation.is_paused:
            self._setter.require_sent_after(self._paused_at, OUTDATED)
        if wanted == State.STATE_QUITTING:
            self._end()
        elif wanted not in NAMES:
            problem = f"state {wanted}: use 0 (stopped), 1 (playing), 2 (paused) or 3 (quitting)"
            raise EntityError(si.Result.FEATURE_UNSUPPORTED, problem)
        elif wanted == self._simulation.state and not self._simulation.steps:
            problem = f"the sim is {NAMES[wanted]} already"
            return si.SetSimulationStateReply(
                si.Result(si.SetSimulationStateReply.ALREADY_IN_TARGET_STATE, problem)
            )
        else:
            {
                State.STATE_STOPPED: self._simulation.stop,
                State.STATE_PLAYING: self._simulation.play,
                State.STATE_PAUSED: self._simulation.pause,
            }[wanted](now)
        done = f"set to {NAMES[wanted]}" if wanted in NAMES else "ended"
        report(f"sim: {done} by {self._setter.caller or 'an unknown caller'}")
        return si.SetSimulationStateReply(_OK)

    def reset(self, request: si.ResetSimulationRequest) -> si.ResetSimulationReply:
        """Reset the sim."""
        self._simulation.reset(request.scope, time.monotonic())
        return si.ResetSimulationReply(_OK)

    def _step(self, query: Any) -> None:
        """Begin the steps of a request. It is answered after the last one."""
        if not self._steps.is_addressed(query):
            query.drop()
            return
        try:
            self._simulation.step(self._steps.read(query).steps, partial(self._stepped, query))
        except (ServiceError, CodecError) as error:
            with query:
                refuse(query, str(error), getattr(error, "fields", {}))

    def _begin(self, _server: ActionServer, goal: Goal) -> None:
        """Begin the steps of a goal."""
        try:
            if self._simulation.steps:
                raise EntityError(si.Result.INCORRECT_STATE, "other steps are being made")
            self._simulation.step(goal.request.steps, partial(self._ended, goal))
        except EntityError as error:
            self._action.finish(
                goal, GoalState.ABORTED, si.SimulateStepsResult(si.Result(error.code, str(error)))
            )
            return
        self._goal = goal
        self._action.move(goal, GoalState.EXECUTING)

    def _report_progress(self, goal: Goal) -> None:
        left = self._simulation.steps.left if self._simulation.steps else 0
        self._action.feedback(goal, si.SimulateStepsFeedback(goal.request.steps - left, left))
        self._feedback_due = time.monotonic() + FEEDBACK_EVERY

    def _ended(self, goal: Goal, reason: str) -> None:
        self._goal = None
        if not reason:
            self._report_progress(goal)
            self._action.finish(goal, GoalState.SUCCEEDED, si.SimulateStepsResult(_OK))
            return
        state = GoalState.CANCELED if goal.state is GoalState.CANCELING else GoalState.ABORTED
        self._action.finish(
            goal, state, si.SimulateStepsResult(si.Result(si.Result.OPERATION_FAILED, reason))
        )

    def _stepped(self, query: Any, reason: str) -> None:
        with query:
            if reason:
                failed = EntityError(si.Result.OPERATION_FAILED, reason)
                refuse(query, str(failed), failed.fields)
            else:
                self._steps.reply(query, si.StepSimulationReply(_OK))


def _not_now(_request: si.StepSimulationRequest) -> si.StepSimulationReply:
    raise AssertionError("step_simulation is answered after its steps")
