"""The source files of a robot, and the line of each element of the expanded text in them."""

import os
import re
import tempfile
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from xml.parsers import expat

from holozen.robot import reader
from holozen.robot.elements import Tag, read_xml
from holozen.robot.errors import RobotError
from holozen.robot.packages import find_by_name, find_package, known_folders, lies_in, readable
from holozen.robot.xacro import expand_in_child, process, read_text

MARK = "holozen-line"  # the attribute that carries file and line through xacro
MOST_FILES = 200

_FIND = re.compile(r"\$\(find\s+([^)\s]+)\s*\)")
_FILENAME = re.compile(rb"""(filename\s*=\s*)("[^"]*"|'[^']*')""")


@dataclass(frozen=True, slots=True)
class SourceFile:
    """A file as written. `includes`: the filename of each include -> the file, None if it is computed."""

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
    while waiting and len(files) < MOST_FILES:
        here = waiting.pop()
        if here not in files:
            files[here] = _read(here, path, packages)
            waiting += [found for found in files[here].includes.values() if found]
    return list(files.values())


def trace(sources: list[SourceFile], plain: Tag, packages: Mapping[str, Path]) -> list[str]:
    """For each element of the expanded text in order: "source file number:line", or nothing if unknown.

    The files are expanded a second time, with a mark in each start tag. The result is used only if the text is the
    same otherwise. Raises RobotError if the copies cannot be read.
    """
    copies = {source.path: Path(f"{number}.xacro") for number, source in enumerate(sources)}
    texts = [_marked(source, number, copies) for number, source in enumerate(sources)]
    found = {name: str(folder) for name, folder in _packages(sources, packages).items()}
    text = reader.ask("marked", texts, found)
    if not text:
        return []
    marked = list(elements(read_xml(text, "marked")))
    places = [tag.attributes.pop(MARK, "") for tag in marked]
    same = [(tag.name, tag.attributes) for tag in marked] == [(tag.name, tag.attributes) for tag in elements(plain)]
    return places if same else []


def source_lines(
    path: Path, args: Mapping[str, str], packages: Mapping[str, Path], allow_env: Collection[str]
) -> dict[int, str]:
    """Line of the expanded text -> "FILE, line N" of the element that begins there, as far as that is known."""
    try:
        found = reader.run(
            list[tuple[int, str]], path, _source_lines, path, packages, readable=partial(readable, path, packages),
            handlers=handlers(path, args, packages, allow_env),
        )  # fmt: skip
    except (RobotError, OSError):
        return {}
    return dict(reversed(found))  # of several on a line, the first


def handlers(
    path: Path, args: Mapping[str, str], packages: Mapping[str, Path], allow_env: Collection[str]
) -> dict[str, reader.Handler]:
    """What answers the questions "expand" and "marked" of the process that reads."""
    return {name: partial(answer, path, args, packages, allow_env)
            for name, answer in (("expand", process), ("marked", _expand_marked))}  # fmt: skip


def _source_lines(path: Path, packages: Mapping[str, Path]) -> list[tuple[int, str]]:
    root = read_xml(reader.ask("expand").text, "expanded")
    sources = read_sources(path, packages)
    found = []
    for tag, mark in zip(elements(root), trace(sources, root, packages), strict=False):
        number, colon, line = mark.partition(":")
        if colon:
            found.append((tag.line, f"{sources[int(number)].path}, line {line}"))
    return found


def _expand_marked(
    path: Path,
    args: Mapping[str, str],
    packages: Mapping[str, Path],
    allow_env: Collection[str],
    texts: list[bytes],
    found: Mapping[str, str],
) -> str:
    """The text of the marked copies of `path` and of what it includes, expanded; empty if that fails. For the process
    outside: of the packages `found` by the one that reads, only those that `path` may use count.
    """
    known = known_folders(path, packages)
    given = {name: Path(folder) for name, folder in found.items() if lies_in(Path(folder, "package.xml"), known)}
    try:
        with tempfile.TemporaryDirectory(prefix="holozen-check-") as folder:
            for number, text in enumerate(texts):
                Path(folder, f"{number}.xacro").write_bytes(text)
            return expand_in_child(Path(folder, "0.xacro"), args, {**given, **packages}, allow_env).text
    except OSError:  # there is no writable folder
        return ""


def elements(root: Tag) -> Iterator[Tag]:
    """`root` and all below it, in file order."""
    waiting = [root]
    while waiting:
        tag = waiting.pop()
        yield tag
        waiting += tag.children[::-1]


def _read(path: Path, start: Path, packages: Mapping[str, Path]) -> SourceFile:
    text = read_text(path)
    root = read_xml(text, str(path))
    names = [tag.attributes.get("filename", "") for tag in root.below("xacro:include")]
    return SourceFile(path, text, root, {name: _included(name, path, start, packages) for name in names})


def _included(name: str, path: Path, start: Path, packages: Mapping[str, Path]) -> Path | None:
    try:
        found = path.parent / _FIND.sub(lambda match: str(find_package(match[1], start, packages)), name)
        if "$" in str(found) or found.is_file():
            return found if "$" not in str(found) else None
        return next(iter(find_by_name(name, start, packages)), None) if os.path.isabs(name) else None
    except (RobotError, OSError, ValueError):
        return None


def _packages(sources: list[SourceFile], packages: Mapping[str, Path]) -> dict[str, Path]:
    """The packages as found from the original file, since the copies are elsewhere."""
    found = {}
    for name in {name for source in sources for name in _FIND.findall(source.text)}:
        try:
            found[name] = find_package(name, sources[0].path, packages)
        except RobotError:
            continue
    return found


def _marked(source: SourceFile, number: int, copies: Mapping[Path, Path]) -> bytes:
    """The text with a mark in each start tag that is not xacro's own, and with includes of the copies."""
    text, pieces, done = source.text.encode("utf-8", "replace"), [], 0
    for offset, line, name in _starts(text):
        after = offset + 1 + len(name.encode())
        pieces.append(text[done:after])
        done = after
        if not name.startswith("xacro:"):
            pieces.append(f' {MARK}="{number}:{line}"'.encode())
        elif name == "xacro:include" and (match := _FILENAME.search(text, after)):
            pieces += [text[after : match.start()], match[1], _copy(match[2][1:-1].decode(), source, copies)]
            done = match.end()
    return b"".join([*pieces, text[done:]])


def _copy(name: str, source: SourceFile, copies: Mapping[Path, Path]) -> bytes:
    found = source.includes.get(name)
    if found and found in copies:
        return f'"{copies[found]}"'.encode()  # beside this copy
    path = str(found) if found else name
    full = path.startswith(("/", "$(find", "$(env", "$(optenv", "$(cwd", "$(dirname"))
    return f'"{path if full else source.path.parent.absolute() / path}"'.encode()


def _starts(text: bytes) -> list[tuple[int, int, str]]:
    """Byte offset, line and name of each start tag."""
    found: list[tuple[int, int, str]] = []
    parser = expat.ParserCreate("utf-8")
    parser.StartElementHandler = lambda name, _: found.append((parser.CurrentByteIndex, parser.CurrentLineNumber, name))
    parser.Parse(text, True)
    return found
