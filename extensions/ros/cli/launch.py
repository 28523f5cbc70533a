"""`holozen launch`: run a Python launch file that was written for ROS 2, without ROS."""

import argparse
import contextlib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from holozen import flags
from holozen.cli.verb import Verb, by_name
from holozen.console import Failure, report
from holozen.robot.errors import RobotError
from holozen.suggest import suggest
from holozen.transport import connection

if TYPE_CHECKING:
    from holozen.ros.launch.launch_description import LaunchDescription


def run(args: argparse.Namespace) -> int:
    """Run a launch file, or list its arguments."""
    from holozen.ros import importer, packages, tracebacks
    from holozen.ros.launch.launch_description_sources import read
    from holozen.ros.launch.stand_ins import launch_file_of_ros, replace_gazebo_packages

    given = dict(args.package)
    packages.use(given)
    replace_gazebo_packages()
    values = dict(word.split(":=", 1) for word in args.words if ":=" in word)
    try:
        path = _file([word for word in args.words if ":=" not in word], args.error)
        description = launch_file_of_ros(path)
        places = [] if description else [path.resolve().parent]
        packages.use(given, *places, env=args.allow_env)
        importer.install(packages.given, places)
        description = description or read(path)
        return (
            _show(description)
            if args.show_args
            else _follow(args, path.absolute(), description, values)
        )
    except Failure:
        raise
    except Exception as error:
        if line := tracebacks.import_error_line(error) or tracebacks.argument_error_line(error):
            raise Failure(line) from None
        tracebacks.show(error)
    return 1


def _follow(
    args: argparse.Namespace, path: Path, description: "LaunchDescription", values: dict[str, str]
) -> int:
    from holozen.process import stop_event
    from holozen.ros.launch.launch_service import Supervisor, running_sim
    from holozen.suspension import suspend_children_too

    suspend_children_too()
    where = connection.from_arguments(args)
    with Supervisor(where.arguments(), stop_event()) as service:
        context = service.context
        context.other_sim, context.strict = partial(running_sim, where), args.strict
        context.scope.configurations.update(values)
        context.scope = context.scope.within(path)
        left = set(values)
        service.on_started = lambda: _report_unused(
            path, context.used, left, service.pending_arguments()
        )
        service.run([description])
        _report_unused(path, context.used, left, set())
    return 1 if service.failed else 0


def _report_unused(path: Path, used: set[str], left: set[str], later: set[str]) -> None:
    """Report the arguments among `left` that are not in `used`, nor in `later`, which will be used;
    and remove them.
    """
    from holozen.ros.launch.launch_service import ANY

    unused = left - used - later if ANY not in later else set()
    left -= unused
    for name in sorted(unused):
        hint = suggest(name, used) or f"; it has {', '.join(sorted(used)) or 'no arguments'}"
        report(f"holozen launch: {path.name} does not use {name!r}{hint}")


def _file(words: list[str], refuse: Callable[[str], NoReturn]) -> Path:
    """The launch file that the words name. Raises RobotError for a package, NotFound for its
    file.
    """
    from holozen.ros import packages
    from holozen.ros.executables import NotFound
    from holozen.ros.launch.stand_ins import GAZEBO_LAUNCH_FILES

    if meant := flags.assigned(words[1:]):
        refuse(f"{meant.replace(':=', '=', 1)!r}: write {meant}")
    if len(words) == 1 and not _is_package(words[0]):
        return Path(words[0]).expanduser()
    if len(words) not in (1, 2):
        refuse(f"give FILE, or PACKAGE FILE, not {' '.join(words) or 'nothing'!r}")
    package, name = words[0], "".join(words[1:])
    folder = packages.find(package)
    replaced = folder == packages.stand_ins.get(package)
    if replaced and name:
        return folder / "launch" / name
    files = (
        sorted(file for file in (folder / "launch").rglob("*") if file.is_file())
        if folder.is_dir()
        else []
    )
    found = next((file for file in files if file.name == name), None)
    if found is None:
        names = (
            [*GAZEBO_LAUNCH_FILES[package]]
            if replaced
            else [file.name for file in files if file.suffix == ".py"]
        )
        if not name:
            raise NotFound(
                f"{package} is a package; give one of its launch files too: "
                f"{', '.join(names) or 'none'}"
            )
        hint = suggest(name, names) or f"; there are {', '.join(names) or 'none'}"
        raise NotFound(f"no launch file {name!r} in {folder / 'launch'}{hint}")
    return found


def _is_package(word: str) -> bool:
    from holozen.ros import packages

    if Path(word).is_file() or not word.isidentifier():
        return False
    with contextlib.suppress(RobotError):
        return bool(packages.find(word, nameless=False))
    return False


def _show(description: "LaunchDescription") -> int:
    """Print the arguments of a launch file and of its groups."""
    from holozen.ros.launch.actions import DeclareLaunchArgument, GroupAction
    from holozen.ros.launch.launch_description import LaunchDescription

    waiting: list[object] = [description]
    found = []
    while waiting:
        entity = waiting.pop(0)
        if isinstance(entity, LaunchDescription):
            waiting[:0] = entity.entities
        elif isinstance(entity, GroupAction):
            waiting[:0] = entity.actions
        elif isinstance(entity, DeclareLaunchArgument):
            found.append(entity.summary())
    print("\n".join(found) or "it has no arguments")
    return 0


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "words",
        nargs="+",
        metavar="FILE [name:=value]",
        help="the launch file, or its package and its name; and values of its arguments",
    )
    parser.add_argument("-s", "--show-args", action="store_true", help="only list its arguments")
    flags.add_robot_sources(parser)
    parser.add_argument(
        "--strict",
        action="store_true",
        help="a node that cannot run here is an error, unless something here does its work",
    )


VERBS = by_name(
    Verb(
        "launch",
        "run a Python launch file that was written for ROS 2, without ROS",
        "launch/gazebo.launch.py world:=arena.world",
        _arguments,
        run,
        json=None,
        usage="%(prog)s [options] FILE|PACKAGE FILE [name:=value ...]",
    ),
)
