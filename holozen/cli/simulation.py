"""`holozen sim pause`, `play`, `step` and `reset`: the time of the sims that run."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from holozen.cli.verb import Verb, by_name, no_arguments, open_bus
from holozen.console import report
from holozen.flags import count, number
from holozen.process import deferred_interrupt

if TYPE_CHECKING:
    from holozen.transport.bus import Bus

SCOPES = {"all": 0, "time": 1, "state": 2, "spawned": 4}


def pause(args: argparse.Namespace) -> int:
    """Pause all sims."""
    return _control(args, lambda sims, bus: sims.set_playing(bus, False), {"state": "paused"}, "paused")


def play(args: argparse.Namespace) -> int:
    """Play all sims."""
    return _control(args, lambda sims, bus: sims.set_playing(bus, True), {"state": "playing"}, "playing")


def step(args: argparse.Namespace) -> int:
    """Let all sims make steps."""
    done = f"made {args.steps} step{'s'[: args.steps != 1]}"
    return _control(args, lambda sims, bus: sims.step(bus, args.steps, args.timeout), {"steps": args.steps}, done)


def reset(args: argparse.Namespace) -> int:
    """Reset all sims."""
    names = sorted(set(args.scope or ["all"]))
    scope = 0 if "all" in names else sum(SCOPES[name] for name in names)
    return _control(args, lambda sims, bus: sims.reset(bus, scope), {"scope": names}, f"reset: {', '.join(names)}")


def _control(args: argparse.Namespace, act: Callable[[Any, Bus], list[str]], row: dict[str, Any], done: str) -> int:
    """Do something to all sims, and print their warnings and what was done."""
    with open_bus(args) as bus:
        with deferred_interrupt():
            from holozen import entities
        warnings = act(entities, bus)
    for warning in warnings:
        report(f"holozen {args.verb}: {warning}")
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
    Verb("sim pause", "Pause the sim: nothing moves, odom goes on.", "", no_arguments, pause),
    Verb("sim play", "Let a paused sim go on; robots wait for a new command.", "", no_arguments, play),
    Verb("sim step", "Let a paused sim make steps, as fast as it can.", "240", _step_arguments, step),
    Verb("sim reset", "Put the sim back to its start; robots wait for a new command.", "--scope time", _reset_arguments,
        reset),
)  # fmt: skip
