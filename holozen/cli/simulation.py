"""`holozen sim pause`, `play`, `step` and `reset`: control the running sims."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from holozen.cli.verb import Verb, argument, by_name, no_arguments, open_bus
from holozen.console import Failure, report
from holozen.flags import count, number
from holozen.process import INTERRUPTED, deferred_interrupt, stop_event

if TYPE_CHECKING:
    from holozen.transport.bus import Bus

SCOPES = {"all": 0, "time": 1, "state": 2, "spawned": 4}


def pause(args: argparse.Namespace) -> int:
    """Pause all sims."""
    return _control(
        args, lambda sims, bus: sims.set_playing(bus, False), {"state": "paused"}, "paused"
    )


def play(args: argparse.Namespace) -> int:
    """Play all sims."""
    return _control(
        args, lambda sims, bus: sims.set_playing(bus, True), {"state": "playing"}, "playing"
    )


def step(args: argparse.Namespace) -> int:
    """Advance all sims by a number of steps, which end with Ctrl-C and with --timeout."""
    stop = stop_event()
    with open_bus(args, stop) as bus:
        from holozen import entities

        early = entities.step_until(bus, args.steps, args.timeout, stop)
    if early and stop.is_set():
        report(f"holozen {args.verb}: interrupted: {early}")
        return INTERRUPTED
    if early:
        raise Failure(
            f"not done within {args.timeout:g} s, and ended: {early}; --timeout gives them longer"
        )
    print(
        json.dumps({"steps": args.steps})
        if args.json
        else f"made {args.steps} step{'s'[: args.steps != 1]}"
    )
    return 0


def reset(args: argparse.Namespace) -> int:
    """Reset all sims."""
    names = sorted(set(args.scope or ["all"]))
    scope = 0 if "all" in names else sum(SCOPES[name] for name in names)
    return _control(
        args,
        lambda sims, bus: sims.reset(bus, scope),
        {"scope": names},
        f"reset: {', '.join(names)}",
    )


def _control(
    args: argparse.Namespace, act: Callable[[Any, Bus], list[str]], row: dict[str, Any], done: str
) -> int:
    """Do something to all sims, then print their warnings and what was done."""
    with open_bus(args) as bus:
        with deferred_interrupt():
            from holozen import entities
        warnings = act(entities, bus)
    for warning in warnings:
        report(f"holozen {args.verb}: {warning}")
    print(json.dumps(row) if args.json else done)
    return 0


def _step_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "steps", nargs="?", type=count(1), default=1, metavar="N", help="how many (default: 1)"
    )
    parser.add_argument(
        "--timeout",
        type=number(0.1, 1e6, "s"),
        default=60.0,
        metavar="S",
        help="seconds after which the steps are ended (default: 60)",
    )


SCOPE = "time to 0, entities to their places, or without those that were spawned (default: all)"
VERBS = by_name(
    Verb("sim pause", "pause the sim: nothing moves, odom goes on", "", no_arguments, pause),
    Verb(
        "sim play", "let a paused sim go on; robots wait for a new command", "", no_arguments, play
    ),
    Verb(
        "sim step",
        "let a paused sim make steps, as fast as it can; Ctrl-C ends them",
        "240",
        _step_arguments,
        step,
    ),
    Verb(
        "sim reset",
        "put the sim back to its start; robots wait for a new command",
        "--scope time",
        argument("--scope", action="append", choices=SCOPES, help=SCOPE),
        reset,
    ),
)
