"""`holozen launch`: follow a Python launch file that was written for ROS 2, without ROS."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from holozen import connection, flags
from holozen.tell import say

if TYPE_CHECKING:
    from holozen.ros.launch.entity import LaunchDescription


def parser() -> argparse.ArgumentParser:
    parser = flags.Parser(
        prog="holozen launch",
        usage="%(prog)s [options] FILE|PACKAGE FILE [name:=value ...]",
        description="Follow a Python launch file that was written for ROS 2, without ROS.",
        epilog="example: holozen launch launch/gazebo.launch.py world:=arena.world",
    )
    parser.add_argument("words", nargs="+", metavar="FILE [name:=value]",
        help="the launch file, or its package and its name; and values of its arguments")  # fmt: skip
    parser.add_argument("-s", "--show-args", action="store_true", help="only tell which arguments it has")
    parser.add_argument("--package", type=flags.package, action="append", default=[], metavar="NAME=DIR",
        help="the folder of package NAME")  # fmt: skip
    connection.add_arguments(parser)
    return parser


def main(argv: list[str]) -> int:
    options = parser()
    args = options.parse_intermixed_args(argv)
    from holozen.robot.errors import RobotError
    from holozen.ros import executables, finder, packages, traceback
    from holozen.ros.launch import gazebo, sources
    from holozen.ros.launch.text import LaunchError

    given, where = dict(args.package), connection.from_arguments(args)
    packages.use(given)
    gazebo.stand_in()
    values = dict(word.split(":=", 1) for word in args.words if ":=" in word)
    try:
        path = _file([word for word in args.words if ":=" not in word], options)
        packages.use(given, path.resolve().parent)
        finder.install(packages.given, [path.resolve().parent])
        description = sources.read(path)
        return _show(description) if args.show_args else _follow(path.absolute(), description, values, where)
    except (LaunchError, RobotError, executables.NotFound) as error:
        say(f"holozen launch: {error}")
    except Exception as error:
        if not (told := traceback.in_one_line(error) or traceback.of_an_argument(error)):
            traceback.show(error)
        else:
            say(f"holozen launch: {told}")
    return 1


def _follow(path: Path, description: "LaunchDescription", values: dict[str, str], where: connection.Connection) -> int:
    from holozen.process import stop_event
    from holozen.ros.launch import asked
    from holozen.ros.launch.stage import Stage

    with Stage(where.arguments(), stop_event()) as stage:
        context = stage.context
        context.scope.configurations.update(values)
        context.scope = context.scope.within(path)
        left = set(values)
        stage.begun = lambda: _tell_unused(path, context.used, left, set(asked.names(stage.pending, set())))
        stage.run([description])
        _tell_unused(path, context.used, left, set())
    return 1 if stage.failed else 0


def _tell_unused(path: Path, used: set[str], left: set[str], later: set[str]) -> None:
    """Tell the values among `left` that nothing has used and, as far as `later` says, nothing will."""
    from holozen.ros.launch import asked

    unused = left - used - later if asked.ANY not in later else set()
    left -= unused
    for name in sorted(unused):
        hint = flags.nearest(name, used) or f"; it has {', '.join(sorted(used)) or 'no arguments'}"
        say(f"holozen launch: {path.name} does not use {name!r}{hint}")


def _file(words: list[str], options: argparse.ArgumentParser) -> Path:
    """The launch file that the words name. Raises RobotError for a package, NotFound for its file."""
    from holozen.ros import packages
    from holozen.ros.executables import NotFound

    if len(words) == 1:
        return Path(words[0]).expanduser()
    if len(words) != 2:
        options.error(f"give FILE, or PACKAGE FILE, not {' '.join(words) or 'nothing'!r}")
    package, name = words
    folder = packages.find(package)
    there = sorted(each for each in (folder / "launch").rglob("*") if each.is_file()) if folder.is_dir() else []
    found = next((each for each in there if each.name == name), None)
    if found is None:
        names = [each.name for each in there if each.suffix == ".py"]
        hint = flags.nearest(name, names) or f"; there are {', '.join(names) or 'none'}"
        raise NotFound(f"no launch file {name!r} in {folder / 'launch'}{hint}")
    return found


def _show(description: "LaunchDescription") -> int:
    """Tell the arguments of a launch file and of its groups."""
    from holozen.ros.launch.actions import DeclareLaunchArgument, GroupAction
    from holozen.ros.launch.entity import LaunchDescription

    waiting: list[object] = [description]
    found = []
    while waiting:
        entity = waiting.pop(0)
        if isinstance(entity, LaunchDescription):
            waiting[:0] = entity.entities
        elif isinstance(entity, GroupAction):
            waiting[:0] = entity.actions
        elif isinstance(entity, DeclareLaunchArgument):
            found.append(entity.told())
    print("\n".join(found) or "it has no arguments")
    return 0
