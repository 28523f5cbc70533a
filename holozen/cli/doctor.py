"""`holozen doctor`: what may be wrong here, and how to mend it."""

import argparse
import json

from holozen import connection
from holozen.flags import Parser
from holozen.tell import printable


def parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="holozen doctor",
        description="Check this machine and what runs, and say how to mend what is wrong. It changes nothing.",
        epilog="exit code: 0 all well, 1 something is wrong (not by warnings). example: holozen doctor --json",
    )
    parser.add_argument("--json", action="store_true", help="one JSON object a line")
    connection.add_arguments(parser)
    return parser


def main(argv: list[str]) -> int:
    args = parser().parse_args(argv)
    from holozen.doctor.finding import first_error
    from holozen.doctor.rounds import look

    findings = []
    for finding in look(connection.from_arguments(args)):
        findings.append(finding)
        print(json.dumps(finding._asdict()) if args.json else printable(str(finding)), flush=True)
    return first_error(findings)
