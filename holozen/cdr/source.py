"""Makes the Python functions that read and write one type as CDR.

What has a fixed size lies in runs, each one `struct` call; a text or a sequence ends a run. Where a run begins is only
known when the bytes are, so each has eight layouts, one for every place within eight bytes.
"""

from functools import partial
from itertools import count
from math import isfinite
from typing import Any

from holozen import arrays
from holozen.cdr import parts
from holozen.interfaces.definition import Field, Interface, InterfaceError, least

CODES = {"bool": "?", "byte": "B", **arrays.CODES}


class Shape:
    """What values look like: by default a message is a dict. `names` are those that its expressions use.

    With `arrays`, sequences of numbers are read as arrays, else as lists.
    """

    def __init__(self) -> None:
        self.arrays = False
        self.names: dict[str, Any] = {}

    def made(self, interface: Interface, values: list[str]) -> str:
        """The expression of a message whose fields are the expressions `values`."""
        pairs = zip(interface.fields, values, strict=True)
        return "{" + ", ".join(f"{field.name!r}: {value}" for field, value in pairs) + "}"

    def part(self, interface: Interface, field: Field, owner: str) -> str:
        """The expression of a field of the message `owner`."""
        return f"{owner}[{field.name!r}]"


def reader(interface: Interface, shape: Shape, order: str) -> parts.Read:
    """A function that reads a message in the byte order "<" or ">" of struct.

    It raises struct.error where the bytes are cut off, else ValueError.
    """
    made: parts.Read = _Reading(shape, order).function(interface)
    return made


def writer(interface: Interface, shape: Shape) -> parts.Write:
    """A function that appends the parts of a message to `out`, and to `odd` what may hold a NaN or an infinity.

    A value that is none of its field's raises whatever Python does for it.
    """
    made: parts.Write = _Writing(shape, "<").function(interface)
    return made


class _Body:
    """The lines of a function, and the run at hand: what is read or written by the next call of struct."""

    def __init__(self, shape: Shape, order: str) -> None:
        self.shape, self.order = shape, order
        self.lines: list[str] = []
        self.run: parts.Run = []
        self._names: dict[str, Any] = {"isfinite": isfinite, "sized": parts.sized}
        self._numbers = count()

    def compiled(self, interface: Interface, arguments: str, result: str) -> Any:
        lines = [f"def made({arguments}):", *(f" {line}" for line in self.lines), f" return {result}"]
        names = {**self._names, **self.shape.names}
        exec(compile("\n".join(lines), f"<CDR of {interface.name}>", "exec"), names)
        return names["made"]

    def fresh(self) -> str:
        """A name that is not taken."""
        return f"_{next(self._numbers)}"

    def named(self, value: Any) -> str:
        """A name for something that the lines use."""
        name = self.fresh()
        self._names[name] = value
        return name

    def fill(self, interface: Interface) -> None:
        """Read or write the one byte of a message without fields."""
        if not interface.fields:
            self.run.append(("x", 1))

    def in_run(self, field: Field) -> bool:
        """Whether a field has a fixed size, and goes into the run."""
        if field.type == "wstring":
            raise InterfaceError(f"{field.name}: the implementations of ROS 2 do not agree how a wstring is written")
        if field.type not in CODES or field.array not in ("", "fixed"):
            return False
        self.run.append((CODES[field.type], field.bound or 1))
        return True


class _Reading(_Body):
    """Expressions stand for the values that the lines have read."""

    def function(self, interface: Interface) -> Any:
        self._values = self.fresh()  # the tuple of the run at hand
        value = self.message(interface)
        self.end_run()
        return self.compiled(interface, "b, p, e", f"{value}, p")

    def message(self, interface: Interface) -> str:
        self.fill(interface)
        return self.shape.made(interface, [self.field(field) for field in interface.fields])

    def field(self, field: Field) -> str:
        if not field.array and field.nested:
            return self.message(field.nested)
        at = sum(many for code, many in self.run if code != "x")
        if self.in_run(field):
            return f"list({self._values}[{at}:{at + field.bound}])" if field.array else f"{self._values}[{at}]"
        self.end_run()
        value = self.fresh()
        self.lines.append(f"{value}, p = {self.named(self.call(field))}(b, p, e)")
        return value

    def call(self, field: Field) -> Any:
        if field.type in CODES:
            if self.shape.arrays and field.type in arrays.CODES:
                return partial(parts.read_array, self.order, CODES[field.type], field.bound)
            return partial(parts.read_numbers, self.order, CODES[field.type], field.bound)
        text = partial(parts.read_text, self.order, field.longest)
        one = reader(field.nested, self.shape, self.order) if field.nested else text
        if field.array == "fixed":
            return partial(parts.read_row, one, field.bound)
        return partial(parts.read_many, self.order, one, least(field), field.bound) if field.array else one

    def end_run(self) -> None:
        if self.run:
            table = [(layout.unpack_from, layout.size) for layout in parts.layouts(self.order, self.run)]
            self.lines += [f"u, n = {self.named(table)}[p & 7]", f"{self._values} = u(b, p)", "p += n"]
            self.run, self._values = [], self.fresh()


class _Writing(_Body):
    """The lines take values out of the message `o` and append their bytes."""

    def function(self, interface: Interface) -> Any:
        self._items: list[str] = []  # what the run at hand writes
        self.message(interface, "o")
        self.end_run()
        return self.compiled(interface, "o, p, out, odd", "p")

    def message(self, interface: Interface, owner: str) -> None:
        self.fill(interface)
        for field in interface.fields:
            self.field(field, self.shape.part(interface, field, owner))

    def field(self, field: Field, part: str) -> None:
        if not field.array and field.nested:
            owner = self.fresh()
            self.lines.append(f"{owner} = {part}")
            self.message(field.nested, owner)
        elif self.in_run(field):
            self._items.append(f"*sized({part}, {field.bound})" if field.array else part)
        else:
            self.end_run()
            self.lines.append(f"p = {self.named(self.call(field))}({part}, p, out, odd)")

    def call(self, field: Field) -> Any:
        if field.type in CODES:
            return partial(parts.write_numbers, CODES[field.type], field.bound)
        one = writer(field.nested, self.shape) if field.nested else partial(parts.write_text, field.longest)
        if field.array == "fixed":
            return partial(parts.write_row, one, field.bound)
        return partial(parts.write_many, one, field.bound) if field.array else one

    def end_run(self) -> None:
        if self.run:
            table = [(layout.pack, layout.size) for layout in parts.layouts("<", self.run)]
            items = "".join(f"{item}, " for item in self._items)
            self.lines += [f"u, n = {self.named(table)}[p & 7]", f"v = ({items})", "out.append(u(*v))", "p += n"]
            if any(code in "fd" for code, _ in self.run):
                self.lines.append("isfinite(sum(v)) or odd.append(v)")
            self.run, self._items = [], []
