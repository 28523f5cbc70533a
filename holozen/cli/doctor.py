"""`holozen doctor`: diagnose problems and suggest fixes."""

import argparse
import json

from holozen.console import printable
from holozen.flags import Parser
from holozen.transport import connection
from holozen.transport.errors import BusError


def parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="holozen doctor",
        description="Check this machine and the running nodes, and suggest fixes. Changes nothing.",
        epilog="exit code: 0 without errors, 1 with one; warnings do not count. example: holozen doctor --json",
    )
    parser.add_argument("--health", metavar="NODE",
        help="check only that this node of this machine answers: for a container, such as --health sim")  # fmt: skip
    parser.add_argument("--json", action="store_true", help="one JSON object per line")
    connection.add_arguments(parser)
    return parser


def main(argv: list[str]) -> int:
    args = parser().parse_args(argv)
    from holozen.doctor import ERROR, Finding, diagnose, health

    where = connection.from_arguments(args)
    code = 0
    try:
        findings = [health(where, args.health)] if args.health else diagnose(where, vars(args))
    except BusError as error:
        findings = [Finding("health", ERROR, str(error), "check --mode, --connect, --config and --cfg")]
    for finding in findings:
        code = max(code, int(finding.level == ERROR))
        print(json.dumps(finding._asdict()) if args.json else printable(str(finding)), flush=True)
    return code
