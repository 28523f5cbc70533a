"""`holozen sim pause`, `play`, `step` and `reset`: the time of the sims that run."""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING, Any

from holozen.cli.verb import Verb, by_name, no_arguments, open_bus
from holozen.console import report
from holozen.flags import count, number
from holozen.process import deferred_interrupt

if TYPE_CHECKING:
    from holozen.messages import Message

SCOPES = {"all": 0, "time": 1, "state": 2, "spawned": 4}
STATES = {"pause": (2, "paused"), "play": (1, "playing")}


def set_state(args: argparse.Namespace) -> int:
    """Pause or play all sims."""
    from holozen.messages import simulation_interfaces as si

    state, word = STATES[args.verb.partition(" ")[2]]
    request = si.SetSimulationStateRequest(si.SimulationState(state))
    return _all(args, "set_simulation_state", request, si.SetSimulationStateReply, 0.0, {"state": word}, word)


def step(args: argparse.Namespace) -> int:
    """Let all sims make steps."""
    from holozen.messages import simulation_interfaces as si

    request = si.StepSimulationRequest(args.steps)
    done = f"made {args.steps} step{'s'[: args.steps != 1]}"
    return _all(args, "step_simulation", request, si.StepSimulationReply, args.timeout, {"steps": args.steps}, done)


def reset(args: argparse.Namespace) -> int:
    """Reset all sims."""
    from holozen.messages import simulation_interfaces as si

    scope = sum({SCOPES[name] for name in args.scope or ()})
    names = sorted(set(args.scope or ["all"]))
    request = si.ResetSimulationRequest(0 if "all" in names else scope)
    return _all(
        args, "reset_simulation", request, si.ResetSimulationReply, 0.0, {"scope": names}, f"reset: {', '.join(names)}"
    )


def _all(
    args: argparse.Namespace, key: str, request: Message, reply: type[Any], more: float, row: dict[str, Any], done: str
) -> int:
    """Ask all sims, which may take `more` seconds, and print what was done."""
    with open_bus(args) as bus:
        with deferred_interrupt():
            from holozen import entities
            from holozen.messages import simulation_interfaces as si
        entities.ask_sims(bus, "get_simulation_state", si.GetSimulationStateRequest(), si.GetSimulationStateReply)
        answers = bus.call_all(key, request, reply, entities.PATIENCE + more)
    for answer in answers:
        if answer.result.error_message:
            report(f"holozen {args.verb}: {answer.result.error_message}")
    print(json.dumps(row) if args.json else done)
    return 0


def _step_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("steps", nargs="?", type=count(1), default=1, metavar="N", help="how many (default: 1)")
    parser.add_argument("--timeout", type=number(0.1, 1e6, "s"), default=60.0, metavar="S",
        help="seconds for the steps (default: 60)")  # fmt: skip


def _reset_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--scope", action="append", choices=SCOPES,
        help="time to 0, entities to their places, or without those that were spawned (default: all)")  # fmt: skip


VERBS = by_name(
    Verb("sim pause", "Pause the sim: nothing moves, odom goes on.", "", no_arguments, set_state),
    Verb("sim play", "Let a paused sim go on; robots wait for a new command.", "", no_arguments, set_state),
    Verb("sim step", "Let a paused sim make steps, as fast as it can.", "240", _step_arguments, step),
    Verb("sim reset", "Put the sim back to its start; robots wait for a new command.", "--scope time", _reset_arguments,
        reset),
)  # fmt: skip
