"""`holozen check`: find errors in a robot file."""

import argparse
import json
import re

from holozen import flags
from holozen.cli.verb import Verb, by_name
from holozen.console import printable

NOTES = """Without an error the last line summarizes the file. The exit code is 1 if there is an error, 0 if
there are no findings or only warnings, 2 for wrong usage. The lines of the --require file are `link NAME` or
`joint NAME [TYPE]`; # starts a comment. """


def run(args: argparse.Namespace) -> int:
    """Print what is wrong with a file; exit code 1 if there is an error."""
    from holozen.check.engine import Requirements
    from holozen.check.report import check

    requirements = Requirements(args.fits, args.require)
    findings, summary = check(args.file, dict(args.args), dict(args.package), requirements, args.allow_env)
    for finding in findings:
        text = json.dumps(finding.fields()) if args.json else "\n".join(map(printable, str(finding).split("\n")))
        print(text)
    failed = any(finding.severity == "error" for finding in findings)
    if not failed and not args.json:
        print(printable(f"ok: {summary}"))
    return int(failed)


def _size(text: str) -> tuple[float, ...]:
    words = re.split(r"[xX]", text)
    try:
        values = tuple(float(word) for word in words)
    except ValueError:
        values = ()
    if len(values) not in (2, 3) or not all(0 < value < 1e3 for value in values):
        raise argparse.ArgumentTypeError(f"{text!r}: write metres as 0.4x0.2 or 0.4x0.2x0.3 (length, width, height)")
    return values


def _arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("file", type=flags.path, help="a xacro, URDF or SDF file")
    add("args", type=flags.pair, nargs="*", default=[], metavar="name:=value", help="values of its xacro:arg")
    flags.add_robot_sources(parser)
    add("--fits", type=_size, default=(), metavar="LxW[xH]", help="most metres along x, y, z: 0.4x0.2")
    add("--require", type=flags.path, metavar="FILE", help="links and joints that the robot must have")


VERBS = by_name(
    Verb("check", "Report what is wrong with a xacro, URDF or SDF robot.", "my_bot.urdf.xacro", _arguments, run,
        "print one JSON object a finding", NOTES, bus=False),
)  # fmt: skip
