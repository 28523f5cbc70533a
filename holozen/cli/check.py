"""`holozen check`: find errors in a robot file."""

import argparse
import json
import re
from pathlib import Path

from holozen import flags
from holozen.console import printable

AFTER = """Without an error the last line summarizes the file. The exit code is 1 if there is an error, 0 if
there are no findings or only warnings, 2 for wrong usage. The lines of the --require file are `link NAME` or
`joint NAME [TYPE]`; # starts a comment. example: holozen check my_bot.urdf.xacro"""


def parser() -> argparse.ArgumentParser:
    parser = flags.Parser(
        prog="holozen check", description="Report what is wrong with a xacro, URDF or SDF robot.", epilog=AFTER
    )
    parser.add_argument("file", type=Path, help="a xacro, URDF or SDF file")
    parser.add_argument(
        "args", type=_pair, nargs="*", default=[], metavar="name:=value", help="values of its xacro:arg"
    )
    parser.add_argument("--package", type=flags.package, action="append", default=[], metavar="NAME=DIR")
    parser.add_argument("--allow-env", type=flags.variable, action="append", default=[], metavar="NAME",
        help="let the file read this environment variable, as $(env NAME)")  # fmt: skip
    parser.add_argument("--fits", type=_size, default=(), metavar="LxW[xH]", help="most metres along x, y, z: 0.4x0.2")
    parser.add_argument("--require", type=Path, metavar="FILE", help="links and joints that the robot must have")
    parser.add_argument("--json", action="store_true", help="print one JSON object a finding")
    return parser


def main(argv: list[str]) -> int:
    args = parser().parse_args(argv)
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


def _pair(text: str) -> tuple[str, str]:
    name, assign, value = text.partition(":=")
    if not assign or not name:
        raise argparse.ArgumentTypeError(f"{text!r}: write name:=value")
    return name, value


def _size(text: str) -> tuple[float, ...]:
    words = re.split(r"[xX]", text)
    try:
        values = tuple(float(word) for word in words)
    except ValueError:
        values = ()
    if len(values) not in (2, 3) or not all(0 < value < 1e3 for value in values):
        raise argparse.ArgumentTypeError(f"{text!r}: write metres as 0.4x0.2 or 0.4x0.2x0.3 (length, width, height)")
    return values
