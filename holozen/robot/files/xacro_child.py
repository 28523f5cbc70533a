"""Expands one file with the xacro library, in a process of its own, and replies with JSON on
standard output.

The library keeps its state in module globals and evaluates Python that may never end, so each
expansion has a process that the kernel can end. `holozen.robot.files.xacro` starts it.
"""

import contextlib
import io
import json
import os
import pickle
import re
import signal
import sys
from collections.abc import Callable, Iterator, Mapping
from importlib.util import find_spec
from itertools import groupby
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple
from xml.dom import expatbuilder, minidom
from xml.parsers.expat import ExpatError, ParserCreate, errors

from holozen.packages import (
    find_named,
    find_package,
    known_folders,
    lies_in,
    remember_folders,
    without_home,
)
from holozen.robot.errors import RobotError
from holozen.robot.files.elements import MAX_ELEMENTS, broken_xml, check_file, check_size, read_text
from holozen.robot.files.sandbox import limit, restrict
from holozen.robot.files.uris import find_by_name, instead_of, portable_name, readable
from holozen.robot.files.xacro import (
    PROCESSOR_TIME,
    STEP_TIME,
    Answer,
    Inputs,
    XacroFile,
    answer,
    current,
    unasked,
)
from holozen.suggest import cut, shorten, suggest

# Elements annotated with file and line, in the documents that the library reads and copies.


class SourceLine(NamedTuple):
    """File and line of an element."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"{self.file}, line {self.line}"


def place_of(node: Any) -> SourceLine | None:
    """Where `node` was written, also if it is a copy."""
    return getattr(node, "place", None)


def keep_places(file: Callable[[], str]) -> None:
    """Make minidom record the place of each element it parses from now on; `file` gives the current
    file.

    It patches minidom for the whole process. Entity declarations are refused, as in
    `elements.read_xml`.
    """
    builder: Any = expatbuilder.ExpatBuilderNS
    dom: Any = minidom
    start, copy = builder.start_element_handler, dom._clone_node

    def started(self: Any, name: str, attributes: Any) -> None:
        start(self, name, attributes)
        self.curNode.place = SourceLine(file(), self.getParser().CurrentLineNumber)

    def entity(self: Any, name: str, *_rest: object) -> None:
        place = SourceLine(file(), self.getParser().CurrentLineNumber)
        raise RobotError(f"{place}: the entity {cut(name)} is declared; write out its text instead")

    def copied(node: Any, deep: bool, owner: Any) -> Any:
        clone = copy(node, deep, owner)
        if place := place_of(node):
            clone.place = place
        return clone

    builder.start_element_handler, builder.entity_decl_handler, dom._clone_node = (
        started,
        entity,
        copied,
    )


# The current position in the files, the call chain, and limits on both.


MAX_DEPTH = 10  # of one include in itself, which a condition may end
# of macros, blocks and includes; the library takes 1 s for this many, and superlinear time for more
MAX_CALLS = 5_000
# These differ between processes: string hashes, set order, and generated names.
_IMPURE = re.compile(r"\b(hash|set|frozenset|anon)\b")
_NAME, _NUMBER = re.compile(r"[A-Za-z_]\w*"), re.compile(r"[-+]?\d*\.?\d+")


class Trace:
    """Wraps the library's functions. `reply` is the file from which the parent reads where a killed
    child was.
    """

    def __init__(self, library: Any, reply: int) -> None:
        self.library, self.reply = library, reply
        self.calls: list[str] = []  # active macros and includes, outermost first
        self.place: SourceLine | None = None
        self.pure = True
        self._element: Any = None
        self._macros: Any = None
        self._elements = self._calls = 0
        self._wrap()

    def quiet(self) -> None:
        """No step is in progress: the time limit of a step does not apply."""
        signal.setitimer(signal.ITIMER_PROF, 0)
        self._note("")

    def _wrap(self) -> None:
        library = self.library
        for name in ("check_attrs", "reqd_attrs"):
            setattr(library, name, self._entering(getattr(library, name)))
        library.handle_macro_call = self._calling(library.handle_macro_call)
        library.process_include = self._including(library.process_include)
        for name in ("safe_eval", "eval_extension"):
            setattr(library, name, self._evaluating(getattr(library, name)))
        library.warning, library.print_location = self._warn, lambda: None

    def _warn(self, *words: object, **_options: object) -> None:
        text = " ".join(" ".join(map(str, words)).split())
        print(f"{self._here()}{text}")

    def _enter(self, node: Any) -> None:
        if node is self._element:
            return
        self._element, self.place = node, place_of(node) or self.place
        self._elements += 1
        if self._elements > MAX_ELEMENTS:
            raise RobotError(
                f"{self._here()}it expands without end; at most {MAX_ELEMENTS} elements are "
                "expanded"
            )
        if node.nodeName == "xacro:insert_block":
            self._count_call()
        self._step("")

    def _step(self, expression: str) -> None:
        self._note(expression)
        signal.setitimer(signal.ITIMER_PROF, STEP_TIME)

    def _note(self, expression: str) -> None:
        file, line = self.place or ("", 0)
        os.pwrite(self.reply, json.dumps([file, line, expression[:200]]).encode() + b"\n", 0)

    def _here(self) -> str:
        return f"{self.place}: " if self.place else ""

    def _call(self, node: Any, step: str) -> None:
        self._enter(node)
        self.calls.append(f"{step} {self.place}" if self.place else step)
        self._count_call()

    def _count_call(self) -> None:
        self._calls += 1
        if self._calls > MAX_CALLS:
            raise RobotError(
                f"{self._here()}macros, blocks and includes call each other without end;"
                f" at most {MAX_CALLS} calls are made"
            )

    def _entering(self, function: Any) -> Any:
        def wrapped(node: Any, *rest: Any) -> Any:
            self._enter(node)
            return function(node, *rest)

        return wrapped

    def _calling(self, function: Any) -> Any:
        def wrapped(node: Any, macros: Any, symbols: Any) -> Any:
            name, self._macros = node.tagName, macros
            if not name.startswith("xacro:") or name == "xacro:call":
                self._enter(node)
                return function(node, macros, symbols)
            depth, place = len(self.calls), place_of(node)
            self._call(node, f"in macro {name[6:]!r} called at")
            try:
                done = function(node, macros, symbols)
            except self.library.XacroException as error:
                self._blame_call(error, node, macros, depth)
                raise
            del self.calls[depth:]
            self._element, self.place = node, place or self.place
            return done

        return wrapped

    def _blame_call(self, error: Any, node: Any, macros: Any, depth: int) -> None:
        """A call that failed before the macro's body is itself at fault, not the macro."""
        words = str(error)
        unknown = words.startswith("unknown macro name:")
        if self._element is not node or not (unknown or error.macros):
            return
        del self.calls[depth:]
        if unknown:
            name = node.tagName[6:]
            elsewhere = _plain(node, "macro", name) or _further_down(node, "macro", name)
            error.hint = elsewhere or suggest(name, names(macros))
            return
        params = [param.lstrip("*") for param in error.macros[0].params]
        wrong = words.split('"')[1] if words.startswith("Invalid parameter ") else ""
        error.hint = (
            suggest(wrong, params)
            or f"; {node.tagName} takes {', '.join(params) or 'no parameter'}"
        )
        if "," in (given := " ".join(error.macros[0].params)):
            plain = " ".join(given.replace(",", " ").split())
            error.hint = (
                f"; in xacro:macro write params={shorten(plain, 80)!r}: spaces stand "
                "between them, not commas"
            )

    def _including(self, function: Any) -> Any:
        def wrapped(node: Any, *rest: Any) -> None:
            depth, place = len(self.calls), place_of(node)
            self._call(node, "included at")
            if self.calls.count(self.calls[-1]) > MAX_DEPTH:
                raise RobotError(
                    f"{self._here()}the file includes itself; remove this <xacro:include>"
                )
            function(node, *rest)
            del self.calls[depth:]
            self._element, self.place = node, place or self.place

        return wrapped

    def _evaluating(self, function: Any) -> Any:
        def wrapped(text: str, *tables: Any) -> Any:
            self._step(text)
            self.pure = self.pure and not _IMPURE.search(text)
            try:
                return function(text, *tables)
            except NameError as error:
                if error.name and tables and not hasattr(error, "hint"):
                    node, name = self._element, error.name
                    plain = _in_plain_macro(node) or _plain(node, "property", name)
                    elsewhere = (
                        plain
                        or _further_down(node, "property", name)
                        or _in_a_macro(self._macros, name)
                    )
                    error.hint = elsewhere or suggest(name, names(tables[0]))  # type: ignore[attr-defined]
                raise
            except TypeError as error:
                if tables and not hasattr(error, "hint"):
                    power = "; write ** for a power" if "^" in text else ""
                    error.hint = _no_number(text, tables[0]) or power  # type: ignore[attr-defined]
                raise

        return wrapped


PLAIN = {
    "macro": "; <macro> lacks its prefix: write <xacro:macro ...> ... </xacro:macro>",
    "property": "; <property> lacks its prefix: write <xacro:property ...>",
}
_NO_COMMAND = re.compile(r"Unknown substitution command \[(.+?)\]")
COMMANDS = ("find", "env", "optenv", "dirname", "arg")


def _named(node: Any, tag: str, name: str) -> Any:
    """The first element with that tag and that name in the document of `node`; None if there is
    none.
    """
    document = node.ownerDocument if node is not None else None
    found = document.getElementsByTagName(tag) if document else ()
    return next((each for each in found if each.getAttribute("name") == name), None)


def _in_plain_macro(node: Any) -> str:
    """A hint for an expression inside a `<macro>`, which defines none, so that its parameters have
    no values.
    """
    while node is not None and node.nodeName != "macro":
        node = node.parentNode
    return PLAIN["macro"] if node is not None else ""


def _plain(node: Any, kind: str, name: str) -> str:
    """A hint for a name that a `<macro>` or `<property>` without prefix gives, which defines
    none.
    """
    return PLAIN[kind] if _named(node, kind, name) is not None else ""


def _further_down(node: Any, kind: str, name: str) -> str:
    """A hint for a name whose definition comes later: what xacro has read is no longer in the
    document.
    """
    found = _named(node, f"xacro:{kind}", name)
    if found is not None and found.parentNode.nodeName == "xacro:macro":
        return _only_in(found.parentNode.getAttribute("name")) if kind == "property" else ""
    place = place_of(found) if found is not None else None
    return f"; it is defined further down, in line {place.line}: move that up" if place else ""


def _in_a_macro(macros: Any, name: str) -> str:
    """A hint for a name that only a macro has: one of its parameters, or a property in it."""
    for macro in names(macros):
        own = macros[macro].body.getElementsByTagName("xacro:property")
        if name in macros[macro].params or any(each.getAttribute("name") == name for each in own):
            return _only_in(macro)
    return ""


def _only_in(macro: str) -> str:
    return f"; it is known only inside the macro {shorten(macro)!r}"


def _no_number(expression: str, table: Any) -> str:
    """A hint for an expression that calculates with a text."""
    for name in _NAME.findall(expression):
        try:
            value = table[name]
        except Exception:  # no property, or one that cannot be evaluated, which has its own error
            continue
        if isinstance(value, str):
            plain = value.strip().translate(str.maketrans(",\u2212\u2013", ".--"))
            write = f"; write {plain}" if _NUMBER.fullmatch(plain) else ""
            return f"; {name} is the text {shorten(repr(value), 80)}, not a number{write}"
    return ""


def names(table: Any) -> list[str]:
    """The names in one of the library's tables and in its enclosing ones."""
    found: list[str] = []
    while isinstance(table, dict):
        found += [str(name).lstrip("*") for name in list(table) if not str(name).startswith("__")]
        table = getattr(table, "parent", None)
    return found


def _still_open(error: ExpatError, text: str) -> str:
    """Which element is still open where another one ends; empty for any other error."""
    if error.code != errors.codes[errors.XML_ERROR_TAG_MISMATCH]:
        return ""
    opened = list[tuple[str, int]]()
    parser = ParserCreate("utf-8")
    parser.StartElementHandler = lambda name, _: opened.append((name, parser.CurrentLineNumber))
    parser.EndElementHandler = lambda _: opened.pop()
    with contextlib.suppress(ExpatError):
        parser.Parse(text.encode("utf-8", "replace"), True)
    return f"; <{opened[-1][0][:80]}> of line {opened[-1][1]} is still open" if opened else ""


# The library's errors as one line.


MAX_REPLY = 64 << 20  # bytes; a text of 4 MB takes at most 24 in JSON
MAX_MEMORY = 512 << 20  # bytes of address space of the child


def describe(error: BaseException, trace: Trace, path: Path, guesses: Mapping[str, Path]) -> str:
    """File, line, reason, hint, and the chain of macros and includes. `guesses` are packages found
    by location only.
    """
    cause, suffix = _cause(error)
    if isinstance(cause, RobotError):
        return _chained(_placed(str(cause), path, trace), trace)
    if isinstance(cause, ExpatError):
        file = _last_file(trace)
        text = _text(file)
        still_open = _still_open(cause, text) + _chain(trace.calls)
        return f"{SourceLine(file, cause.lineno)}: {broken_xml(cause, text, still_open)}"
    args = trace.library.substitution_args_context.get("arg", {})
    hint = getattr(cause, "hint", "") or (_guessed(guesses) if isinstance(cause, OSError) else "")
    if type(cause).__name__ == "ArgException":
        hint = suggest(str(cause), list(args))
    elif isinstance(cause, OSError) and "package://" in str(cause.filename):
        hint = "; xacro:include has no package://; write $(find PACKAGE)/..."
    elif found := _NO_COMMAND.match(str(cause)):
        hint = (
            suggest(found[1].split()[0], COMMANDS)
            or f"; to calculate, write ${{{shorten(found[1], 80)}}}"
        )
    return _chained(f"{_where(cause, trace)}: {_reason(cause, suffix)}{hint}", trace)


def _placed(message: str, path: Path, trace: Trace) -> str:
    """The message with the place of the element that requested the package or file."""
    if trace.place is None or str(trace.place) in message:
        return message
    if message.startswith(f"{path}: "):
        return f"{trace.place}{message.removeprefix(str(path))}"
    return message if trace.calls else f"{message} (asked for at {trace.place})"


def _where(cause: BaseException, trace: Trace) -> str:
    file = _last_file(trace)
    if isinstance(cause, UnicodeDecodeError):
        return file
    return str(trace.place or file)


def _last_file(trace: Trace) -> str:
    return next((str(file) for file in reversed(trace.library.filestack or [""])), "")


def _text(file: str) -> str:
    try:
        return read_text(Path(file))
    except RobotError:
        return ""


def _reason(cause: BaseException, suffix: str) -> str:
    kind = type(cause).__name__
    if isinstance(cause, OSError):
        return f"{cause.strerror}: {cause.filename}"
    if isinstance(cause, UnicodeDecodeError):
        return "it is not UTF-8 text; save the file as UTF-8"
    if isinstance(cause, RecursionError):
        return (
            "a macro, a property or an include calls itself without end, or elements are "
            "nested too deep"
        )
    if isinstance(cause, MemoryError):
        return f"it needs too much memory; an expansion has {MAX_MEMORY >> 20} MB {suffix}".rstrip()
    if kind == "ArgException":
        return (
            f"$(arg {cause}) has no value; give one with {cause}:=VALUE or a default in <xacro:arg>"
        )
    words = str(cause) if not isinstance(cause, KeyError) else f"there is no {cause}"
    return one_line(f"{words or kind} {suffix}")


def one_line(text: str, most: int = 400) -> str:
    """`text` as one line of at most `most` characters."""
    return shorten(" ".join(text.split()), most)


def _cause(error: Any) -> tuple[BaseException, str]:
    """The innermost of the library's wrapped errors, and the innermost "when evaluating ..." on the
    way.
    """
    suffix = ""
    while isinstance(getattr(error, "exc", None), Exception):
        suffix = getattr(error, "suffix", None) or suffix
        error = error.exc
    return error, one_line(suffix, 200)


def _chained(message: str, trace: Trace) -> str:
    """The message with the macros and includes it is in; an include that failed itself is not one
    of them.
    """
    failed = message.startswith(f"{trace.place}: ") and trace.calls[-1:] == [
        f"included at {trace.place}"
    ]
    return message + _chain(trace.calls[:-1] if failed else trace.calls)


def _chain(calls: list[str], most: int = 6) -> str:
    runs = ((call, len(list(same))) for call, same in groupby(reversed(calls)))
    chain = [call if times == 1 else f"{call}, {times} times" for call, times in runs]
    cut = [f"and {len(chain) - most} more"] if len(chain) > most else []
    return f" ({', '.join([*chain[:most], *cut])})" if chain else ""


def _guessed(guesses: Mapping[str, Path]) -> str:
    """A hint for each package that was identified only by the location of the robot file."""
    return "".join(
        f"; no package.xml names {name!r}, so {folder} was taken for it: if wrong, give --package "
        f"{name}=DIR"
        for name, folder in guesses.items()
    )


# The expansion.


DEEPEST_CALLS = 4000  # Python frames; the library's own 1000 and what the trace adds
MAX_WORDS = 10_000  # characters of warnings


def main() -> None:
    file, outside, variables = pickle.load(sys.stdin.buffer)
    reply, null = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)
    os.close(null)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    for number in (signal.SIGPROF, signal.SIGXCPU):
        signal.signal(number, signal.SIG_DFL)
    limit(MAX_MEMORY, PROCESSOR_TIME, MAX_REPLY)
    sys.setrecursionlimit(DEEPEST_CALLS)
    words = io.StringIO()
    with contextlib.redirect_stdout(words), contextlib.redirect_stderr(words):
        answer = Expansion(file, outside, variables).run(reply)
    if isinstance(answer, dict):
        answer["warnings"] = words.getvalue()[:MAX_WORDS].splitlines()
    os.ftruncate(reply, 0)
    os.pwrite(reply, json.dumps(answer).encode(), 0)
    os._exit(0)  # freeing a large document takes as long as building it


class Outside(BaseException):
    """A file outside of all known folders is to be included. Not an Exception, so that the library
    passes it on.
    """


class Expansion:
    """One run of the library, with the inputs it used. `outside` says of files elsewhere whether
    they are robot files, and `variables` are the names of those that the user has set.
    """

    def __init__(self, file: XacroFile, outside: Mapping[str, bool], variables: list[str]) -> None:
        self.path, self.packages, self.args, self.allow_env = (
            file.path,
            file.packages,
            file.args,
            file.allow_env,
        )
        self._outside, self._variables = outside, variables
        self.inputs: Inputs = {"file": {}, "glob": {}, "env": {}, "find": {}}
        self.guesses: dict[str, Path] = {}
        self._recording = self._parsing = False

    def run(self, reply: int) -> dict[str, Any] | str:
        """The fields of an Outcome, or the path of a file elsewhere whose kind is asked for.
        `reply`: see Trace.
        """
        library, trace = self._library(reply)
        self._restrict()
        try:
            found = {"text": self._expanded(library, trace)}
        except Outside as file:
            return str(file)
        except Exception as error:  # an expression in the file may raise anything
            trace.quiet()
            found = {"error": describe(error, trace, self.path, self.guesses)}
        self._recording = False
        text = found.get("text", "")
        pure = (
            trace.pure
            and " at 0x" not in text
            and current(self.inputs, self.path, self.packages) == self.inputs
        )
        return {**found, "inputs": self.inputs, "pure": pure}

    def _library(self, reply: int) -> tuple[Any, Trace]:
        import xacro

        # the library would import it late, and its files would look like inputs
        import xacro.substitution_args

        xacro.init_stacks(str(self.path))
        keep_places(lambda: str(xacro.filestack[-1]))
        trace = Trace(xacro, reply)
        xacro.parse = self._parse(xacro, trace)
        setattr(xacro, "open", self._open)  # noqa: B010
        self._answer_find()
        variables = {**dict.fromkeys(self._variables, ""), **os.environ}
        setattr(os, "environ", Asked(variables, self.record_variable))  # noqa: B010
        sys.addaudithook(self._audit)
        return xacro, trace

    def _restrict(self) -> None:
        """Give up all files but those of known folders, and of Python for late imports."""
        remember_folders()
        libraries = [
            Path(spec.origin)
            for name in ("xacro", "yaml")
            if (spec := find_spec(name)) and spec.origin
        ]
        code = [Path(os.__file__).parent, *(each.parents[1] for each in libraries)]
        included = [path for path, allowed in self._outside.items() if allowed]
        if lacks := restrict([*readable(self.path, self.packages), *included, *map(str, code)]):
            print(
                f"this kernel lacks {lacks}: only xacro itself keeps {self.path} from files "
                "outside of known packages"
            )

    def _expanded(self, library: Any, trace: Trace) -> str:
        self._recording = True
        asked = set[str]()
        arguments = Asked(self.args, lambda name, _: asked.add(name))
        document = library.process_file(str(self.path), mappings=arguments)
        trace.quiet()
        for warning in unasked(self.path, self.args, asked):
            print(warning)
        text = str(document.toprettyxml(indent="  "))
        check_size(len(text), f"{self.path} (expanded)")
        return text

    def _parse(self, library: Any, trace: Trace) -> Any:
        parse = library.parse

        def parsed(source: Any, filename: str) -> Any:
            trace.quiet()
            if source is None and os.path.isabs(filename) and not os.path.exists(filename):
                filename = self._elsewhere(filename, library)
            self._parsing = True
            try:
                return parse(source, filename)
            finally:
                self._parsing = False

        return parsed

    def _elsewhere(self, path: str, library: Any) -> str:
        """The file to include instead of one from another machine: a file of the robot with the
        same name, if any.
        """
        self.record("file", path)  # used as soon as it exists
        with self._unrecorded():
            matches = find_by_name(path, self.path, self.packages)
            instead = portable_name(matches[0], self.path, self.packages) if matches else ""
        if not matches:
            return path
        library.warning(instead_of(path, matches, "included", instead))
        library.filestack[-1] = str(matches[0])  # base of relative names in it
        return str(matches[0])

    def _open(self, path: str) -> Any:
        """The library's `open`: for files parsed as XML, and for `load_yaml`, whose data goes into
        the text.
        """
        if self._parsing:
            self._check_include(path)
        elif not self._is_known(path):
            raise RobotError(
                f"{self.path}: load_yaml reads inside known packages only, and {path} is in none "
                "of them (or hidden);"
                " give the package that holds it: --package NAME=DIR"
            )
        return open(path)

    def _check_include(self, path: str) -> None:
        """A robot may be included from anywhere; other XML may be private data."""
        real = os.path.realpath(path)
        if (
            real == os.path.realpath(self.path)
            or not os.path.isfile(real)
            or self._is_known(path, self._own_folder)
        ):
            return
        if real not in self._outside:
            raise Outside(real)
        if not self._outside[real]:
            raise RobotError(
                f"{self.path}: {path} is outside the robot's folder and all known packages, and "
                "is not a robot file: it"
                " is not included; give the package that holds it: --package NAME=DIR"
            )

    @property
    def _own_folder(self) -> Path:
        return self.path.absolute().parent

    def _is_known(self, path: str, *more: Path) -> bool:
        with self._unrecorded():
            return lies_in(path, [*known_folders(self.path, self.packages), *without_home(more)])

    @contextlib.contextmanager
    def _unrecorded(self) -> Iterator[None]:
        """What is read in this block, such as package.xml files, is no input."""
        recording, self._recording = self._recording, False
        try:
            yield
        finally:
            self._recording = recording

    def record_variable(self, name: str, is_set: bool) -> None:
        """Record the value of an environment variable. Raises RobotError for one that is set and
        not allowed.
        """
        if not self._recording:
            return
        self.record("env", name)
        if is_set and name not in self.allow_env:
            raise RobotError(
                f"{self.path}: reads the environment variable {cut(name)}, whose value would be "
                "sent on with the robot;"
                f" allow that with --allow-env {cut(name, 60)[1:-1]}"
            )

    def _answer_find(self) -> None:
        """`$(find NAME)` asks ROS's package index, which is replaced by ours."""
        package, module = (
            ModuleType("ament_index_python"),
            ModuleType("ament_index_python.packages"),
        )
        module.get_package_share_directory = self.find  # type: ignore[attr-defined]
        sys.modules |= {"ament_index_python": package, "ament_index_python.packages": module}

    def find(self, name: str) -> str:
        """The folder of a package."""
        with self._unrecorded():  # the answer is the input
            folder = find_package(name, self.path, self.packages)
            if find_named(name, self.path, self.packages) is None:
                self.guesses[name] = folder
        self.inputs["find"][name] = str(folder)
        return str(folder)

    def record(self, kind: str, asked: str) -> Answer:
        """Record the current value of `asked` at its first use."""
        if asked not in self.inputs[kind]:
            with self._unrecorded():
                self.inputs[kind][asked] = answer(kind, asked, self.path, self.packages)
        return self.inputs[kind][asked]

    def _audit(self, event: str, args: tuple[Any, ...]) -> None:
        if not self._recording or event not in ("open", "glob.glob"):
            return
        if event == "glob.glob":
            if not self._is_known(
                os.path.dirname(re.split(r"[*?\[]", args[0])[0]) or ".", self._own_folder
            ):
                raise RobotError(
                    f"{self.path}: {args[0]} is outside the robot's folder and all known "
                    "packages, where wildcards are"
                    " not expanded; give the package that holds it: --package NAME=DIR"
                )
            self.record("glob", args[0])
        elif isinstance(args[0], (str, os.PathLike)):
            path = Path(args[0])  # the library passes ./robot.xacro
            check_file(path)
            self.record("file", str(path))


class Asked(dict[str, str]):
    """Arguments or environment variables that report each name that is asked for, and whether it
    has a value.
    """

    def __init__(self, values: Mapping[str, str], report: Callable[[str, bool], object]) -> None:
        super().__init__(values)
        self._report = report

    def __getitem__(self, name: str) -> str:
        self._report(name, super().__contains__(name))
        return super().__getitem__(name)

    def __contains__(
        self, name: object
    ) -> bool:  # <xacro:arg> asks whether it has to set the default
        self._report(str(name), super().__contains__(name))
        return super().__contains__(name)
