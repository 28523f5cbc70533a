"""`holozen check`: find errors in a robot file."""

import argparse
import json
import os
import re
import shutil
import tempfile
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

from holozen import flags
from holozen.cli.verb import Verb, by_name
from holozen.console import Failure, printable, report
from holozen.suggest import suggest, suggest_file

if TYPE_CHECKING:
    from holozen.check.mistake import Finding

LARGEST = 20.0  # m; a larger size was given in other units

NOTES = """Without an error the last line summarizes the file. The exit code is 1 if there is an error,
0 if there are no findings or only warnings, 2 for wrong usage. The lines of the --require file are
`link NAME` or `joint NAME [TYPE]`; # starts a comment."""  # noqa: E501


def run(args: argparse.Namespace) -> int:
    """Print what is wrong with a file; exit code 1 if there is an error."""
    if args.explain is not None:
        return _explain(args.explain)
    _check_flags(args)
    if args.fix:
        findings, _ = _findings(args)
        if not _fix(args.file, findings, args.write):
            return 1
        if not args.write:
            return 0
    findings, summary = _findings(args)
    _print_findings(args, findings)
    failed = any(finding.severity == "error" for finding in findings)
    if not failed and not args.json and not args.sarif:
        print(printable(f"ok: {summary}"))
    return int(failed)


def _check_flags(args: argparse.Namespace) -> None:
    """Exits with code 2 for flags that do not go together."""
    if args.file is None:
        args.error("give a FILE, or --explain")
    if args.sarif and args.json:
        args.error("give --sarif or --json, not both")
    if args.fix and (args.sarif or args.json):
        args.error("--fix prints a diff; leave out --sarif and --json")
    if args.write and not args.fix:
        args.error("--write is for --fix")


def _print_findings(args: argparse.Namespace, findings: "list[Finding]") -> None:
    if args.sarif:
        from importlib.metadata import version

        from holozen.check.report import sarif

        print(json.dumps(sarif(findings, version("holozen")), indent=2))
        return
    for finding in findings:
        if args.json:
            print(json.dumps(finding.fields()))
        else:
            print("\n".join(map(printable, str(finding).split("\n"))))


def _findings(args: argparse.Namespace) -> "tuple[list[Finding], str]":
    from holozen.check.report import check
    from holozen.check.subject import Requirements

    requirements = Requirements(args.fits, args.require)
    return check(args.file, dict(args.args), dict(args.package), requirements, args.allow_env)


def _explain(name: str) -> int:
    from holozen.check.report import EVERY, explain

    rules = {rule.name: rule for rule in EVERY}
    if name and name not in rules:
        report(
            f"holozen check: there is no rule {name!r}{suggest(name, rules)}; --explain without "
            "one lists them"
        )
        return 2
    print(
        explain(rules[name])
        if name
        else "\n".join(f"{rule.name:<16}{rule.finds}" for rule in EVERY)
    )
    return 0


def _fix(path: Path, findings: "list[Finding]", write: bool) -> bool:
    """Print a diff of the corrections to a file; with `write`, write the file and keep the
    original. Returns False if there is no correction although a finding is an error.
    """
    from difflib import unified_diff

    from holozen.check.corrections import correct

    try:
        old = path.read_bytes()
        text = old.decode()
    except (OSError, UnicodeDecodeError) as error:
        raise Failure(
            f"{path}: {getattr(error, 'strerror', '') or 'is not UTF-8'}{suggest_file(path)}"
        ) from None
    new, done = correct(text, str(path), findings)
    if not done:
        report(
            "holozen check: there is nothing that --fix can correct; leave it out to see all "
            "findings"
        )
        return not any(finding.severity == "error" for finding in findings)
    for line in unified_diff(
        text.splitlines(), new.splitlines(), str(path), f"{path} (corrected)", lineterm=""
    ):
        print(printable(line))
    if not write:
        report("holozen check: nothing is written yet; add --write to write the file")
        return True
    path = path.resolve()
    try:
        kept = _keep(path, old)
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name[:100]}-") as folder:
            whole = Path(folder, "corrected")
            whole.write_bytes(new.encode())
            shutil.copymode(path, whole)
            os.replace(whole, path)
    except OSError as error:
        raise Failure(f"{path}: cannot be written: {error.strerror}") from None
    report(f"holozen check: {path} is corrected; the original is kept as {kept}")
    return True


def _keep(path: Path, content: bytes) -> Path:
    """Write `content` to a new file beside `path`, and return its path."""
    for number in count(1):
        kept = path.with_name(f"{path.name}.orig{number if number > 1 else ''}")
        with suppress(FileExistsError), kept.open("xb") as file:
            file.write(content)
            return kept
    raise AssertionError("there is always a free name")


def _size(text: str) -> tuple[float, ...]:
    words = re.split(r"[xX]", text)
    try:
        values = tuple(float(word) for word in words)
    except ValueError:
        values = ()
    if len(values) not in (2, 3) or not all(0 < value <= LARGEST for value in values):
        size = f"(length, width, height), each at most {LARGEST:g}"
        raise argparse.ArgumentTypeError(f"{text!r}: write metres as 0.4x0.2 or 0.4x0.2x0.3 {size}")
    return values


def _arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("file", type=flags.path, nargs="?", help="a xacro, URDF or SDF file")
    add(
        "args",
        type=flags.pair,
        nargs="*",
        default=[],
        metavar="name:=value",
        help="values of its xacro:arg",
    )
    flags.add_robot_sources(parser)
    add(
        "--fits",
        type=_size,
        default=(),
        metavar="LxW[xH]",
        help="largest allowed size in metres, such as 0.4x0.2",
    )
    add(
        "--explain",
        nargs="?",
        const="",
        metavar="RULE",
        help="explain a rule with an example; without RULE, list all",
    )
    add(
        "--fix",
        action="store_true",
        help="show a diff that corrects misspelt names and missing inertia",
    )
    add(
        "--write",
        action="store_true",
        help="with --fix: write the file, and keep the original as FILE.orig",
    )
    add("--sarif", action="store_true", help="print SARIF 2.1.0, for editors and CI")
    add(
        "--require",
        type=flags.path,
        metavar="FILE",
        help="links and joints that the robot must have",
    )


VERBS = by_name(
    Verb(
        "check",
        "report what is wrong with a xacro, URDF or SDF robot",
        "my_bot.urdf.xacro",
        _arguments,
        run,
        "print the findings as JSON, one object per line",
        NOTES,
        bus=False,
    ),
)
