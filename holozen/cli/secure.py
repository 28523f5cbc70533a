"""`holozen secure`: init, add, revoke, show the certificates of the secure set-up."""

import argparse
import json
from pathlib import Path

from holozen.console import printable, report
from holozen.flags import Parser, refused
from holozen.transport.connection import secure_folder
from holozen.transport.roles import ROLES, ROUTER

DAYS = 365


def parser() -> argparse.ArgumentParser:
    parser = Parser(prog="holozen secure", description="Make and revoke the certificates of a network's members.")
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB", prog=parser.prog)

    def verb(name: str, text: str, example: str) -> argparse.ArgumentParser:
        made = verbs.add_parser(name, help=text, description=text, epilog=f"example: holozen secure {name} {example}")
        made.add_argument("--secure", metavar="DIR", type=Path,
            help="the folder of the authority (default: HOLOZEN_SECURE, or ~/.config/holozen/secure)")  # fmt: skip
        made.add_argument("--json", action="store_true", help="one JSON object per line")
        return made

    init = verb("init", "make an authority, a router and a member of each role", "--host robot.local")
    init.add_argument("--host", action="append", default=[], help="where others reach the router, besides loopback")
    init.add_argument("--days", type=_days, default=DAYS, help=f"until the certificates expire (default: {DAYS})")
    add = verb("add", "add a member", "operator Ann")
    add.add_argument("role", choices=ROLES)
    add.add_argument("name")
    add.add_argument("--days", type=_days, default=DAYS, help=f"until the certificate expires (default: {DAYS})")
    verb("revoke", "remove a member; the router starts anew without it", "Ann").add_argument("name")
    verb("show", "list the members, their roles and when their certificates expire", "")
    return parser


def main(argv: list[str]) -> int:
    args = parser().parse_args(argv)
    from holozen import authority  # loads cryptography

    root: Path = args.secure or Path(secure_folder())
    try:
        if args.verb == "init":
            authority.initialize(root, args.host, args.days)
        elif args.verb == "add":
            authority.add(root, args.role, args.name, args.days)
        elif args.verb == "revoke":
            authority.revoke(root, args.name)
        table = authority.members(root)["members"]
    except authority.AuthorityError as error:
        report(f"holozen secure {args.verb}: {error}")
        return 1
    except OSError as error:
        report(f"holozen secure {args.verb}: {error.filename}: {error.strerror}")
        return 1
    if args.json:
        for name, row in table.items():
            print(json.dumps({"name": name, "role": row["role"], "expires": row["expires"]}))
    elif args.verb == "show":
        for name, row in table.items():
            print(printable(f"{name:<16} {row['role']:<10} until {row['expires'][:10]}"))
    else:
        print(_done(args, root))
    return 0


def _done(args: argparse.Namespace, root: Path) -> str:
    if args.verb == "init":
        return f"{root}: {ROUTER}, {', '.join(ROLES)}; run `holozen router --secure {root}`, and other verbs like that"
    if args.verb == "add":
        return f"{root / args.name}: copy it to where {args.name} works, and keep it secret"
    return f"{args.name} is revoked; if router or sim run elsewhere, copy their new members.json from {root} there"


def _days(text: str) -> int:
    if not text.isdecimal() or not 0 < int(text) <= 3650:
        raise refused(f"{text!r}: use a whole number of days from 1 to 3650")
    return int(text)
