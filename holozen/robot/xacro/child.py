"""Expands one file with the xacro library, in a process of its own, and replies with JSON on standard output.

The library keeps its state in module globals and evaluates Python that may never end, so each expansion has a process
that the kernel can end. Started by `run`.
"""

import io
import json
import os
import resource
import signal
import sys
from collections.abc import Mapping
from contextlib import redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from types import ModuleType
from typing import Any

from holozen.robot.errors import RobotError
from holozen.robot.packages import find_named, find_package
from holozen.robot.tag import check_size
from holozen.robot.xacro.inputs import Answer, Inputs, answer, unchanged
from holozen.robot.xacro.lines import keep_places
from holozen.robot.xacro.trace import Trace
from holozen.robot.xacro.words import MOST_MEMORY, told

PROCESSOR_TIME = 6  # s for a whole expansion; the largest robots take 2
DEEPEST_CALLS = 4000  # Python frames; the library's own 1000 and what the trace adds
MOST_WORDS = 10_000  # characters of warnings


def main(asked: dict[str, Any]) -> None:
    out = os.dup(1)
    os.dup2(2, 1)
    _limit()
    words = io.StringIO()
    with redirect_stdout(words), redirect_stderr(words):
        reply = Expansion(Path(asked["path"]), {name: Path(to) for name, to in asked["packages"].items()}).run(asked)
    reply["warnings"] = words.getvalue()[:MOST_WORDS].splitlines()
    with os.fdopen(out, "wb") as file:
        file.write(json.dumps(reply).encode())
    os._exit(0)  # taking a large document apart takes as long as making it


def _limit() -> None:
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    for number in (signal.SIGPROF, signal.SIGXCPU):
        signal.signal(number, signal.SIG_DFL)
    for kind, most in (
        (resource.RLIMIT_AS, MOST_MEMORY),
        (resource.RLIMIT_CPU, PROCESSOR_TIME),
        (resource.RLIMIT_CORE, 0),
    ):
        hard = resource.getrlimit(kind)[1]
        with suppress(OSError, ValueError):  # a system without this limit
            resource.setrlimit(kind, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))
    sys.setrecursionlimit(DEEPEST_CALLS)


class Expansion:
    """One run of the library, with what it asked for."""

    def __init__(self, path: Path, packages: Mapping[str, Path]) -> None:
        self.path, self.packages = path, packages
        self.inputs: Inputs = {"file": {}, "glob": {}, "env": {}, "find": {}}
        self.guesses: dict[str, Path] = {}
        self._listening = False

    def run(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        """The reply: "text" or "error", "inputs", and whether the text depends on them alone ("pure")."""
        library, trace = self._library(asked["note"])
        try:
            text = self._expanded(library, trace, asked["args"])
            reply: dict[str, Any] = {"text": text}
        except Exception as error:  # the library raises whatever an expression in the file raises
            trace.quiet()
            reply = {"error": told(error, trace, self.path, self.guesses)}
        self._listening = False
        text = reply.get("text", "")
        pure = trace.pure and " at 0x" not in text and unchanged(self.inputs, self.path, self.packages)
        return reply | {"inputs": self.inputs, "pure": pure}

    def _library(self, note: int) -> tuple[Any, Trace]:
        import xacro
        import xacro.substitution_args  # the library would import it late, and its files would look like inputs

        xacro.init_stacks(str(self.path))
        keep_places(lambda: str(xacro.filestack[-1]))
        trace = Trace(xacro, note)
        xacro.parse = self._parsing(xacro.parse, trace)
        self._answer_find()
        setattr(os, "environ", Asked(os.environ, self))  # noqa: B010
        sys.addaudithook(self._hear)
        return xacro, trace

    def _expanded(self, library: Any, trace: Trace, args: dict[str, str]) -> str:
        self._listening = True
        document = library.process_file(str(self.path), mappings=args)
        trace.quiet()
        text = str(document.toprettyxml(indent="  "))
        check_size(len(text), f"{self.path} (expanded)")
        return text

    def _parsing(self, parse: Any, trace: Trace) -> Any:
        def parsed(source: Any, filename: str) -> Any:
            trace.quiet()
            return parse(source, filename)

        return parsed

    def _answer_find(self) -> None:
        """`$(find NAME)` asks ROS's package index, which is ours here."""
        package, module = ModuleType("ament_index_python"), ModuleType("ament_index_python.packages")
        module.get_package_share_directory = self.find  # type: ignore[attr-defined]
        sys.modules |= {"ament_index_python": package, "ament_index_python.packages": module}

    def find(self, name: str) -> str:
        """The folder of a package."""
        self._listening = False  # the package.xml files on the way are no inputs: the answer is
        try:
            folder = find_package(name, self.path, self.packages)
            if find_named(name, self.path, self.packages) is None:
                self.guesses[name] = folder
        finally:
            self._listening = True
        self.inputs["find"][name] = str(folder)
        return str(folder)

    def hear(self, kind: str, asked: str) -> Answer:
        """Keep what `asked` gives now, at the first time it is asked for."""
        if asked not in self.inputs[kind]:
            self._listening, listening = False, self._listening
            self.inputs[kind][asked] = answer(kind, asked, self.path, self.packages)
            self._listening = listening
        return self.inputs[kind][asked]

    def _hear(self, event: str, args: tuple[Any, ...]) -> None:
        if not self._listening or event not in ("open", "glob.glob"):
            return
        if event == "glob.glob":
            self.hear("glob", args[0])
        elif isinstance(args[0], (str, os.PathLike)):
            path = str(Path(args[0]))  # the library says ./robot.xacro
            check_file(path)
            self.hear("file", path)


class Asked(dict[str, str]):
    """The environment, which tells the expansion what is asked for."""

    def __init__(self, values: Mapping[str, str], expansion: Expansion) -> None:
        super().__init__(values)
        self._expansion = expansion

    def __getitem__(self, name: str) -> str:
        self._expansion.hear("env", name)
        return super().__getitem__(name)

    def __contains__(self, name: object) -> bool:
        self._expansion.hear("env", str(name))
        return super().__contains__(name)


def check_file(path: str) -> None:
    """Raises RobotError for what is there but is no file of a sensible size."""
    if os.path.isfile(path):
        check_size(os.path.getsize(path), path)
    elif os.path.exists(path) and not os.path.isdir(path):
        raise RobotError(f"{path}: this is no file; give one that can be read more than once")
