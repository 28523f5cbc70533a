"""`holozen secure`: makes, renews, revokes and shows the certificates of the secure set-up."""

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from holozen.cli.verb import Noun, Verb, by_name
from holozen.console import Failure, printable
from holozen.flags import count
from holozen.secure.roles import ROLES, ROUTER
from holozen.transport.connection import secure_folder

DAYS = 365
HOST = {
    "init": "where others reach the router, besides loopback",
    "page": "where others open the page, besides loopback",
}
Act = Callable[[Any, Path, argparse.Namespace], str]
"""The work of a verb: called with the module holozen.secure.authority and the folder; returns the
text to print.
"""


def _init(authority: Any, root: Path, args: argparse.Namespace) -> str:
    authority.initialize(root, args.host, args.days)
    return (
        f"{root}: {ROUTER}, {', '.join(ROLES)}; run `holozen router --secure {root}`, and "
        "other verbs like that"
    )


def _add(authority: Any, root: Path, args: argparse.Namespace) -> str:
    authority.add(root, args.role, args.name, args.days)
    return f"{root / args.name}: copy it to where {args.name} works, and keep it secret"


def _renew(authority: Any, root: Path, args: argparse.Namespace) -> str:
    authority.renew(root, args.names, args.days)
    elsewhere = (
        "where members work elsewhere, copy the new cert.pem of each there, and "
        "members.json to router and sim"
    )
    return f"{root}: new certificates; {elsewhere}"


def _page(authority: Any, root: Path, args: argparse.Namespace) -> str:
    fingerprint = authority.certify_page(root, args.name, args.host, args.days)
    return (
        f"{root / args.name}: `holozen view --secure` serves https with page.pem\n"
        f"SHA-256 fingerprint, which a browser shows before you trust it: {fingerprint}"
    )


def _revoke(authority: Any, root: Path, args: argparse.Namespace) -> str:
    authority.revoke(root, args.name)
    return (
        f"{args.name} is revoked; if router or sim run elsewhere, copy their new members.json "
        f"from {root} there"
    )


def _show(authority: Any, root: Path, _args: argparse.Namespace) -> str:
    rows = authority.members(root)["members"].items()
    return "\n".join(
        f"{name:<16} {row['role']:<10} until {row['expires'][:10]}" for name, row in rows
    )


def _run(act: Act) -> Callable[[argparse.Namespace], int]:
    """The `run` of a verb: does its work, and prints its text, or with --json all members."""

    def run(args: argparse.Namespace) -> int:
        from holozen.secure import authority  # loads cryptography

        root: Path = args.secure or Path(secure_folder())
        try:
            done = act(authority, root, args)
            table = authority.members(root)["members"]
        except OSError as error:
            raise Failure(f"{error.filename}: {error.strerror}") from None
        if args.json:
            for name, row in table.items():
                print(json.dumps({"name": name, "role": row["role"], "expires": row["expires"]}))
        else:
            print("\n".join(map(printable, done.splitlines())))
        return 0

    return run


def _arguments(verb: str) -> Callable[[argparse.ArgumentParser], None]:
    """A function that adds the flags of a verb to its parser."""

    def fill(parser: argparse.ArgumentParser) -> None:
        add = parser.add_argument
        add(
            "--secure",
            metavar="DIR",
            type=Path,
            help="the folder of the authority (default: HOLOZEN_SECURE, or "
            "~/.config/holozen/secure)",
        )
        if verb in HOST:
            add("--host", action="append", default=[], help=HOST[verb])
        if verb == "add":
            add("role", choices=ROLES)
        if verb in ("add", "revoke"):
            add("name")
        if verb == "page":
            add("name", nargs="?", default="operator", help="the member (default: operator)")
        if verb == "renew":
            add("names", nargs="*", metavar="NAME", help="a member (default: all)")
        if verb in ("init", "add", "renew", "page"):
            add(
                "--days",
                type=count(1, 3650),
                default=DAYS,
                help=f"until certificates expire (default: {DAYS})",
            )

    return fill


VERBS = by_name(
    Noun("secure", "make, renew and revoke the certificates of a network's members"),
    *(
        Verb(f"secure {name}", about, example, _arguments(name), _run(act), bus=False)
        for name, about, example, act in (
            (
                "init",
                "make an authority, a router and a member of each role",
                "--host robot.local",
                _init,
            ),
            ("add", "add a member", "operator Ann", _add),
            ("renew", "issue new certificates to members, for the keys they have", "Ann", _renew),
            ("revoke", "remove a member; the router starts anew without it", "Ann", _revoke),
            (
                "page",
                "make the certificate with which a member's view serves https",
                "--host robot.local",
                _page,
            ),
            ("show", "list the members, their roles and when their certificates expire", "", _show),
        )
    ),
)
