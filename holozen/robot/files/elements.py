"""XML elements with their line numbers, and the source of a robot file, which collects warnings
about it.
"""

import hashlib
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from xml.parsers import expat

from msgspec import Struct

from holozen.robot.errors import RobotError
from holozen.robot.model import Vector
from holozen.suggest import cut, suggest, suggest_file

SHORTEST = 1e-6  # length of a vector that gives a direction
LARGEST = 1e6  # m, kg, kg m^2; larger numbers are mistakes, and 1e308 makes the engine compute NaN

# characters, or bytes of a file; these four keep malicious files from stalling the reader
MAX_TEXT = 4_000_000
MAX_ELEMENTS = 50_000
MAX_ATTRIBUTES = 1_000  # of one element
DEEPEST = 200


class Tag(Struct, eq=False):
    """An XML element. `place` is its file and line, for messages; `at` the offset of its start tag
    in the UTF-8 bytes of the file; `text` its own character data. `sdf` is true inside an `<sdf>`,
    where a value such as a size is the text of a child element; in URDF it is an attribute.
    """

    name: str
    attributes: dict[str, str]
    place: str
    parent: "Tag | None" = None
    text: str = ""
    children: "list[Tag]" = []
    sdf: bool = False
    at: int = 0

    def all(self, name: str) -> "list[Tag]":
        """The children called `name`."""
        return [child for child in self.children if child.name == name]

    def first(self, name: str) -> "Tag | None":
        """The first child called `name`; as in URDF, further ones are ignored."""
        for child in self.children:
            if child.name == name:
                return child
        return None

    def needed(self, name: str) -> "Tag":
        """The first child called `name`. Raises RobotError if there is none."""
        found = self.first(name)
        if found is None:
            raise self.wrong(f"has no <{name}>")
        return found

    def child(self, name: str) -> "Tag":
        """The first child called `name`, else an empty one."""
        return self.first(name) or self.empty(name)

    def empty(self, name: str) -> "Tag":
        """An empty child called `name`, in place of one that the file omits."""
        return Tag(name, {}, self.place, self, sdf=self.sdf)

    def walk(self) -> "Iterator[Tag]":
        """This element and all below it, in file order."""
        waiting = [self]
        while waiting:
            tag = waiting.pop()
            yield tag
            waiting += tag.children[::-1]

    def below(self, name: str) -> "Iterator[Tag]":
        """The elements called `name` below this one at any depth, in file order."""
        return (tag for tag in self.walk() if tag.name == name and tag is not self)

    def wrong(self, problem: str) -> RobotError:
        """An error with the location of this element and `problem`."""
        return RobotError(f"{self.place}: {self} {problem}")

    @property
    def line(self) -> int:
        """The line of its start tag; 0 if its place has none."""
        number = self.place.rpartition(", line ")[2]
        return int(number) if number.isdecimal() else 0

    def value(self) -> str:
        """The value of a Gazebo element: its `value="..."`, else its text."""
        return (self.attributes.get("value") or self.text).strip()

    def word(self, attribute: str) -> str:
        """A required attribute, which must not be empty."""
        value = self.attributes.get(attribute, "")
        if not value.strip():
            raise self.wrong(f'has no {attribute}="..."')
        return value

    def given(self, name: str) -> str | None:
        """The text of a value; None if the file omits it."""
        if not self.sdf:
            return self.attributes.get(name)
        child = self.first(name)
        return child.text.strip() if child else None

    def numbers(
        self, name: str, count: int, default: tuple[float, ...] | None = None, most: float = LARGEST
    ) -> tuple[float, ...]:
        """A value of `count` numbers separated by white space, from -`most` to `most`; `default` if
        the file omits it.

        Raises RobotError, as do the methods below, also for a value that is omitted and has no
        default.
        """
        if default is not None and self.given(name) is None:
            return default
        if not self.sdf:
            return self._parsed(f"{self} {name}", self.word(name), count, most)
        return self.needed(name).content(count, most)

    def number(self, name: str, default: float | None = None, most: float = LARGEST) -> float:
        """A value of one number, from -`most` to `most`."""
        return self.numbers(name, 1, None if default is None else (default,), most)[0]

    def vector(self, name: str, default: Vector | None = None) -> Vector:
        """A value of three numbers."""
        x, y, z = self.numbers(name, 3, default)
        return x, y, z

    def direction(self, name: str, default: Vector) -> Vector:
        """A unit vector."""
        x, y, z = self.vector(name, default)
        length = math.hypot(x, y, z)
        if length < SHORTEST:
            raise self.wrong(f"has no direction in {name}; write 0 1 0 for y, 0 0 1 for z")
        return x / length, y / length, z / length

    def content(self, count: int, most: float = LARGEST) -> tuple[float, ...]:
        """The `count` numbers that are the element's own text, from -`most` to `most`."""
        return self._parsed(str(self), self.text.strip(), count, most)

    def _parsed(self, where: str, text: str, count: int, most: float) -> tuple[float, ...]:
        values = []
        for word in text.split():
            value = number(word)
            if value is None:
                problem = f"is not a finite number; {_as_number(word)}"
            elif abs(value) > most:
                problem = f"is beyond {most:g}; use metres, kilograms and radians"
            else:
                values.append(value)
                continue
            raise RobotError(f"{self.place}: {where}: {cut(word)} {problem}")
        if len(values) != count:
            raise RobotError(
                f"{self.place}: {where}: {cut(text)} has {len(values)} numbers instead of {count}"
            )
        return tuple(values)

    def _naming(self) -> str:
        """The attribute that identifies the element among others of its kind; empty if it has
        none.
        """
        if "name" in self.attributes:
            return "name"
        return (
            "reference"
            if self.name == "gazebo" and self.attributes.get("reference", "").strip()
            else ""
        )

    def __str__(self) -> str:
        owner: Tag | None = self
        while owner is not None and not (word := owner._naming()):
            owner = owner.parent
        if owner is None:
            return f"<{self.name[:80]}>"
        named = f"<{owner.name[:80]} {word}={cut(owner.attributes[word])}>"
        return named if owner is self else f"<{self.name[:80]}> of {named}"


def number(word: str) -> float | None:
    """The finite number in `word`, or None. Python's `1_000` is None, since no XML reader accepts
    it.
    """
    try:
        value = float(word)
    except ValueError:
        return None
    return value if math.isfinite(value) and "_" not in word else None


def read_xml(text: str, place: str, most: int = MAX_TEXT) -> Tag:
    """The root element of an XML text of at most `most` characters; `place` names the text in
    messages.

    Raises RobotError with the line for broken XML and for entity declarations: robots need none,
    and they can make a short file expand without bound or read other files. Too much text is
    rejected before parsing, too many or too deeply nested elements as soon as they are encountered.
    """
    check_size(len(text), place, most)
    if not text.strip():
        raise RobotError(
            f"{place}: the file is empty; a robot is a <robot> or an <sdf>, a world an <sdf>"
        )
    reader = _Reader(place)
    try:
        reader.parser.Parse(text.encode("utf-8", "replace"), True)
    except expat.ExpatError as error:
        raise reader.broken(error, text) from None
    return reader.root.children[0]


def repair_xml(text: str) -> tuple[str, list[tuple[int, str]]]:
    """The text, with blanks in place of what XML forbids but Gazebo's parser (TinyXML) accepts, and
    &amp; in place of a raw &; and the line number and a description of each such mistake. Line
    numbers stay the same.
    """
    if _is_well_formed(text):
        return text, []
    pieces: list[str] = []
    mistakes: list[tuple[int, str]] = []
    done, line, has_root = 0, 1, False
    while (start := text.find("<", done)) >= 0:
        line += text.count("\n", done, start)
        end, problem, blanks = _markup(text, start, is_first=start == 0)
        if end < 0:
            break  # never closed: the rest cannot be parsed either
        piece = text[start:end]
        if not has_root and blanks and problem == HEADER and not text[:start].strip():
            problem = (
                "white space before <?xml ...?>, which XML does not allow; it is ignored, "
                "as in Gazebo"
            )
        if problem:
            mistakes.append((line, problem))
        for first, last in blanks:
            piece = piece[:first] + re.sub(r"[^\n]", " ", piece[first:last]) + piece[last:]
        has_root = has_root or piece[1:2].isalpha()
        between = text[done:start]
        line -= between.count("\n")
        for part in (between, piece):
            if "&" in part and part[:2] not in ("<!", "<?") and (raw := _RAW.search(part)):
                if len(mistakes) < MAX_WARNINGS:
                    mistakes.append((line + part.count("\n", 0, raw.start()), AMPERSAND))
                part = _RAW.sub("&amp;", part)
            pieces.append(part)
            line += part.count("\n")
        done = end
    return "".join([*pieces, text[done:]]), mistakes


HEADER = (
    "a second <?xml ...?> header, which XML allows only at the start; it is ignored, as in Gazebo"
)
AMPERSAND = (
    "a & that starts no entity, which XML does not allow; it is read as it is, as in "
    "Gazebo; write &amp;"
)
_RAW = re.compile(r"&(?!#?\w+;)")
_TAG = re.compile(r"""<[\w:.-]++(?:[^"'<>]|"[^"]*"|'[^']*')*+>""")
_ATTRIBUTE = re.compile(r"""\s([\w:.-]+)\s*=\s*(?:"[^"]*"|'[^']*')""")


def _markup(text: str, start: int, is_first: bool) -> tuple[int, str, list[tuple[int, int]]]:
    """The end of the markup that starts at `start`, or -1 if it is not closed; what is wrong with
    it, else an empty string; and the spans in it to blank.
    """
    for opening, closing in (("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>")):
        if not text.startswith(opening, start):
            continue
        found = text.find(closing, start + len(opening))
        end = found + len(closing) if found >= 0 else -1
        inside = text[start + 4 : found]
        if opening == "<!--" and ("--" in inside or inside.endswith("-")):
            return end, "a comment with -- in it, which XML does not allow", [(4, len(inside) + 4)]
        if opening == "<?" and text[start + 2 : start + 6].lower() == "xml " and not is_first:
            return end, HEADER, [(0, end - start)]
        return end, "", []
    tag = _TAG.match(text, start)
    if tag is None:
        return text.find(">", start) + 1 or -1, "", []
    attributes = list(_ATTRIBUTE.finditer(tag[0]))
    first = {match[1]: match for match in reversed(attributes)}
    twice = [match for match in attributes if match is not first[match[1]]]
    if not twice:
        return tag.end(), "", []
    name = re.match(r"<[\w:.-]+", tag[0])
    problem = (
        f"{name[0][:80] if name else '<'}> has the attribute {cut(twice[0][1])} twice; the "
        "first is used"
    )
    return tag.end(), problem, [match.span() for match in twice]


def _is_well_formed(text: str) -> bool:
    def refuse(*_declaration: object) -> None:
        raise expat.ExpatError

    parser = expat.ParserCreate("utf-8")
    parser.EntityDeclHandler = refuse  # entities may expand without bound
    try:
        parser.Parse(text.encode("utf-8", "replace"), True)
    except expat.ExpatError:
        return False
    return True


def check_size(size: int, place: str, most: int = MAX_TEXT) -> None:
    """Raise RobotError for an XML text of more than `most` characters, or a file of more bytes."""
    if size > most:
        content = f"{size / 1e6:.1f} MB of XML; a robot or world has at most {most / 1e6:g} MB"
        raise RobotError(f"{place}: the file contains {content}: move its meshes to separate files")


def check_file(path: Path) -> None:
    """Raise RobotError for a special file, such as a pipe, and for a file of more than MAX_TEXT
    bytes.
    """
    if path.is_file():
        check_size(path.stat().st_size, str(path))
    elif path.exists() and not path.is_dir():
        raise RobotError(f"{path}: is not a regular file; give one, since it is read several times")


def read_text(path: Path) -> str:
    """The text of a file, line endings kept. Raises RobotError if it cannot be read, is too large
    or is not UTF-8.
    """
    try:
        check_file(path)
        return path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise RobotError(
            f"{path}, line {line}: byte {error.start} is not UTF-8 text; save the file as UTF-8"
        ) from None
    except OSError as error:
        raise RobotError(f"{path}: {error.strerror or error}{suggest_file(path)}") from None
    except RobotError:
        raise
    except ValueError as error:
        raise RobotError(f"{path}: {error}") from None


class _Reader:
    def __init__(self, place: str) -> None:
        self.place = place
        self.root = self.open = Tag("", {}, place)
        self.count = 0
        # of the open elements; joined once, since comments split a text
        self.texts: list[list[str]] = [[]]
        self.parser = expat.ParserCreate("utf-8")
        self.parser.buffer_text = True
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.CharacterDataHandler = self.characters
        self.parser.EntityDeclHandler = self.entity

    def start(self, name: str, attributes: dict[str, str]) -> None:
        tag = Tag(
            name, attributes, f"{self.place}, line {self.parser.CurrentLineNumber}", self.open
        )
        tag.sdf, tag.at = self.open.sdf or name == "sdf", self.parser.CurrentByteIndex
        self.count += 1
        if self.count > MAX_ELEMENTS:
            raise tag.wrong(
                f"is element number {self.count}; a file may have at most {MAX_ELEMENTS}"
            )
        if (given := len(attributes)) > MAX_ATTRIBUTES:
            raise tag.wrong(f"has {given} attributes; an element may have at most {MAX_ATTRIBUTES}")
        if len(self.texts) > DEEPEST:
            raise tag.wrong(
                f"lies inside {DEEPEST} others; elements may be nested at most {DEEPEST} deep"
            )
        self.open.children.append(tag)
        self.open = tag
        self.texts.append([])

    def end(self, name: str) -> None:
        assert self.open.parent is not None, "expat closes what it opened"
        self.open.text = "".join(self.texts.pop())
        self.open = self.open.parent

    def characters(self, text: str) -> None:
        self.texts[-1].append(text)

    def entity(self, name: str, *rest: object) -> None:
        line = self.parser.CurrentLineNumber
        raise RobotError(
            f"{self.place}, line {line}: the entity {cut(name)} is declared; write out its text "
            "instead"
        )

    def broken(self, error: expat.ExpatError, text: str) -> RobotError:
        unclosed = f"; {self.open} of {self.open.place} is still open" if self.open.name else ""
        return RobotError(f"{self.place}, line {error.lineno}: {broken_xml(error, text, unclosed)}")


_CASES = (
    (re.compile("[\u2018-\u201f]"), "replace the curly quotes with straight ones"),
    (
        re.compile("[\u00a0\u200b\u202f]"),
        "replace the no-break spaces, which look like spaces, with plain ones",
    ),
    (re.compile(r"^\{\\rtf"), "this is rich text: save the file as plain text"),
    (re.compile(r"&(?!#?\w+;)"), "write & as &amp;"),
    (re.compile(r"<!--(?:(?!-->).)*--(?!>)"), "a comment must not contain -- before its end"),
    (re.compile(r"""\s[\w:.-]+\s*=\s*(?!["'\s])"""), 'put the value in quotes: name="value"'),
    (
        re.compile(
            r"""<[\w:.-]+(?:\s+[\w:.-]+\s*=\s*(?:"[^"]*"|'[^']*'))*\s+([\w:.-]+)(?=\s+[\w:.-]+\s*=|\s*/?>)"""
        ),
        'the word {0} has no value: write {0}="...", or join it to its neighbour',
    ),
    (re.compile(r"""=\s*(?:"[^"]*|'[^']*)$"""), "close the quotes"),
    (re.compile(r"""(?:"[^"]*"|'[^']*')[\w:.-]+\s*="""), "put a space between two attributes"),
    (re.compile(r"<\s+\w|<\d"), "no space and no digit may follow <"),
)


def _as_number(word: str) -> str:
    """How to correct a word that is not a number."""
    if word.startswith(("\u2212", "\u2013")):
        return f"write -{word[1:]}, with the minus sign of the keyboard"
    if re.search(r"[{}()*/]|pi", word):
        return "write a number, or ${...} in a xacro file"
    return "write numbers such as 0.25, separated by spaces"


def broken_xml(error: expat.ExpatError, text: str, context: str) -> str:
    """Why a text is not well-formed XML and, after the last semicolon, how to correct it: judged by
    the error, or by the reported line and the one before it. `context` is inserted between the two.
    """
    if not text.strip():
        return "broken XML: the file is empty; `holozen new robot NAME` writes one to start from"
    reason, lines = (
        expat.ErrorString(error.code),
        text.splitlines()[max(0, error.lineno - 2) : error.lineno],
    )
    return f"broken XML: {reason}{context}; {_advice(reason, lines)}"


def _advice(reason: str, lines: list[str]) -> str:
    if "mismatched" in reason or "no element found" in reason:
        return "close each element, inner ones first: </name>, or /> at the end of its tag"
    if "declaration not at start" in reason:
        return "nothing, not even a space, may come before <?xml"
    if "unbound prefix" in reason:
        return (
            'add xmlns:xacro="http://www.ros.org/wiki/xacro" to <robot>, or that of another prefix'
        )
    if "junk after" in reason:
        return "a file has a single <robot> or <sdf> around everything: remove what follows its end"
    if "unclosed token" in reason and "<!--" in "".join(lines[-1:]):
        return "close the comment with -->"
    for line in reversed(lines):
        for pattern, advice in _CASES:
            if match := pattern.search(line):
                return advice.format(*match.groups())
    return 'write each element as <name attribute="value"> and close it'


AGAIN = "data:again,"  # the start of a `data:` URI for one that the text has elsewhere


def again(uri: str) -> str:
    """A short URI for a `data:` URI that the same text has elsewhere; `Source.read` replaces it."""
    return AGAIN + hashlib.sha256(uri.encode()).hexdigest()[:32]


def _repeat(root: Tag) -> None:
    """Replace the URIs of `again` by the whole ones."""
    tags = [tag for tag in root.walk() if tag.name in ("mesh", "uri", "texture", "albedo_map")]
    whole = [
        uri
        for tag in tags
        for uri in (tag.text, tag.attributes.get("filename", ""))
        if uri.startswith("data:")
    ]
    found = {again(uri): uri for uri in whole if not uri.startswith(AGAIN)}
    for tag in tags:
        tag.text = found.get(tag.text, tag.text)
        if (uri := tag.attributes.get("filename", "")) in found:
            tag.attributes["filename"] = found[uri]


MAX_WARNINGS = 200
MAX_GUESSES = 20  # each compares every name; a file full of mistakes has to finish soon too


class Source(Struct):
    """The file of a robot, the packages given with it, and the warnings about it.

    `strict`: a missing or invalid mesh is an error. `confined`: the text was received over the
    network, and may only open files of known packages. `for_ros2`: its plugins are ROS 2's,
    whatever they look like.
    """

    origin: Path
    packages: Mapping[str, Path]
    warnings: list[str] = []
    guesses: int = 0
    strict: bool = False
    confined: bool = False
    meshes: int = 0
    for_ros2: bool = False

    def warn(self, tag: Tag, problem: str) -> None:
        """Record a mistake that does not make the robot unusable."""
        if len(self.warnings) < MAX_WARNINGS:
            self.warnings.append(str(tag.wrong(problem)))
        elif len(self.warnings) == MAX_WARNINGS:
            self.warnings.append(
                f"{tag.place}: there are more than {MAX_WARNINGS} warnings; the rest are not listed"
            )

    def read(self, text: str, place: str = "") -> Tag:
        """The root element of a text. What only Gazebo's parser accepts is tolerated, with a
        warning.

        `place` (default: the file) names the text in messages. Raises RobotError as `read_xml`
        does.
        """
        place = place or str(self.origin)
        check_size(len(text), place)
        text, mistakes = repair_xml(text)
        self.warnings += [
            f"{place}, line {line}: {problem}" for line, problem in mistakes[:MAX_WARNINGS]
        ]
        root = read_xml(text, place)
        if AGAIN in text:
            _repeat(root)
        return root

    def suggest(
        self, name: str, known: Iterable[str], part: Callable[[str], str] = str, alike: float = 0.65
    ) -> str:
        """As `holozen.suggest.suggest`; empty after MAX_GUESSES calls."""
        self.guesses += 1
        return "" if self.guesses > MAX_GUESSES else suggest(name, known, part, alike)
