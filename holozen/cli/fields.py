"""Fields of messages: picked by a dotted path, such as `pose.pose.position.x`, or tested by an expression (`--filter`).

An expression, such as `m.linear.x > 0.2 and not m.angular.z`, is a Python expression with comparisons, `and`, `or`,
`not`, `in`, arithmetic without powers, `abs`, `len` and `[0]`; anything else is refused. `m` is the message, a bare
name one of its fields. Before Python evaluates it, names and attributes become items of the message, so it can read
nothing else and has no side effects.
"""

import ast
import re
import warnings
from collections.abc import Callable, Iterator
from typing import Any, NoReturn

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
        raise ValueError(f"{text[:80]!r} is not a field; write names with dots, such as pose.pose.position.x")
    return tuple(parts)


def pick(value: Any, path: Path) -> Any:
    """The field of `value` at a path. Raises LookupError that lists the fields, if it has no such one."""
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


LONGEST = 1000  # characters of an expression
MAX_NODES = 200  # parts of an expression

ALLOWED = (
    ast.Compare, ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.Eq, ast.NotEq, ast.In, ast.NotIn, ast.BoolOp, ast.And, ast.Or,
    ast.UnaryOp, ast.Not, ast.USub, ast.BinOp, ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Mod, ast.FloorDiv,
    ast.Subscript, ast.Call, ast.Constant, ast.Name, ast.Attribute, ast.Load,
)  # fmt: skip
"""The parts that an expression may consist of."""
CALLS: dict[str, Callable[[Any], Any]] = {"abs": abs, "len": len}


def compiled(text: str) -> Callable[[Any], bool]:
    """The predicate of an expression. Raises ValueError with one line for an invalid one.

    A message that lacks a field of the expression, or has a value of another type there, does not pass.
    """
    if len(text) > LONGEST:
        raise ValueError(f"the filter is longer than {LONGEST} characters")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Python warns of such as 1[0], which no message passes
        try:
            tree = ast.parse(text.strip(), mode="eval")
        except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
            why = error.msg if isinstance(error, SyntaxError) else "nested too deeply"
            raise ValueError(f"filter {text!r}: {why}; write one such as m.linear.x > 0.2") from None
        if sum(1 for _ in ast.walk(tree.body)) > MAX_NODES:
            raise ValueError(f"the filter has more than {MAX_NODES} parts")
        tree.body = _Lookups(text.strip()).visit(tree.body)
        code = compile(ast.fix_missing_locations(tree), "<filter>", "eval")
    names = {"__builtins__": {}, "number": _number, **CALLS}

    def passes(message: Any) -> bool:
        try:
            return bool(eval(code, names, {"m": message}))
        except (LookupError, TypeError, ArithmeticError):
            return False

    return passes


def lacking(text: str, message: Any) -> str:
    """An error line about the first field of an expression that `message` lacks, with the nearest one that it has;
    empty if it lacks none.
    """
    for node in ast.walk(ast.parse(text.strip(), mode="eval").body):
        if isinstance(node, ast.Attribute) or (isinstance(node, ast.Name) and node.id not in CALLS):
            names = [*_chain(node)]
            try:
                pick(message, tuple(names[names[:1] == ["m"] :]))
            except LookupError as error:
                return str(error.args[0])
    return ""


def _chain(node: ast.expr) -> Iterator[str]:
    """The names of a field's path; none if the path has anything but names."""
    if isinstance(node, ast.Attribute) and (inner := [*_chain(node.value)]):
        yield from [*inner, node.attr]
    elif isinstance(node, ast.Name):
        yield node.id


class _Lookups(ast.NodeTransformer):
    """Turns `m.linear.x` and `linear.x` into `m["linear"]["x"]`. Raises ValueError for a part that is not ALLOWED."""

    def __init__(self, text: str) -> None:
        self._text = text

    def visit(self, node: ast.AST) -> Any:
        """The replacement of a part."""
        operators = (part for part in ast.iter_child_nodes(node) if not hasattr(part, "lineno"))
        value = node.value if isinstance(node, ast.Constant) else None
        is_plain = value is None or isinstance(value, bool | int | float | str)
        if not is_plain or not all(isinstance(part, ALLOWED) for part in (node, *operators)):
            self._refuse(node)
        return super().visit(node)

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """The message, or one of its fields."""
        return node if node.id == "m" else _item(ast.Name("m", ast.Load()), node.id)

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        """A field of a field."""
        return _item(self.visit(node.value), node.attr)

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        """Arithmetic on numbers only: a string times a billion would fill the memory."""
        left, right = (
            ast.Call(ast.Name("number", ast.Load()), [self.visit(one)], []) for one in (node.left, node.right)
        )
        return ast.BinOp(left, node.op, right)

    def visit_Call(self, node: ast.Call) -> ast.expr:
        """A call of one of CALLS."""
        if not isinstance(node.func, ast.Name) or node.func.id not in CALLS or len(node.args) != 1 or node.keywords:
            self._refuse(node)
        return ast.Call(node.func, [self.visit(node.args[0])], [])

    def _refuse(self, node: ast.AST) -> NoReturn:
        part = ast.get_source_segment(self._text, node) or self._text
        raise ValueError(f"filter: {part!r} is not allowed; use fields, numbers, texts, comparisons,"
                         " and, or, not, in, + - * / %, abs(), len()")  # fmt: skip


def _item(owner: ast.expr, name: str) -> ast.expr:
    return ast.Subscript(owner, ast.Constant(name), ast.Load())


def _number(value: Any) -> float:
    if not isinstance(value, int | float):
        raise TypeError
    return value
