"""`holozen delete`: take robots or objects out of the running sim."""

import argparse
import json

from holozen import connection
from holozen.bus import Bus
from holozen.errors import ServiceError
from holozen.flags import Parser
from holozen.tell import say


def parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="holozen delete",
        description="Take robots or objects out of the sim.",
        epilog="example: holozen delete Fred",
    )
    parser.add_argument("names", nargs="+", type=_name, metavar="NAME", help="as `holozen list` shows them")
    parser.add_argument("--json", action="store_true", help="one JSON object a line")
    connection.add_arguments(parser)
    return parser


def main(argv: list[str]) -> int:
    args = parser().parse_args(argv)
    from holozen import entities

    failed = 0
    with Bus("delete", connection.from_arguments(args), patience=3.0) as bus:
        entities.names(bus)  # without a sim this says so, once
        for name in args.names:
            reason = ""
            try:
                entities.delete(bus, name)
            except ServiceError as error:
                say(f"holozen delete: {error}")
                failed, reason = 1, str(error)
            if args.json:
                print(json.dumps({"name": name, "deleted": not reason, "reason": reason}))
            elif not reason:
                print(f"{name} is deleted")
    return failed


def _name(text: str) -> str:
    from holozen.wire import robot_name

    try:
        return robot_name(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
