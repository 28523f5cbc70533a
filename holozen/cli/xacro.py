"""`holozen xacro`: expand a xacro file, without ROS."""

import argparse
import sys
from pathlib import Path

from holozen import flags
from holozen.robot.errors import RobotError
from holozen.robot.xacro import expand
from holozen.tell import say


def parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="holozen xacro", description="Expand a xacro file to URDF.")
    parser.add_argument("file", type=Path)
    parser.add_argument("args", nargs="*", metavar="name:=value", help="values of its xacro:arg")
    parser.add_argument("-o", "--output", type=Path, metavar="OUT", help="write there instead of to standard output")
    parser.add_argument("--package", type=flags.package, action="append", default=[], metavar="NAME=DIR")
    return parser


def main(argv: list[str]) -> int:
    args = parser().parse_args(argv)
    try:
        text = expand(args.file, dict(map(_pair, args.args)), dict(args.package))
        if args.output:
            args.output.write_text(text)
    except (RobotError, OSError) as error:
        say(f"holozen xacro: {error}")
        return 1
    if not args.output:
        sys.stdout.write(text)
    return 0


def _pair(text: str) -> tuple[str, str]:
    name, assign, value = text.partition(":=")
    if not assign or not name:
        raise RobotError(f"{text!r}: write name:=value")
    return name, value
