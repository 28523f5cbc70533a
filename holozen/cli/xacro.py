"""`holozen xacro`: expands a xacro file, without ROS; with --watch again on every save."""

import argparse
import contextlib
import json
import os
import sys
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from holozen import flags
from holozen.cli.verb import Verb, by_name
from holozen.console import report
from holozen.process import stop_event
from holozen.robot.errors import RobotError
from holozen.robot.xacro import SAVED, Inputs, Outcome, XacroFile, current, expand_xacro, process
from holozen.transport import connection
from holozen.transport.errors import BusError

if TYPE_CHECKING:
    from holozen.bus import Bus

LOOK = 0.2  # s
SETTLED = 0.05  # s without a change: an editor may truncate a file before writing it


def run(args: argparse.Namespace) -> int:
    """Expand a file, once or on every save."""
    _check(args)
    args.args, args.package = dict(args.args), dict(args.package)
    if args.watch:
        return watch(args)
    _output(args, expand_xacro(args.file, args.args, args.package, args.allow_env))
    return 0


def _output(args: argparse.Namespace, text: str) -> None:
    row = {"file": str(args.file)}
    if args.output:
        write(args.output, text)
        row["output"] = str(args.output)
    else:
        row["urdf"] = text
    if args.json:
        _print(json.dumps(row) + "\n")
    elif not args.output:
        _print(text)


def write(out: Path, text: str) -> None:
    """Write the text to a file. Raises RobotError."""
    try:
        out.write_bytes(_encoded(text))
    except OSError as error:
        raise RobotError(f"cannot write {out}: {error.strerror}") from None


def _print(text: str) -> None:
    if sys.__stdout__ is None:
        raise RobotError("there is no standard output; write to a file with -o OUT")
    try:
        sys.stdout.buffer.write(_encoded(text))
        sys.stdout.buffer.flush()
    except BrokenPipeError:
        raise  # a reader such as head is done
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or Python would write the rest again at exit
        raise RobotError(f"cannot write to standard output: {error.strerror}") from None


def _encoded(text: str) -> bytes:
    # Bytes of the environment that are not UTF-8 are written unchanged.
    return text.encode("utf-8", "surrogateescape")


def _check(args: argparse.Namespace) -> None:
    if not args.watch and (args.name is not None or args.drive or args.x is not None or args.y is not None):
        raise RobotError("--name, --drive, -x and -y are for --watch; `holozen spawn FILE` spawns once")
    if args.output and args.output.exists() and args.file.exists() and args.output.samefile(args.file):
        raise RobotError(f"-o {args.output} is the file that is expanded; write to another one")


def watch(args: argparse.Namespace) -> int:
    """Expand on every save, also after one with an error, and report each result, until stopped."""
    stop = stop_event()
    with contextlib.ExitStack() as ends:
        bus = None
        if args.name is not None or not args.output:
            from holozen.bus import Bus
            from holozen.robot import loading, reader

            reader.start(loading)
            bus = ends.enter_context(Bus("xacro", connection.from_arguments(args), lasting=True, stop=stop))
        inputs: Inputs = {"file": {str(args.file): None}}
        while not stop.is_set():
            before = current(inputs, args.file, args.package)  # taken first, so that a save during the expansion counts
            outcome = _expanded(args)
            _report(args, *((outcome.error, False) if outcome.error else _apply(args, outcome, bus)))
            inputs = outcome.inputs or before
            inputs["file"].setdefault(str(args.file), before["file"].get(str(args.file)))
            _wait_for_save(inputs, args.file, args.package, stop)
    return 0


def _expanded(args: argparse.Namespace) -> Outcome:
    try:
        return process(XacroFile(args.file, args.args, args.package, args.allow_env))
    except RobotError as error:
        return Outcome(error=str(error))


def _apply(args: argparse.Namespace, outcome: Outcome, bus: "Bus | None") -> tuple[str, bool]:
    """Write and spawn an expanded text; returns what was done as text, and whether all of it succeeded."""
    text = f"{args.file} expanded"
    for warning in outcome.warnings if not bus else ():  # with a bus the robot is read again, and its warnings shown
        report(f"warning: {warning}")
    try:
        if args.output:
            write(args.output, outcome.text)
            text += f", {args.output} written"
        if bus:
            from holozen.cli.spawn import Place, put, read

            robot = read(args.file, args.name or "", args.args, args.package, args.drive, allow_env=args.allow_env)
            text += f", {put(bus, robot, Place(args.x, args.y), replace=True)}"
            args.x = args.y = None  # later ones replace it where it stands
    except (RobotError, BusError) as error:
        return f"{text}, but {error}", False
    return text, True


def _report(args: argparse.Namespace, text: str, done: bool) -> None:
    if args.json:
        print(json.dumps({"file": str(args.file), "done": done, "text": text}), flush=True)
    else:
        report(f"holozen xacro: {text}")


def _wait_for_save(inputs: Inputs, path: Path, packages: Mapping[str, Path], stop: threading.Event) -> None:
    saved = {kind: answers for kind, answers in inputs.items() if kind in SAVED}
    while current(saved, path, packages) == saved and not stop.wait(LOOK):
        pass
    while (latest := current(saved, path, packages)) != saved and not stop.wait(SETTLED):
        saved = latest


def _arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("file", type=Path, help="the xacro file")
    add("args", type=flags.pair, nargs="*", default=[], metavar="name:=value", help="values of its xacro:arg")
    add("-o", "--output", type=Path, metavar="OUT", help="write there instead of to standard output")
    flags.add_robot_sources(parser)
    watch = parser.add_argument_group("watch", "Expand again on every save, and respawn the robot in a running sim.")
    watch.add_argument("--watch", action="store_true", help="until Ctrl-C; with -o, only OUT is written unless --name")
    watch.add_argument("--name", type=flags.robot, metavar="NAME", help="the robot's name (default: as in the file)")
    watch.add_argument("--drive", choices=flags.DRIVES, default="", help=flags.DRIVE)
    for axis in "xy":
        watch.add_argument(f"-{axis}", type=flags.number(-1000, 1000, "m"), metavar="m",
            help="position at its first spawn; later it stays where it is")  # fmt: skip


VERBS = by_name(
    Verb("xacro", "expand a xacro file to URDF", "my_bot.urdf.xacro -o my_bot.urdf", _arguments, run,
        "print the URDF, or with --watch the result of each save, as JSON, one object per line"),
)  # fmt: skip
