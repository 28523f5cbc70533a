"""`holozen run`: run a Python script that was written for ROS 2, without ROS."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from holozen import connection, flags
from holozen.tell import say

if TYPE_CHECKING:
    from holozen.ros.executables import Script


def parser() -> argparse.ArgumentParser:
    parser = flags.Parser(
        prog="holozen run",
        usage="%(prog)s [options] FILE.py|PACKAGE [EXECUTABLE] [arguments] [--ros-args ...]",
        description="Run a Python script that was written for ROS 2, without ROS.",
        epilog="example: holozen run scripts/controller.py --ros-args -r cmd_vel:=Fred/cmd_vel",
    )
    parser.add_argument("target", metavar="FILE.py|PACKAGE", help="the script, or the package of the executable")
    parser.add_argument("words", nargs=argparse.REMAINDER, metavar="[EXECUTABLE] ...",
        help="the package's executable; what follows it, or FILE.py, is the script's own")  # fmt: skip
    parser.add_argument("--package", type=flags.package, action="append", default=[], metavar="NAME=DIR",
        help="the folder of package NAME, whose scripts, messages and services are used")  # fmt: skip
    parser.add_argument("--force", action="store_true", help="also where ROS is sourced, whose rclpy is not used then")
    connection.add_arguments(parser)
    return parser


def main(argv: list[str]) -> int:
    args = parser().parse_args(argv)
    from holozen.ros import executables, packages, runner

    if not args.force and (reason := runner.real_ros()):
        say(f"holozen run: {reason}: start the script with ROS's own `ros2 run`, or over Zenoh with --force")
        return 1
    words = args.words[1:] if args.words[:1] == ["--"] else args.words
    try:
        script, words = _script(args.target, words, dict(args.package))
    except executables.NotFound as error:
        say(f"holozen run: {error}")
        return 1
    from holozen.ros import context, finder

    context.connection = connection.from_arguments(args)
    finder.install(packages.given, [script.root])
    return runner.run(script, words)


def _script(target: str, words: list[str], given: dict[str, Path]) -> "tuple[Script, list[str]]":
    """What to run, and the words for it. Raises NotFound."""
    from holozen.ros import executables, packages

    path = Path(target).expanduser()
    if path.is_file() or path.suffix == ".py" or "/" in target:
        packages.use(given, path.absolute().parent)
        script = executables.from_file(path)
        packages.use(given, script.root)
        return script, words
    packages.use(given)
    name = "" if words[:1] and words[0].startswith("-") else "".join(words[:1])
    script = executables.find(target, name)
    packages.use(given, script.root)
    return script, words[1:]
