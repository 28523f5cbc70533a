"""An XML element that knows the line it stands on."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.parsers import expat

from holozen.robot.errors import RobotError, cut

Vector = tuple[float, float, float]

LARGEST = 1e6  # m, kg, kg m^2; larger numbers are mistakes, and 1e308 is what makes an engine count in NaN

MOST_TEXT = 4_000_000  # characters, or bytes of a file; these three keep a hostile file from stalling its reader
MOST_ELEMENTS = 50_000
DEEPEST = 200


@dataclass(eq=False, slots=True)
class Tag:
    """`place` is the file and line for messages; `text` is the element's own text."""

    name: str
    attributes: dict[str, str]
    place: str
    parent: "Tag | None" = None
    text: str = ""
    children: "list[Tag]" = field(default_factory=list)

    def all(self, name: str) -> "list[Tag]":
        """The children called `name`."""
        return [child for child in self.children if child.name == name]

    def first(self, name: str) -> "Tag | None":
        """The first child called `name`: as in URDF, a second one is not read."""
        for child in self.children:
            if child.name == name:
                return child
        return None

    def below(self, name: str) -> "Iterator[Tag]":
        """The elements called `name` at any depth, in the order of the file."""
        waiting = self.children[::-1]
        while waiting:
            tag = waiting.pop()
            if tag.name == name:
                yield tag
            waiting += tag.children[::-1]

    def wrong(self, problem: str) -> RobotError:
        """The error that says where this element stands and what is wrong with it."""
        return RobotError(f"{self.place}: {self} {problem}")

    def value(self) -> str:
        """What a Gazebo element says: its `value="..."`, else its text."""
        return (self.attributes.get("value") or self.text).strip()

    def word(self, attribute: str) -> str:
        """An attribute that must be there and not empty."""
        value = self.attributes.get(attribute, "")
        if not value.strip():
            raise self.wrong(f'has no {attribute}="..."')
        return value

    def numbers(
        self, attribute: str, count: int, default: tuple[float, ...] | None = None, most: float = LARGEST
    ) -> tuple[float, ...]:
        """`count` numbers with white space between them, from -`most` to `most`; else `default`."""
        if attribute not in self.attributes and default is not None:
            return default
        text = self.word(attribute)
        values = tuple(self._number(attribute, word, most) for word in text.split())
        if len(values) != count:
            raise self.wrong(f"{attribute}={cut(text)} has {len(values)} numbers instead of {count}")
        return values

    def number(self, attribute: str, default: float | None = None, most: float = LARGEST) -> float:
        """One number, from -`most` to `most`."""
        return self.numbers(attribute, 1, None if default is None else (default,), most)[0]

    def vector(self, attribute: str, default: Vector | None = None) -> Vector:
        """Three numbers."""
        x, y, z = self.numbers(attribute, 3, default)
        return x, y, z

    def _number(self, attribute: str, word: str, most: float) -> float:
        value = number(word)
        if value is None:
            raise self.wrong(f"{attribute}: {cut(word)} is no finite number; write 0.25, and spaces between several")
        if abs(value) > most:
            raise self.wrong(f"{attribute}: {cut(word)} is beyond {most:g}; use metres and kilograms")
        return value

    def __str__(self) -> str:
        owner: Tag | None = self
        while owner is not None and "name" not in owner.attributes:
            owner = owner.parent
        if owner is None:
            return f"<{self.name[:80]}>"
        named = f"<{owner.name[:80]} name={cut(owner.attributes['name'])}>"
        return named if owner is self else f"<{self.name[:80]}> of {named}"


def number(word: str) -> float | None:
    """The finite number that `word` is, or None. Python's `1_000` is none, since no XML reader takes it."""
    try:
        value = float(word)
    except ValueError:
        return None
    return value if math.isfinite(value) and "_" not in word else None


def read_xml(text: str, place: str, most: int = MOST_TEXT) -> Tag:
    """The root element of an XML text of at most `most` characters; `place` names the text in messages.

    Raises RobotError with the line for broken XML and for entity declarations: a robot needs none, and they
    are what makes a short file expand without end or reach for other files. Too much text is refused before it is
    read, too many elements or too deep ones as soon as they are met.
    """
    check_size(len(text), place, most)
    if not text.strip():
        raise RobotError(f"{place}: the file is empty; it has to hold a <robot>")
    reader = _Reader(place)
    try:
        reader.parser.Parse(text.encode("utf-8", "replace"), True)
    except expat.ExpatError as error:
        raise reader.broken(error) from None
    return reader.root.children[0]


def check_size(size: int, place: str, most: int = MOST_TEXT) -> None:
    """Raises RobotError for an XML text of more than `most` characters, or a file of more bytes."""
    if size > most:
        told = f"{size / 1e6:.1f} MB of XML; a robot or world has at most {most / 1e6:g} MB"
        raise RobotError(f"{place}: the file holds {told}: put its meshes into files of their own")


class _Reader:
    def __init__(self, place: str) -> None:
        self.place = place
        self.root = self.open = Tag("", {}, place)
        self.count = 0
        self.texts: list[list[str]] = [[]]  # of the open elements; joined once, since comments cut a text into pieces
        self.parser = expat.ParserCreate("utf-8")
        self.parser.buffer_text = True
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.CharacterDataHandler = self.characters
        self.parser.EntityDeclHandler = self.entity

    def start(self, name: str, attributes: dict[str, str]) -> None:
        tag = Tag(name, attributes, f"{self.place}, line {self.parser.CurrentLineNumber}", self.open)
        self.count += 1
        if self.count > MOST_ELEMENTS:
            raise tag.wrong(f"is element number {self.count}; a file holds at most {MOST_ELEMENTS}")
        if len(self.texts) > DEEPEST:
            raise tag.wrong(f"lies inside {DEEPEST} others; elements lie at most {DEEPEST} deep")
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
        raise RobotError(f"{self.place}, line {line}: the entity {cut(name)} is declared; write its text out instead")

    def broken(self, error: expat.ExpatError) -> RobotError:
        unclosed = f"; {self.open} of {self.open.place} is still open" if self.open.name else ""
        return RobotError(f"{self.place}, line {error.lineno}: broken XML: {expat.ErrorString(error.code)}{unclosed}")
