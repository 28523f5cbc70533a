"""The parameters of a running node: values with a name that can be read and set, each within what it allows.

They are served as ROS 2's rcl_interfaces has them, on `<node>/list_parameters`, `get_parameters`, `set_parameters` and
`describe_parameters`. A request to set is done as a whole or not at all.
"""

import difflib
import threading
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from holozen import rcl_interfaces as r
from holozen.errors import ServiceError
from holozen.tell import say

if TYPE_CHECKING:
    from holozen.bus import Bus
    from holozen.server import Server

MOST = 1000  # names in one request
LONGEST = 80  # characters of a value or a name that is told
ELSE = "not set, since another one of the request was refused"


@dataclass(frozen=True, slots=True)
class Number:
    """A number from `low` to `high`. `write` takes what is within; it must not fail."""

    name: str
    about: str
    unit: str
    low: float
    high: float
    read: Callable[[], float]
    write: Callable[[Any], None]

    def checked(self, value: Any) -> float:
        """`value` if it may be set. Raises ValueError with what may."""
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        # What it has already, from a robot's file say, is no change.
        if is_number and (self.low <= value <= self.high or value == self.read()):
            return float(value)
        wanted = f"use a number from {self.low:g} to {self.high:g} {self.unit}".rstrip()
        raise ValueError(f"{self.name}: {_shown(value)}: {wanted}")

    def described(self) -> r.ParameterDescriptor:
        """What it is and what it takes."""
        about = f"{self.about}, in {self.unit}" if self.unit else self.about
        return r.ParameterDescriptor(
            self.name, r.DOUBLE, about, floating_point_range=r.number_range(self.low, self.high)
        )


@dataclass(frozen=True, slots=True)
class Choice:
    """One of some words. Without a `write` it can only be read."""

    name: str
    about: str
    words: tuple[str, ...]
    read: Callable[[], str]
    write: Callable[[Any], None] | None = None

    def checked(self, value: Any) -> str:
        """`value` if it may be set. Raises ValueError with what may."""
        if isinstance(value, str) and (value == self.read() or (self.write and value in self.words)):
            return value
        if self.write is None:
            raise ValueError(f"{self.name}: it can only be read")
        raise ValueError(f"{self.name}: {_shown(value)}: use one of {', '.join(self.words)}")

    def described(self) -> r.ParameterDescriptor:
        """What it is and what it takes."""
        words = f"one of {', '.join(self.words)}" if self.words else ""
        return r.ParameterDescriptor(self.name, r.STRING, self.about, words, read_only=self.write is None)


Parameter = Number | Choice


class Parameters:
    """Serves what `declared` gives when a request comes. Call `answer()` in a loop, or `start()` once."""

    def __init__(
        self, bus: "Bus", node: str, declared: Callable[[], Iterable[Parameter]], say: Callable[[str], None] = say
    ) -> None:
        self._node, self._declared, self._say = node, declared, say
        self._lock = threading.Lock()  # nobody reads while a request is half done
        self._set_server = bus.serve(
            f"{node}/set_parameters", r.SetParametersRequest, r.SetParametersReply, self._set
        )  # fmt: skip
        self._servers: list[Server] = [
            self._set_server,
            bus.serve(f"{node}/get_parameters", r.GetParametersRequest, r.GetParametersReply, self._get),
            bus.serve(
                f"{node}/describe_parameters", r.DescribeParametersRequest, r.DescribeParametersReply, self._describe
            ),
            # Last: who sees its token knows that the others are there.
            bus.serve(f"{node}/list_parameters", r.ListParametersRequest, r.ListParametersReply, self._list),
        ]

    def answer(self) -> None:
        """Answer of each kind one request that waits."""
        for server in self._servers:
            server.answer_pending(most=1)

    def start(self) -> None:
        """Answer from threads, until the bus is closed."""
        for server in self._servers:
            server.start()

    def _list(self, request: r.ListParametersRequest) -> r.ListParametersReply:
        """The names below some prefixes, and the prefixes that they have."""
        names = [name for name in self._known() if is_below(name, request.prefixes, request.depth)]
        prefixes = sorted({name.rpartition(".")[0] for name in names} - {""})
        return r.ListParametersReply(r.ListParametersResult(names, prefixes))

    def _get(self, request: r.GetParametersRequest) -> r.GetParametersReply:
        """The values of some parameters. Raises ServiceError for a name that there is not."""
        with self._lock:
            return r.GetParametersReply([r.ParameterValue.of(each.read()) for each in self._named(request.names)])

    def _describe(self, request: r.DescribeParametersRequest) -> r.DescribeParametersReply:
        """What some parameters are. Raises ServiceError for a name that there is not."""
        return r.DescribeParametersReply([each.described() for each in self._named(request.names)])

    def _set(self, request: r.SetParametersRequest) -> r.SetParametersReply:
        """Set all of a request, or none: one result for each, with the reason why not."""
        _few(request.parameters)
        with self._lock:
            known = self._known()
            reasons = [self._fault(each, known) for each in request.parameters]
            names = [each.name for each in request.parameters]
            if twice := next((name for name in names if names.count(name) > 1), ""):
                reasons = [f"{twice[:LONGEST]!r} is set twice in one request"] * len(names)
            if any(reasons):
                return r.SetParametersReply([r.SetParametersResult(False, reason or ELSE) for reason in reasons])
            for each in request.parameters:
                self._write(known[each.name], each.value.plain())
        return r.SetParametersReply([r.SetParametersResult(True) for _ in names])

    def _write(self, parameter: Parameter, value: object) -> None:
        before, unit = parameter.read(), getattr(parameter, "unit", "")
        now = parameter.checked(value)
        if now == before or parameter.write is None:
            return
        parameter.write(now)
        by = self._set_server.caller or "somebody"
        told = f"{_told(now)} {unit}".rstrip()
        self._say(f"{self._node}: {parameter.name} is {told} (was {_told(before)}), set by {by}")

    def _fault(self, asked: r.Parameter, known: dict[str, Parameter]) -> str:
        if asked.name not in known:
            return unknown(self._node, asked.name, known)
        try:
            known[asked.name].checked(asked.value.plain())
        except ValueError as error:
            return str(error)
        return ""

    def _named(self, names: list[str]) -> list[Parameter]:
        _few(names)
        known = self._known()
        for name in names:
            if name not in known:
                raise ServiceError(unknown(self._node, name, known))
        return [known[name] for name in names]

    def _known(self) -> dict[str, Parameter]:
        return {parameter.name: parameter for parameter in self._declared()}


def unknown(node: str, name: str, known: Iterable[str]) -> str:
    """That a node has no parameter of that name, with the closest one or those that it has."""
    close = difflib.get_close_matches(name, list(known), 1)
    hint = f"did you mean {close[0]}?" if close else f"it has {', '.join(list(known)[:20])}"
    return f"{node} has no parameter {name[:LONGEST]!r}; {hint}"


def _few(asked: list[r.Parameter] | list[str]) -> None:
    if len(asked) > MOST:
        raise ServiceError(f"{len(asked)} parameters in one request; at most {MOST}")


def is_below(name: str, prefixes: list[str], depth: int) -> bool:
    """Whether ListParameters takes a name."""
    rests = [name[len(p) + 1 :] for p in prefixes if name.startswith(f"{p}.")] or [""] * (name in prefixes)
    rests = rests if prefixes else [name]
    return any(not depth or rest.count(".") < depth for rest in rests)


def _shown(value: object) -> str:
    text = "no value" if value is None else _told(value) if isinstance(value, float) else repr(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]} ..."


def _told(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
