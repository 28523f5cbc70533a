"""`holozen xacro`: expands a xacro file, without ROS."""

import argparse
import json
import os
import sys
from pathlib import Path

from holozen import flags
from holozen.cli.verb import Verb, by_name
from holozen.robot.errors import RobotError
from holozen.robot.files.xacro import expand_xacro


def run(args: argparse.Namespace) -> int:
    """Expand a file."""
    _check(args)
    args.args, args.package = dict(args.args), dict(args.package)
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
        # or Python would write the rest again at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise RobotError(f"cannot write to standard output: {error.strerror}") from None


def _encoded(text: str) -> bytes:
    # Bytes of the environment that are not UTF-8 are written unchanged.
    return text.encode("utf-8", "surrogateescape")


def _check(args: argparse.Namespace) -> None:
    if (
        args.output
        and args.output.exists()
        and args.file.exists()
        and args.output.samefile(args.file)
    ):
        raise RobotError(f"-o {args.output} is the file that is expanded; write to another one")


def _arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("file", type=Path, help="the xacro file")
    add(
        "args",
        type=flags.pair,
        nargs="*",
        default=[],
        metavar="name:=value",
        help="values of its xacro:arg",
    )
    add(
        "-o", "--output", type=Path, metavar="OUT", help="write there instead of to standard output"
    )
    flags.add_robot_sources(parser)


VERBS = by_name(
    Verb(
        "xacro",
        "expand a xacro file to URDF",
        "my_bot.urdf.xacro -o my_bot.urdf",
        _arguments,
        run,
        "print the URDF as JSON, one object",
    ),
)
