"""`holozen doctor`: diagnose problems and suggest fixes."""

import argparse
import json

from holozen.cli.verb import Verb, argument, by_name
from holozen.console import printable
from holozen.transport import connection
from holozen.transport.errors import BusError


def run(args: argparse.Namespace) -> int:
    """Print the findings; exit code 1 if one is an error."""
    from holozen.doctor.diagnosis import ERROR, Finding, diagnose, health

    where = connection.from_arguments(args)
    code = 0
    try:
        findings = [health(where, args.health)] if args.health else diagnose(where, vars(args))
    except BusError as error:
        findings = [
            Finding("health", ERROR, str(error), "check --mode, --connect, --config and --cfg")
        ]
    for finding in findings:
        code = max(code, int(finding.level == ERROR))
        print(json.dumps(finding._asdict()) if args.json else printable(str(finding)), flush=True)
    return code


HEALTH = "only check that this node on this machine answers, such as sim: for containers"
VERBS = by_name(
    Verb(
        "doctor",
        "check this machine and the running nodes, and suggest fixes; change nothing",
        "--json",
        argument("--health", metavar="NODE", help=HEALTH),
        run,
        notes="exit code: 0 without errors, 1 with one; warnings do not count",
    ),
)
