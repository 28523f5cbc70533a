"""Follows a page of docs/: writes its files, runs its commands, and compares what they print.

python -m tests.pages NAME FOLDER
python -m tests.pages < LINES, each NAME FOLDER

- A code block with the title `FILE` is the file's content. `FILE, before TEXT` and `FILE, after
  TEXT` insert it before or after the one line of the file that holds TEXT; `FILE, instead of TEXT`
  replaces that line.
- A `console` block has commands after `$ `, each followed by what it prints; `...` stands for
  anything. Without a title each runs to its end, with exit code 0 unless an `error:` is shown. With
  a title, of a terminal, it goes on until a line `^C`, and the page goes on once it has printed
  what is shown.
- `<!-- TERMINAL: hold KEY -->` holds a key there for a second; `<!-- TERMINAL: type KEYS -->`
  types.
- A block without a language has a command a line. What goes on, such as a sim, ends with the block,
  as do variables; `record` ends after a second.
- A `python` block without a title is run to its end. A `py` block quotes our code.
- A shell gets what needs one; a plain `holozen` is forked, as in other tests.
- `<!-- given: COMMAND; COMMAND -->` is what the reader has running from there on, until the next
  such line, which may say `nothing`.
- `<!-- not run: REASON -->` stands before a block that cannot be run here, or that another test
  runs.
"""

import os
import re
import shlex
import sys
import tempfile
import time
import traceback
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple, Self

from holozen.testing import Process, Terminal, wait_for
from holozen.testing.process import START

REPO = Path(__file__).parents[1]
PAGES = sorted([*REPO.glob("docs/**/*.md"), REPO / "examples" / "fleet" / "README.md"])
STEP = re.compile(
    r'^```(?P<language>\w*)(?: title="(?P<title>[^"]+)")?\n(?P<text>.*?)^```$'
    r"|^<!-- given: (?P<given>[^\n]+) -->$|^<!-- not run: (?P<reason>[^\n]+) -->\n\n?(?=```)"
    r"|^<!-- (?P<terminal>[^:\n]+): (?P<verb>hold|type) (?P<keys>\S+) -->$",
    re.M | re.S,
)
GOES_ON = re.compile(
    r"(?:\S*/)?holozen (?:controller(?!.* "
    r"--resume)|pose-service|record|router|ros2|run|teleop(?!.* --script)|up|view"
    r"|sim(?! (?:pause|play|reset|step))|topic (?:echo|hz|pub)(?!.* --(?:once|times)))\b|zenoh .* "
    r"subscribe|.* &$"
)
QUOTED = re.compile(r"'[^']*'|\"[^\"]*\"")
PLAIN = re.compile(r"(?:env )?(?:\w+=\S+ )*holozen(?: [^#|&;<>$*?~`(){}\\]*)?")
"""Where nothing is left for a shell to do but to take off the quotes."""
EDIT = re.compile(r"(?P<file>[^,]+)(?:, (?P<how>before|after|instead of) (?P<where>.+))?")
READ = {"py", "text", "toml", "xml"}  # blocks that are only read
WITHIN = 60.0  # s for a command
MOMENT = 5.0  # s for the first line of one that goes on; it may have nothing to say
OF_A_SIM: Sequence[str] = ("listens on", "no robot yet")
"""Of the last lines of a sim's start, after which it can be found."""
ANYTHING: Sequence[str] = ("",)
MORE = 0.5  # s that it has to go on after that, since the line may be an error


class Command(NamedTuple):
    line: str
    shown: str  # what the page says that it prints


def commands(block: str) -> Iterator[Command]:
    for part in re.split(r"^\$ ", block, flags=re.M):
        line, _, shown = part.partition("\n")
        if part:
            yield Command(line.partition("  #")[0].strip(), shown.strip())


def started(line: str) -> tuple[list[str], dict[str, str]]:
    """The words that start a command, and its own variables."""
    if not PLAIN.fullmatch(QUOTED.sub("_", line)):
        return ["bash", "-c", line], {}
    words = shlex.split(line.removeprefix("env "))
    at = words.index("holozen")
    return [*START, *words[at + 1 :]], dict(word.split("=", 1) for word in words[:at])


def same(shown: str, printed: str) -> bool:
    """Whether the lines shown are among the lines printed, in this order."""
    left = iter(plain(printed).replace("\r", "\n").splitlines())
    return all(
        any(pattern(line).fullmatch(" ".join(one.split())) for one in left)
        for line in shown.splitlines()
    )


def pattern(line: str) -> re.Pattern[str]:
    """What a line that is shown stands for: `...` for anything, one space for any number."""
    return re.compile(".*".join(re.escape(part) for part in " ".join(line.split()).split("...")))


class Reader:
    """Someone who follows a page in an empty folder of a checkout."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.terminals = folder, dict[str, Terminal]()
        self.given, self.started = list[Terminal](), list[Terminal]()
        self.variables = dict(os.environ)

    def __enter__(self) -> Self:
        os.environ["HOME"] = str(self.folder)
        os.chdir(self.folder)
        return self

    def __exit__(self, *_error: object) -> None:
        for terminal in (*self.terminals.values(), *self.started, *self.given):
            terminal.close()
        set_variables(self.variables)

    def follow(self, page: Path) -> int:  # noqa: C901 - a case for each kind of step
        """Do each step; their number. AssertionError with the step that does not do what the page
        says.
        """
        found = list(STEP.finditer(page.read_text()))
        steps = iter(found)
        for step in steps:
            if step["reason"]:
                next(steps)
            elif step["given"]:
                end(self.given)
                self.begin(step["given"].removeprefix("nothing").split("; "), self.given)
            elif step["verb"]:
                self.press(step["terminal"], step["verb"], step["keys"])
            elif step["language"] == "py":
                continue  # tests/architecture/test_tour.py
            elif not step["language"]:
                variables = dict(os.environ)
                self.begin(step["text"].splitlines(), self.started)
                time.sleep(MORE if self.started else 0.0)
                end(self.started)
                set_variables(variables)
            elif step["language"] == "console" and step["title"]:
                self.attend(step["title"], step["text"])
            elif step["language"] == "console":
                for command in commands(step["text"]):
                    self.run(command)
            elif step["title"]:
                self.write(step["title"], step["text"])
            elif step["language"] == "python":
                self.run(Command(f"python -c {shlex.quote(step['text'])}", ""))
            else:
                assert step["language"] in READ, (
                    f"a block of {step['language']} is neither run nor only read"
                )
        end(self.given)
        return len(found)

    def begin(self, lines: list[str], started: list[Terminal]) -> None:
        """Run a command a line; those that go on are `started`, and have begun before one that ends
        is run. A router has begun before the next: a sim that is faster may take its port.
        """
        begun = list[tuple[Terminal, Sequence[str], float]]()
        for text in [*lines, ""]:
            line = text.partition("  #")[0].strip()
            if line.startswith("export "):
                name, _, value = line.removeprefix("export ").partition("=")
                os.environ[name] = value
                continue
            goes_on = GOES_ON.match(line)
            if goes_on:
                started.append(self.open(line.removesuffix(" &")))
                said = OF_A_SIM if "holozen sim" in line else ANYTHING
                moment = MOMENT if said is ANYTHING else WITHIN
                begun.append((started[-1], said, time.monotonic() + moment))
            while begun and (" record " in line or " router " in line or not goes_on):
                terminal, said, until = begun.pop(0)
                wait_for(partial(speaks, terminal, said, until), 2 * WITHIN)
            if " record " in line:
                time.sleep(1.0)
                end([started.pop()])
            elif line and not goes_on:
                self.run(Command(line, ""))

    def open(self, line: str) -> Terminal:
        """A command in a terminal of its own."""
        words, variables = started(line)
        if words[0] == "bash":
            words[-1] = f"exec {line}"
        return Terminal(words, env={"NO_COLOR": "1", **variables})

    def write(self, title: str, text: str) -> None:
        edit = EDIT.fullmatch(title)
        assert edit, title
        file = self.folder / edit["file"]
        if edit["how"]:
            lines = file.read_text().splitlines(keepends=True)
            (at,) = (number for number, line in enumerate(lines) if edit["where"] in line)
            first, last = {
                "before": (at, at),
                "after": (at + 1, at + 1),
                "instead of": (at, at + 1),
            }[edit["how"]]
            text = "".join(lines[:first]) + text + "".join(lines[last:])
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)

    def run(self, command: Command) -> None:
        if command.line.startswith("cd "):
            self.folder /= Path(command.line.removeprefix("cd ")).expanduser()
            os.chdir(self.folder)
            return
        words, variables = started(command.line)
        with (
            tempfile.TemporaryFile() as output,
            Process(words, env=variables, stdout=output, stderr=output) as process,
        ):
            code = process.wait(WITHIN)
            output.seek(0)
            printed = output.read().decode(errors="replace")
        wrong = "error" in command.shown
        assert (code != 0) == wrong, f"$ {command.line}\n{printed}exit code {code}"
        assert same(command.shown, printed), (
            f"$ {command.line}\n{printed}\ninstead of\n{command.shown}"
        )

    def attend(self, name: str, text: str) -> None:
        for line, shown in commands(text.replace("^C", "$ ^C")):
            if line == "^C":
                end([self.terminals.pop(name)])
                continue
            assert name not in self.terminals, f"{name} is busy: $ {line}"
            terminal = self.terminals[name] = self.open(line)
            wait_for(partial(has, terminal, shown), WITHIN, f"{name} to show {shown!r}")

    def press(self, name: str, verb: str, keys: str) -> None:
        terminal = self.terminals[name]
        if verb == "hold":  # a teleop that was held up disregards a key at first
            terminal.hold_until(keys, lambda: "you drive" in terminal.screen())
            terminal.hold(keys, 1.0)
        else:
            terminal.type(keys)


def end(terminals: list[Terminal]) -> None:
    """Ctrl-C, in the one that was opened last first."""
    while terminals:
        terminal = terminals.pop()
        assert terminal.process.interrupt() in (0, 130), terminal.raw
        terminal.close()


def speaks(terminal: Terminal, said: Sequence[str], until: float) -> bool:
    """Whether a terminal shows something that holds one of `said`, or has been waited for.
    AssertionError if its command ended.
    """
    assert terminal.process.returncode is None, plain(terminal.raw)
    shown = plain(terminal.raw).strip()
    return bool(shown and any(part in shown for part in said)) or time.monotonic() > until


def has(terminal: Terminal, shown: str) -> bool:
    """Whether a terminal shows it. AssertionError if its command ended without."""
    ended = terminal.process.returncode is not None
    # What fills the screen writes only what has changed; what scrolls is no longer there.
    found = same(shown, terminal.screen()) or same(shown, terminal.raw)
    assert found or not ended, f"{plain(terminal.raw)}\ninstead of\n{shown}"
    return found


def plain(text: str) -> str:
    """A terminal's output without control sequences."""
    return re.sub(r"\x1b(?:\[[0-?]*[ -/]*[@-~]|\][^\x07\x1b]*(?:\x07|\x1b\\)|.)", "", text)


def set_variables(variables: dict[str, str]) -> None:
    """Give this process, and what it starts, these variables and no others."""
    os.environ.clear()
    os.environ |= variables


def follow(name: str, folder: str) -> None:
    """Follow a page, at home in the folder."""
    with Reader(Path(folder)) as reader:
        print(f"{name}: {reader.follow(REPO / f'{name}.md')} steps", flush=True)


def follow_all(lines: Iterable[str]) -> None:
    """Follow the pages of these lines. What is wrong with one comes before its `NAME: failed`."""
    for line in lines:
        name, folder = line.rstrip("\n").split(" ", 1)
        try:
            follow(name, folder)
        except Exception:
            traceback.print_exc()
            print(f"{name}: failed", flush=True)


if __name__ == "__main__":
    os.environ["PATH"] = f"{Path(sys.executable).parent}:{os.environ['PATH']}"  # .venv is active
    if sys.argv[1:]:
        follow(*sys.argv[1:])
    else:
        follow_all(sys.stdin)
