"""The xacro files of a robot, and the line in them of each element of the expanded text."""

import os
import re
import tempfile
from collections import Counter
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from holozen.packages import find_package, known_folders, lies_in
from holozen.robot.errors import RobotError
from holozen.robot.files import reader
from holozen.robot.files.elements import Tag, read_text, read_xml
from holozen.robot.files.uris import find_by_name, readable
from holozen.robot.files.xacro import XacroFile, expand_in_child, process

MARK = "holozen-line"  # the attribute that carries file and line through xacro
MAX_FILES = 200

_FIND = re.compile(r"\$\(find\s+([^)\s]+)\s*\)")
_FILENAME = re.compile(rb"""(filename\s*=\s*)("[^"]*"|'[^']*')""")


class SourceFile(Struct, frozen=True):
    """A file as written. `includes`: the filename of each include -> the file, None if it is
    computed.
    """

    path: Path
    text: str
    root: Tag
    includes: Mapping[str, Path | None]


def read_sources(path: Path, packages: Mapping[str, Path]) -> list[SourceFile]:
    """The robot file, and the files it includes by a literal name.

    Raises RobotError for a file that cannot be read or parsed.
    """
    files: dict[Path, SourceFile] = {}
    waiting = [path]
    while waiting and len(files) < MAX_FILES:
        here = waiting.pop()
        if here not in files:
            files[here] = _read(here, path, packages)
            waiting += [found for found in files[here].includes.values() if found]
    return list(files.values())


def trace(
    sources: list[SourceFile], plain: Tag, packages: Mapping[str, Path]
) -> list[tuple[Tag, Path, int]]:
    """The elements of the expanded text `plain` whose source is known, in order, each with its
    source file and line.

    Copies of the files, with a mark in each start tag, are expanded. The result is used only if it
    is `plain` but for the marks. Raises RobotError if the copies cannot be read.
    """
    copies = {source.path: Path(f"{number}.xacro") for number, source in enumerate(sources)}
    texts = [_marked(source, number, copies) for number, source in enumerate(sources)]
    found = {name: str(folder) for name, folder in _packages(sources, packages).items()}
    text = reader.ask("marked", texts, found)
    if not text:
        return []
    marked, expanded = list(read_xml(text, "marked").walk()), list(plain.walk())
    marks = [tag.attributes.pop(MARK, "").partition(":") for tag in marked]
    if [(tag.name, tag.attributes) for tag in marked] != [
        (tag.name, tag.attributes) for tag in expanded
    ]:
        return []
    places = zip(expanded, marks, strict=True)
    return [
        (tag, sources[int(number)].path, int(line)) for tag, (number, _, line) in places if line
    ]


def macro_calls(
    sources: list[SourceFile], traced: list[tuple[Tag, Path, int]]
) -> dict[Tag, tuple[str, Path, int]]:
    """Element of the expanded text -> the macro that made it, with file and line of the call, where
    that is certain: a line of the macro made as many elements of a name as there are calls, all in
    one file and none in a macro.
    """
    macros = [(source, macro) for source in sources for macro in source.root.below("xacro:macro")]
    names = Counter(macro.attributes.get("name", "") for _, macro in macros)
    inside = {tag for _, macro in macros for tag in macro.walk()}
    found: dict[Tag, tuple[str, Path, int]] = {}
    made: dict[tuple[Path, int, str], list[Tag]] = {}
    for tag, file, line in traced:
        made.setdefault((file, line, tag.name), []).append(tag)
    for source, macro in macros:
        name = macro.attributes.get("name", "")
        calls = [(each.path, tag) for each in sources for tag in each.root.below(f"xacro:{name}")]
        if (
            names[name] > 1
            or len({path for path, _ in calls}) != 1
            or any(tag in inside for _, tag in calls)
        ):
            continue
        for line, kind in {(tag.line, tag.name) for tag in macro.walk()}:
            tags = made.get((source.path, line, kind), [])
            if len(tags) == len(calls):
                found |= {
                    tag: (name, path, call.line)
                    for tag, (path, call) in zip(tags, calls, strict=True)
                }
    return found


def source_lines(file: XacroFile) -> dict[int, tuple[str, str]]:
    """Line of the expanded text -> "FILE, line N" of the element that begins there, as far as that
    is known, and in which macro that is; empty if in none.
    """
    path, packages = file.path, file.packages
    try:
        found = reader.run(
            list[tuple[int, tuple[str, str]]],
            path,
            _source_lines,
            path,
            packages,
            readable=partial(readable, path, packages),
            handlers=handlers(file),
        )
    except (RobotError, OSError):
        return {}
    return dict(reversed(found))  # of several on a line, the first


def handlers(file: XacroFile) -> dict[str, reader.Handler]:
    """The handlers with which `reader.run` answers a worker that asks for the expansion of a file,
    or for `trace`.
    """
    return {"expand": partial(process, file), "marked": partial(_expand_marked, file)}


def _source_lines(path: Path, packages: Mapping[str, Path]) -> list[tuple[int, tuple[str, str]]]:
    root = read_xml(reader.ask("expand").text, "expanded")
    places = trace(sources := read_sources(path, packages), root, packages)
    calls = {
        tag: f" (in macro {name!r} called at {file}, line {line})"
        for tag, (name, file, line) in macro_calls(sources, places).items()
    }
    return [(tag.line, (f"{file}, line {line}", calls.get(tag, ""))) for tag, file, line in places]


def _expand_marked(file: XacroFile, texts: list[bytes], found: Mapping[str, str]) -> str:
    """The expanded text of the marked copies of a file and its includes; empty if that fails. It
    runs in the parent process, and uses only those of the packages `found` by a worker that the
    file may use.
    """
    known = known_folders(file.path, file.packages)
    given = {
        name: Path(folder)
        for name, folder in found.items()
        if lies_in(Path(folder, "package.xml"), known)
    }
    try:
        with tempfile.TemporaryDirectory(prefix="holozen-check-") as folder:
            for number, text in enumerate(texts):
                Path(folder, f"{number}.xacro").write_bytes(text)
            copy = replace(file, path=Path(folder, "0.xacro"), packages={**given, **file.packages})
            return expand_in_child(copy).text
    except OSError:  # there is no writable folder
        return ""


def _read(path: Path, start: Path, packages: Mapping[str, Path]) -> SourceFile:
    text = read_text(path)
    root = read_xml(text, str(path))
    names = [tag.attributes.get("filename", "") for tag in root.below("xacro:include")]
    return SourceFile(
        path, text, root, {name: _included(name, path, start, packages) for name in names}
    )


def _included(name: str, path: Path, start: Path, packages: Mapping[str, Path]) -> Path | None:
    try:
        found = path.parent / _FIND.sub(
            lambda match: str(find_package(match[1], start, packages)), name
        )
        if "$" in str(found) or found.is_file():
            return found if "$" not in str(found) else None
        return (
            next(iter(find_by_name(name, start, packages)), None) if os.path.isabs(name) else None
        )
    except (RobotError, OSError, ValueError):
        return None


def _packages(sources: list[SourceFile], packages: Mapping[str, Path]) -> dict[str, Path]:
    """The packages that the files name, found from the original file: the copies are elsewhere."""
    found = {}
    for name in {name for source in sources for name in _FIND.findall(source.text)}:
        try:
            found[name] = find_package(name, sources[0].path, packages)
        except RobotError:
            continue
    return found


def _marked(source: SourceFile, number: int, copies: Mapping[Path, Path]) -> bytes:
    """The text with a mark in each start tag that is not xacro's own, and with its includes
    replaced by the copies.
    """
    text, pieces, done = source.text.encode("utf-8", "replace"), [], 0
    for tag in source.root.walk():
        after = tag.at + 1 + len(tag.name.encode())
        pieces.append(text[done:after])
        done = after
        if not tag.name.startswith("xacro:"):
            pieces.append(f' {MARK}="{number}:{tag.line}"'.encode())
        elif tag.name == "xacro:include" and (match := _FILENAME.search(text, after)):
            pieces += [
                text[after : match.start()],
                match[1],
                _copy(match[2][1:-1].decode(), source, copies),
            ]
            done = match.end()
    return b"".join([*pieces, text[done:]])


def _copy(name: str, source: SourceFile, copies: Mapping[Path, Path]) -> bytes:
    found = source.includes.get(name)
    if found and found in copies:
        return f'"{copies[found]}"'.encode()  # beside this copy
    path = str(found) if found else name
    full = path.startswith(("/", "$(find", "$(env", "$(optenv", "$(cwd", "$(dirname"))
    return f'"{path if full else source.path.parent.absolute() / path}"'.encode()
