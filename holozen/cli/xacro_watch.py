"""`holozen xacro --watch`: expand on every save, and put the robot anew into a running sim."""

import argparse
import contextlib
import json
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from holozen import connection
from holozen.cli.xacro import write
from holozen.errors import BusError
from holozen.process import stop_event
from holozen.robot.errors import RobotError
from holozen.robot.xacro import process
from holozen.robot.xacro.inputs import SAVED, Inputs, Outcome, now, unchanged
from holozen.tell import say

if TYPE_CHECKING:
    from holozen.bus import Bus

LOOK = 0.2  # s
SETTLED = 0.05  # s without a change: an editor may empty a file before it fills it


def watch(args: argparse.Namespace, values: Mapping[str, str], packages: Mapping[str, Path]) -> int:
    """Expand until told to stop. Tells it each time; what is wrong is mended by the next save."""
    stop = stop_event()
    with contextlib.ExitStack() as ends:
        bus = None
        if args.name is not None or not args.output:
            from holozen.bus import Bus

            bus = ends.enter_context(Bus("xacro", connection.from_arguments(args), lasting=True, stop=stop))
        inputs: Inputs = {"file": {str(args.file): None}}
        while not stop.is_set():
            before = now(inputs, args.file, packages)  # what is saved from here on is seen
            outcome = _expanded(args.file, values, packages)
            _tell(args, *((outcome.error, False) if outcome.error else _used(args, outcome, values, packages, bus)))
            inputs = outcome.inputs or before
            inputs["file"].setdefault(str(args.file), before["file"].get(str(args.file)))
            _wait_for_save(inputs, args.file, packages, stop)
    return 0


def _expanded(path: Path, values: Mapping[str, str], packages: Mapping[str, Path]) -> Outcome:
    try:
        return process(path, values, packages)
    except RobotError as error:
        return Outcome(error=str(error))


def _used(
    args: argparse.Namespace,
    outcome: Outcome,
    values: Mapping[str, str],
    packages: Mapping[str, Path],
    bus: "Bus | None",
) -> tuple[str, bool]:
    """What became of a save, and whether all of it was done."""
    told = f"{args.file} expanded"
    try:
        if args.output:
            write(args.output, outcome.text)
            told += f", {args.output} written"
        if bus:
            from holozen.cli.spawn import spawn_file

            name, drive = args.name or "", args.drive
            told += f", {spawn_file(bus, args.file, name, None, True, values, packages, drive)}"
    except (RobotError, BusError) as error:
        return f"{told}, but {error}", False
    return told, True


def _tell(args: argparse.Namespace, text: str, done: bool) -> None:
    if args.json:
        print(json.dumps({"file": str(args.file), "done": done, "text": text}), flush=True)
    else:
        say(f"holozen xacro: {text}")


def _wait_for_save(inputs: Inputs, path: Path, packages: Mapping[str, Path], stop: threading.Event) -> None:
    saved = {kind: answers for kind, answers in inputs.items() if kind in SAVED}
    while unchanged(saved, path, packages) and not stop.wait(LOOK):
        pass
    while (latest := now(saved, path, packages)) != saved and not stop.wait(SETTLED):
        saved = latest
