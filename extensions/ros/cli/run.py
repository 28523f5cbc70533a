"""`holozen run`: run a Python script that was written for ROS 2, without ROS."""

import argparse
import re
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING

from holozen import flags
from holozen.cli.verb import Verb, by_name
from holozen.console import Failure, report
from holozen.transport import connection

if TYPE_CHECKING:
    from holozen.ros.executables import Script


def run(args: argparse.Namespace) -> int:
    """Run a script in this process."""
    from holozen.ros import packages, runner

    if not args.force and (reason := runner.real_ros()):
        raise Failure(
            f"{reason}: start the script with ROS's own `ros2 run`, or over Zenoh with --force"
        )
    words, found = _split(args.words[1:] if args.words[:1] == ["--"] else args.words, ["--package"])
    args = VERBS["run"].parser().parse_args([*found, args.target], args)
    script, words = _script(args.target, words, dict(args.package))
    source = script.path.read_text(errors="replace")
    words, found = _split(
        words, [flag for flag in _BEHIND if flag not in source], sure=("--package",)
    )
    args = VERBS["run"].parser().parse_args([*found, args.target], args)
    _report_lost(words, source)
    from holozen.ros import importer
    from holozen.ros.rclpy import context

    context.connection = connection.from_arguments(args)
    importer.install(packages.given, [script.root])
    return runner.run(script, words)


def _split(
    words: list[str], flags: list[str], sure: Collection[str] = ()
) -> tuple[list[str], list[str]]:
    """The words for the script; and those that are holozen's: the given `flags` with a valid value,
    or with any value if they are `sure` to be holozen's.
    """
    kept: list[str] = []
    found: list[str] = []
    waiting = list(words)
    while waiting and waiting[0] not in ("--", "--ros-args"):
        word = waiting.pop(0)
        flag, equals, value = word.partition("=")
        value = value if equals else "".join(waiting[:1])
        if flag not in flags or not (flag in sure or _is_valid(flag, value)):
            kept.append(word)
            continue
        found += [flag, value]
        del waiting[: 0 if equals else 1]
    return [*kept, *waiting], found


def _report_lost(words: list[str], source: str) -> None:
    """Report a word NAME:=VALUE that the script gets as its own, unless it speaks of such words."""
    own = words[: words.index("--ros-args")] if "--ros-args" in words else words
    if (lost := next((word for word in own if _ASSIGNMENT.match(word)), "")) and ":=" not in source:
        how = f"for ROS write --ros-args -p {lost} for a parameter, or -r {lost} for a remap"
        report(f"holozen run: {lost!r} is an argument of the script; {how}")


def _is_valid(flag: str, value: str) -> bool:
    try:
        return bool(_BEHIND[flag](value))
    except argparse.ArgumentTypeError:
        return False


_ASSIGNMENT = re.compile(r"[\w/~.:]+:=")
_BEHIND: dict[str, Callable[[str], object]] = {
    "--package": flags.package,
    "--connect": connection.endpoint,
    "--listen": connection.endpoint,
    "--mode": connection.MODES.__contains__,
    "--wire": ("json", "cdr").__contains__,
}
"""A holozen flag that may also follow the script -> a function that is true for its values, or
raises.
"""


def _script(target: str, words: list[str], given: dict[str, Path]) -> "tuple[Script, list[str]]":
    """The script to run, and its arguments. Raises NotFound."""
    from holozen.ros import executables, packages

    path = Path(target).expanduser()
    name = "" if words[:1] and words[0].startswith("-") else "".join(words[:1])
    without_py = not name and path.with_name(f"{path.name}.py").is_file()
    if path.is_file() or path.suffix or "/" in target or without_py:
        packages.use(given, path.absolute().parent)
        script = executables.from_file(path)
        packages.use(given, script.root)
        return script, words
    packages.use(given)
    try:
        script = executables.find(target, name)
    except executables.PackageNotFound:
        from holozen.ros.launch import stand_ins

        if ours := stand_ins.SCRIPTS.get(f"{target}/{name}"):
            return executables.from_file(ours), words[1:]
        if advice := stand_ins.advice(target, name, words[1:]):
            raise Failure(
                f"{' '.join(filter(None, (target, name)))} is not run here: {advice}"
            ) from None
        raise
    packages.use(given, script.root)
    return script, words[1:]


def _arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("target", metavar="FILE.py|PACKAGE", help="the script, or the package of the executable")
    add(
        "words",
        nargs=argparse.REMAINDER,
        metavar="[EXECUTABLE] ...",
        help="the package's executable; what follows it, or FILE.py, goes to the script, except "
        "for flags of holozen "
        "that the script does not have",
    )
    flags.add_packages(parser, "whose scripts, messages and services are used")
    add("--force", action="store_true", help="run even where ROS is sourced; its rclpy is not used")


def _packages(before: list[str], current: str) -> list[str]:
    """The names of packages; none for an empty word, so that the shell lists files."""
    from holozen.ros import packages

    packages.use(flags.packages_in(before))
    return sorted(packages.around()) if current else []


def _executables(before: list[str], _current: str) -> list[str]:
    """The executables of the package named before."""
    from holozen.ros import executables, packages

    packages.use(flags.packages_in(before))
    return executables.names(before[-1])


VERBS = by_name(
    Verb(
        "run",
        "run a Python script that was written for ROS 2, without ROS",
        "scripts/controller.py --ros-args -r cmd_vel:=Fred/cmd_vel",
        _arguments,
        run,
        json=None,
        usage="%(prog)s [options] FILE.py|PACKAGE [EXECUTABLE] [arguments] [--ros-args ...]",
        candidates={"target": _packages, "words": _executables},
    ),
)
