"""`holozen new`: writes a small robot, controller or package of interfaces to start from."""

import argparse
import contextlib
import json
import os
import re
import sys
from collections.abc import Callable
from functools import partial
from keyword import iskeyword

from holozen.cli.verb import Noun, Verb, by_name
from holozen.console import Failure
from holozen.flags import number, refused

NAME = re.compile(r"[a-z][a-z0-9_]{0,63}")
Make = Callable[[argparse.Namespace], tuple[dict[str, str], str]]
"""Returns the contents of the files by their paths, and the commands to run next."""
More = Callable[[argparse.ArgumentParser], None]


def _robot(args: argparse.Namespace) -> tuple[dict[str, str], str]:
    file = f"{args.name}.urdf.xacro"
    wheel = args.wheel_radius or args.radius / 4
    if wheel > args.radius / 2:
        args.error(
            f"--wheel-radius {wheel:g}: the wheels would be inside each other; at most half of "
            "--radius"
        )
    numbers = {"RADIUS": f"{args.radius:g}", "WHEEL": f"{wheel:g}", "MASS": f"{args.mass:g}"}
    return {file: _filled("robot.urdf.xacro", args.name, numbers)}, f"holozen sim --robot {file}"


def _controller(args: argparse.Namespace) -> tuple[dict[str, str], str]:
    file, test = f"{args.name}.py", f"test_{args.name}.py"
    files = {
        file: _filled("controller.py.txt", args.name),
        test: _filled("test_controller.py.txt", args.name),
    }
    return files, f"python {file}, beside `holozen sim`; python -m pytest {test}"


def _package(args: argparse.Namespace) -> tuple[dict[str, str], str]:
    places = {
        "package.xml": "",
        "CMakeLists.txt": "",
        "Battery.msg": "msg/",
        "NextGoal.srv": "srv/",
    }
    files = {
        f"{args.name}/{folder}{file}": _filled(file, args.name) for file, folder in places.items()
    }
    return files, f"holozen interface show {args.name}/srv/NextGoal"


def _filled(template: str, name: str, words: dict[str, str] = {}) -> str:
    """A template with its placeholders, which are words in capitals, replaced."""
    from holozen.data import find

    text = find("templates", template).read_text()
    for word, value in {"NAME": name, **words}.items():
        text = re.sub(rf"\b{word}\b", value, text)
    return text


def _run(make: Make, args: argparse.Namespace) -> int:
    """Write the files that `make` returns, none of which may exist."""
    from pathlib import Path

    files, following = make(args)
    if taken := next((place for name in files if (place := _taken(name))), None):
        raise Failure(
            f"{taken} exists already and is left unchanged; choose another name, or another folder"
        )
    with contextlib.ExitStack() as undo:  # what was written would be in the way of the next try
        for name, text in files.items():
            try:
                Path(name).parent.mkdir(parents=True, exist_ok=True)
                with Path(name).open("x") as file:
                    undo.callback(Path(name).unlink)
                    file.write(text)
            except OSError as error:
                raise Failure(f"{name}: {error.strerror}") from None
        undo.pop_all()
    for name in files:
        print(json.dumps({"file": name}) if args.json else name)
    if not args.json:
        print(f"next: {following}")
    return 0


def _taken(name: str) -> str:
    """The path in the way of a new file: its own, or that of a parent which is not a folder; empty
    if none is.
    """
    from pathlib import Path

    path = Path(name)
    ways = [path, *(folder for folder in path.parents if not folder.is_dir())]
    return next((str(way) for way in ways if os.path.lexists(way)), "")


def _module(text: str) -> str:
    """A name that Python can import, and that hides no installed module."""
    from importlib.util import find_spec

    name = _name(text)
    if iskeyword(name):
        raise refused(
            f"{text!r}: is a keyword of Python and cannot be imported; choose another name"
        )
    if (
        (name in sys.stdlib_module_names or find_spec(name))
        and not _taken(f"{name}.py")
        and not _taken(name)
    ):
        raise refused(
            f"{text!r}: would hide the Python module of that name; choose another one, such as "
            f"my_{name}"
        )
    return name


def _name(text: str) -> str:
    if not NAME.fullmatch(text):
        raise refused(f"{text!r}: use lower-case letters, digits and _, with a letter first")
    return text


def _verb(thing: str, about: str, example: str, make: Make, more: More | None = None) -> Verb:
    kind = _name if thing == "robot" else _module

    def arguments(parser: argparse.ArgumentParser) -> None:
        parser.add_argument("name", type=kind, metavar="NAME")
        _ = more and more(parser)

    text = "print the written files as JSON, one object per line"
    return Verb(f"new {thing}", about, example, arguments, partial(_run, make), text, bus=False)


def _sizes(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add(
        "--radius",
        type=number(0.02, 5, "m"),
        default=0.2,
        metavar="M",
        help="distance to the wheels (default: 0.2)",
    )
    add(
        "--wheel-radius",
        type=number(0.005, 2, "m"),
        metavar="M",
        help="(default: a quarter of --radius)",
    )
    add(
        "--mass",
        type=number(0.01, 500, "kg"),
        default=3.0,
        metavar="KG",
        help="mass of the base (default: 3)",
    )


VERBS = by_name(
    Noun("new", "write a small start to work on"),
    _verb(
        "robot",
        "write NAME.urdf.xacro: a base on three omni wheels",
        "rosie --radius 0.3",
        _robot,
        _sizes,
    ),
    _verb(
        "controller",
        "write NAME.py, which drives a robot to a place, and a test of it",
        "go_there",
        _controller,
    ),
    _verb(
        "package", "write NAME, a package with a message and a service", "our_interfaces", _package
    ),
)
