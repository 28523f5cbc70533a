"""Fields of messages: picked by a dotted path, such as `pose.pose.position.x`, or tested by an expression (`--filter`).

An expression, such as `m.linear.x > 0.2 and not m.angular.z`, is parsed by Python's own parser and evaluated here, node
by node: comparisons, `and`, `or`, `not`, `in`, arithmetic without powers, `abs`, `len`, `[0]`. Anything else is
rejected, so an expression has no side effects. `m` is the message; a bare name is its field.
"""

import ast
import operator
import re
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

from holozen.suggest import suggest

Path = tuple[str | int, ...]

_PART = re.compile(r"([^.\[\]]+)|\[(\d{1,6})\]")
LONGEST_PATH = 500  # characters of a path


def path(text: str) -> Path:
    """The names and indices of a field's path. Raises ValueError for an invalid one."""
    parts: list[str | int] = []
    at = 0
    while at < len(text) <= LONGEST_PATH and (found := _PART.match(text, at + (text[at] == "." and at > 0))):
        parts.append(found[1] if found[1] is not None else int(found[2]))
        at = found.end()
    if not parts or at < len(text):
        raise ValueError(f"{text[:80]!r} is no field; write names with dots, such as pose.pose.position.x")
    return tuple(parts)


def pick(value: Any, path: Path) -> Any:
    """The field of `value` at a path. Raises LookupError that names the fields there are."""
    for part in path:
        if isinstance(part, int) and isinstance(value, list):
            if part >= len(value):
                raise LookupError(f"no [{part}]; the list has {len(value)} values")
            value = value[part]
        elif isinstance(value, dict) and part in value:
            value = value[part]
        else:
            raise LookupError(_missing(value, part))
    return value


def _missing(value: Any, part: str | int) -> str:
    if not isinstance(value, dict):
        return f"no field {part!r} in a {'list; write [0]' if isinstance(value, list) else type(value).__name__}"
    names = [str(name) for name in value]
    return f"no field {part!r}{suggest(str(part), names)}; there are {', '.join(names) or 'none'}"


LONGEST = 1000  # characters
MOST_NODES = 200

Value = Callable[[Any], Any]
"""Evaluates a node for a message."""

COMPARE: dict[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge,
    ast.Eq: operator.eq, ast.NotEq: operator.ne,
    ast.In: lambda item, inside: item in inside, ast.NotIn: lambda item, inside: item not in inside,
}  # fmt: skip
REASON: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Mod: operator.mod, ast.FloorDiv: operator.floordiv,
}  # fmt: skip
CALLS: dict[str, Callable[[Any], Any]] = {"abs": abs, "len": len}


def compiled(text: str) -> Callable[[Any], bool]:
    """The predicate of an expression. Raises ValueError with one line for an invalid one.

    A message without such a field, or with a value of another type there, does not pass.
    """
    if len(text) > LONGEST:
        raise ValueError(f"the filter is longer than {LONGEST} characters")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
        why = error.msg if isinstance(error, SyntaxError) else "nested too deeply"
        raise ValueError(f"filter {text!r}: {why}; write such as m.linear.x > 0.2") from None
    if sum(1 for _ in ast.walk(tree)) > MOST_NODES:
        raise ValueError(f"the filter has more than {MOST_NODES} parts")
    worth = _value(tree, text)

    def passes(message: Any) -> bool:
        try:
            return bool(worth(message))
        except (LookupError, TypeError, ArithmeticError):
            return False

    return passes


def lacking(text: str, message: Any) -> str:
    """A message about the first field in an expression that `message` lacks, with the nearest it has; else empty."""
    for node in ast.walk(ast.parse(text.strip(), mode="eval").body):
        if isinstance(node, ast.Attribute) or (isinstance(node, ast.Name) and node.id not in CALLS):
            names = [*_chain(node)]
            try:
                pick(message, tuple(names[names[:1] == ["m"] :]))
            except LookupError as error:
                return str(error.args[0])
    return ""


def _chain(node: ast.expr) -> Iterator[str]:
    """The names of a field's path; none if it has anything but names."""
    if isinstance(node, ast.Attribute) and (inner := [*_chain(node.value)]):
        yield from [*inner, node.attr]
    elif isinstance(node, ast.Name):
        yield node.id


def _value(node: ast.expr, text: str) -> Value:
    maker = _MAKERS.get(type(node))
    made = maker(node, text) if maker else None
    if made is None:
        part = ast.get_source_segment(text.strip(), node) or text
        raise ValueError(f"filter: {part!r} has no meaning here; it takes fields, numbers, texts, comparisons,"
                         " and, or, not, in, + - * / %, abs(), len()")  # fmt: skip
    return made


def _constant(node: ast.Constant, _text: str) -> Value | None:
    value = node.value
    return (lambda _: value) if value is None or isinstance(value, bool | int | float | str) else None


def _name(node: ast.Name, _text: str) -> Value:
    name = node.id
    return (lambda message: message) if name == "m" else lambda message: message[name]


def _attribute(node: ast.Attribute, text: str) -> Value:
    inner, name = _value(node.value, text), node.attr
    return lambda message: inner(message)[name]


def _subscript(node: ast.Subscript, text: str) -> Value | None:
    if isinstance(node.slice, ast.Slice):
        return None
    inner, index = _value(node.value, text), _value(node.slice, text)
    return lambda message: inner(message)[index(message)]


def _compare(node: ast.Compare, text: str) -> Value | None:
    sides = [_value(side, text) for side in (node.left, *node.comparators)]
    compare = [COMPARE.get(type(op)) for op in node.ops]
    steps = [(how, *pair) for how, pair in zip(compare, pairwise(sides), strict=True) if how]
    if len(steps) < len(compare):
        return None
    return lambda message: all(how(left(message), right(message)) for how, left, right in steps)


def _bool(node: ast.BoolOp, text: str) -> Value:
    parts, join = [_value(part, text) for part in node.values], all if isinstance(node.op, ast.And) else any
    return lambda message: join(part(message) for part in parts)


def _unary(node: ast.UnaryOp, text: str) -> Value | None:
    inner = _value(node.operand, text)
    if isinstance(node.op, ast.Not):
        return lambda message: not inner(message)
    return (lambda message: -_number(inner(message))) if isinstance(node.op, ast.USub) else None


def _binary(node: ast.BinOp, text: str) -> Value | None:
    left, right = _value(node.left, text), _value(node.right, text)
    reason = REASON.get(type(node.op))
    if reason is None:
        return None
    # Numbers only: a string times a billion would fill the memory.
    return lambda message: reason(_number(left(message)), _number(right(message)))


def _call(node: ast.Call, text: str) -> Value | None:
    if not isinstance(node.func, ast.Name) or node.func.id not in CALLS or len(node.args) != 1 or node.keywords:
        return None
    call = CALLS[node.func.id]
    inner = _value(node.args[0], text)
    return lambda message: call(inner(message))


def _number(value: Any) -> float:
    if not isinstance(value, int | float):
        raise TypeError
    return value


_MAKERS: dict[type[ast.expr], Callable[[Any, str], Value | None]] = {
    ast.Constant: _constant, ast.Name: _name, ast.Attribute: _attribute, ast.Subscript: _subscript,
    ast.Compare: _compare, ast.BoolOp: _bool, ast.UnaryOp: _unary, ast.BinOp: _binary, ast.Call: _call,
}  # fmt: skip
