"""What a type is made of."""

from typing import Any, NamedTuple

LARGEST = 16_000_000  # bytes of the smallest message of a type; fixed arrays multiply
MOST_FIELDS = 10_000  # of a type and of those within it; each level can double them

INTEGERS = {
    "byte": (0, 2**8 - 1),
    "char": (0, 2**8 - 1),
    **{f"int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": (0, 2**bits - 1) for bits in (8, 16, 32, 64)},
}
"""The least and the largest value of each whole number. As in ROS 2, byte and char are unsigned."""
FLOATS = ("float32", "float64")
TEXTS = ("string", "wstring")
PRIMITIVES = ("bool", *INTEGERS, *FLOATS, *TEXTS)

_SIZES = {"bool": 1, "byte": 1, "char": 1, "string": 4, "wstring": 4}


class InterfaceError(ValueError):
    """A type that is not known, a file that is none, or a value that does not fit. The text is one line."""


class Field(NamedTuple):
    """One field. `type` is a primitive of ROS, or the full name of a message, which is then in `nested`.

    `array` is empty for a single value, else "fixed" (`bound` elements), "bounded" (at most `bound`) or "sequence".
    `longest` is N of a `string<=N`, 0 without. `default` is None where the definition gives none.
    """

    name: str
    type: str
    array: str = ""
    bound: int = 0
    default: Any = None
    longest: int = 0
    nested: "Interface | None" = None

    def spelled(self, package: str = "") -> str:
        """The type as a .msg file of `package` writes it, such as `float64[36]`."""
        home, _, rest = self.type.partition("/msg/")
        name = self.type if not rest else rest if home == package else f"{home}/{rest}"
        ends = {"": "", "fixed": f"[{self.bound}]", "bounded": f"[<={self.bound}]", "sequence": "[]"}
        return name + (f"<={self.longest}" if self.longest else "") + ends[self.array]


class Constant(NamedTuple):
    """A name for a value."""

    name: str
    type: str
    value: Any


class Interface:
    """A message type; or a service type, which has a `request` and a `response` and no fields of its own.

    `kind` is "msg" or "srv". The messages of a service are messages: `std_srvs/srv/Trigger_Request`.
    """

    __slots__ = ("constants", "fields", "kind", "least", "name", "request", "response", "width")

    def __init__(
        self,
        name: str,
        kind: str,
        fields: tuple[Field, ...] = (),
        constants: tuple[Constant, ...] = (),
        parts: "tuple[Interface, Interface] | None" = None,
    ) -> None:
        self.name, self.kind, self.fields, self.constants = name, kind, fields, constants
        self.request = parts[0] if parts else None
        self.response = parts[1] if parts else None
        self.least: int = max(1, sum(map(_least, fields)))  # bytes; an empty message takes one
        self.width: int = 1 + sum(field.nested.width if field.nested else 1 for field in fields)
        if self.least > LARGEST or self.width > MOST_FIELDS:
            raise InterfaceError(f"{name} is too large: at least {self.least} bytes and {self.width} fields")

    @property
    def package(self) -> str:
        """The first part of the name."""
        return self.name.partition("/")[0]

    def __repr__(self) -> str:
        return f"<Interface {self.name}>"


def least(field: Field) -> int:
    """Bytes that one element of a field takes at least, without padding."""
    return field.nested.least if field.nested else size(field.type)


def size(primitive: str) -> int:
    """Bytes of a primitive; of a text, of its length."""
    return _SIZES.get(primitive) or int(primitive.lstrip("uintfloa")) // 8


def _least(field: Field) -> int:
    return 4 if field.array in ("sequence", "bounded") else least(field) * (field.bound if field.array else 1)
