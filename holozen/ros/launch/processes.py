"""launch's ExecuteProcess: a program, or the verb of ours that does what the program of ROS would."""

import re
import shlex
from pathlib import Path
from typing import Any

from holozen.cli import VERBS
from holozen.ros.launch.context import LaunchContext, Program
from holozen.ros.launch.entity import Action, Entities
from holozen.ros.launch.simulation import given, ours
from holozen.ros.launch.stand_ins import LEFT_OUT, PROGRAMS, Wanted, leave_out
from holozen.ros.launch.text import LaunchError, Text, number, text, truth

SHELL_WORD = "sh"
TERMINALS = ("gnome-terminal", "xterm", "konsole", "xfce4-terminal", "terminator", "lxterminal", "x-terminal-emulator")
_OF_THE_SHELL = re.compile(r"[|&;<>()$`*?]")
_AS_PYTHON = ("python", "python3")


class ExecuteProcess(Action):
    """Starts a program. Scripts of Python run as by `holozen run`, and `ros2 topic ...` is `holozen topic ...`.

    Everything that it writes comes to the terminal, after its name. A `prefix` is left out, and so is `emulate_tty`.
    """

    def __init__(
        self, *, cmd: Any = (), name: Text = "", cwd: Text = "", env: Any = None, additional_env: Any = None,
        shell: Any = False, output: Any = "screen", output_format: Any = "", prefix: Any = None,
        emulate_tty: Any = False, on_exit: Any = None, respawn: Any = False, respawn_delay: Any = 0.0,
        sigterm_timeout: Any = None, sigkill_timeout: Any = None, log_cmd: Any = False, **others: Any,
    ) -> None:  # fmt: skip
        super().__init__(**others)
        if isinstance(cmd, str):
            raise LaunchError(f"cmd={cmd!r} is one text; write a list of words, such as {cmd.split()!r}", self.place)
        self.cmd, self.name, self.cwd, self.shell = list(cmd), name, cwd, shell
        self.env, self.additional_env, self.prefix = env, additional_env, prefix
        self.on_exit, self.respawn, self.respawn_delay = on_exit, respawn, respawn_delay

    @property
    def process_details(self) -> dict[str, Any]:
        """What ROS's event handlers look at: the words."""
        return {"cmd": self.cmd, "name": self.name}

    def execute(self, context: LaunchContext) -> Entities | None:
        """Start it, or do what stands for it. Raises LaunchError."""
        words = [text(context, word) for word in self.cmd]
        if not words:
            raise LaunchError(f"{type(self).__name__} has no cmd", self.place)
        if truth(context, self.shell, "shell"):
            line = " ".join(words)
            words = _plain(line)
            if not words:
                self._start(context, [line], text(context, self.name) or SHELL_WORD, shell=True)
                return None
        return self._do(context, words)

    def _do(self, context: LaunchContext, words: list[str]) -> Entities | None:
        program = Path(words[0]).name
        node = Wanted(self, "", program, words[1:])
        if program in TERMINALS:
            leave_out(context, self, program, f"run this in another terminal: {_inside(words)}")
            return None
        if program in PROGRAMS:
            return PROGRAMS[program](context, node)
        if program == "ros2" and len(words) > 1:
            return self._ros2(context, words[1:])
        for name, reason in LEFT_OUT.items():
            if name.partition("/")[0] == program:
                leave_out(context, self, program, reason)
                return None
        is_python = program in _AS_PYTHON or program.startswith("python3.")
        name = text(context, self.name)
        if is_python and len(words) > 1 and words[1].endswith(".py"):
            words = ours(context, "run", *given(), *words[1:])
            name = name or Path(node.words[0]).name
        self._start(context, words, name or program)
        return None

    def _ros2(self, context: LaunchContext, words: list[str]) -> Entities | None:
        """A verb of ROS's command line, as ours with the same name."""
        verb, name = words[0], text(context, self.name) or f"ros2 {words[0]}"
        if verb == "run" and len(words) > 2:
            from holozen.ros.launch.nodes import Node

            return [Node(package=words[1], executable=words[2], arguments=words[3:], name_of_process=name)]
        if verb not in VERBS:
            leave_out(context, self, f"`ros2 {' '.join(words)[:100]}`", f"there is no verb {verb!r} here", ends=True)
            return None
        self._start(context, ours(context, verb, *words[1:]), name)
        return None

    def _start(self, context: LaunchContext, words: list[str], name: str, shell: bool = False) -> None:
        environment = context.environment if self.env is None else _performed(context, self.env)
        environment = {**environment, **_performed(context, self.additional_env or {})}
        again = truth(context, self.respawn, "respawn")
        delay = number(context, self.respawn_delay or 0.0, "respawn_delay") if again else None
        where = text(context, self.cwd) if self.cwd else None
        if where is not None and not Path(where).is_dir():
            raise LaunchError(f"cwd={where!r} is no folder", self.place)
        context.stage.start(self, Program(name, words, where, environment, shell, respawn=delay))


def _plain(line: str) -> list[str]:
    """The words of a line for the shell that needs none, as it starts one of ROS's programs; else none."""
    try:
        words = shlex.split(line)
    except ValueError:
        return []
    known = bool(words) and Path(words[0]).name in (*PROGRAMS, "ros2")
    return words if known and not _OF_THE_SHELL.search(line) else []


def _inside(words: list[str]) -> str:
    """What a terminal is told to run, as a verb of ours where it is ROS's."""
    words = words[1:]
    while words and words[0].startswith("-"):
        words = words[1:]
    return shlex.join(["holozen", *words[1:]] if words[:1] == ["ros2"] else words)


def _performed(context: LaunchContext, variables: Any) -> dict[str, str]:
    pairs = variables.items() if hasattr(variables, "items") else variables
    return {text(context, name): text(context, value) for name, value in pairs}
