"""`holozen xacro`: expand a xacro file, without ROS."""

import argparse
import json
import os
import sys
from pathlib import Path

from holozen import connection, flags
from holozen.robot.errors import RobotError
from holozen.robot.xacro import expand_xacro
from holozen.tell import say


def parser() -> argparse.ArgumentParser:
    parser = flags.Parser(
        prog="holozen xacro",
        description="Expand a xacro file to URDF.",
        epilog="example: holozen xacro my_bot.urdf.xacro -o my_bot.urdf",
    )
    parser.add_argument("file", type=Path, help="the xacro file")
    parser.add_argument("args", nargs="*", default=[], metavar="name:=value", help="values of its xacro:arg")
    parser.add_argument("-o", "--output", type=Path, metavar="OUT", help="write there instead of to standard output")
    parser.add_argument("--package", type=flags.package, action="append", default=[], metavar="NAME=DIR",
        help="the folder of package NAME, for $(find NAME)")  # fmt: skip
    told = "one JSON object a line: the URDF, or with --watch what became of each save"
    parser.add_argument("--json", action="store_true", help=told)
    watch = parser.add_argument_group("watch", "Expand again on every save, and put the robot anew into a running sim.")
    watch.add_argument("--watch", action="store_true", help="until Ctrl-C; with -o, only OUT is written unless --name")
    watch.add_argument("--name", type=flags.robot, metavar="NAME", help="the robot's name (default: as in the file)")
    watch.add_argument("--drive", choices=("planar_move",), default="", help="how to move one whose file has no drive")
    connection.add_arguments(parser)
    return parser


def main(argv: list[str]) -> int:
    args = parser().parse_intermixed_args(argv)
    try:
        _check(args)
        given = dict(map(_pair, args.args)), dict(args.package)
        if args.watch:
            from holozen.cli.xacro_watch import watch

            return watch(args, *given)
        _give(args, expand_xacro(args.file, *given))
    except RobotError as error:
        say(f"holozen xacro: {error}")
        return 1
    return 0


def _give(args: argparse.Namespace, text: str) -> None:
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
    if sys.stdout is None:
        raise RobotError("there is no standard output; write to a file with -o OUT")
    try:
        sys.stdout.buffer.write(_encoded(text))
        sys.stdout.buffer.flush()
    except BrokenPipeError:
        raise  # the reader has seen enough
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what is left would be tried again
        raise RobotError(f"cannot write to standard output: {error.strerror}") from None


def _encoded(text: str) -> bytes:
    # Bytes of the environment that were no UTF-8 come out as they were.
    return text.encode("utf-8", "surrogateescape")


def _check(args: argparse.Namespace) -> None:
    if not args.watch and (args.name is not None or args.drive):
        raise RobotError("--name and --drive are for --watch; `holozen spawn FILE` spawns once")
    if args.output and args.output.exists() and args.file.exists() and args.output.samefile(args.file):
        raise RobotError(f"-o {args.output} is the file that is expanded; write to another one")


def _pair(text: str) -> tuple[str, str]:
    name, assign, value = (part.strip() for part in text.partition(":="))
    if not assign or not name:
        raise RobotError(f"{text!r}: write name:=value")
    return name, value
