"""The parameters of a running node: named values that can be read and set, each within its range.

They are served as in ROS 2's rcl_interfaces, on `<node>/list_parameters`, `get_parameters`,
`set_parameters` and `describe_parameters`. A request to set several is applied as a whole or not at
all.
"""

import threading
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from msgspec import Struct

from holozen.console import report
from holozen.messages import rcl_interfaces as r
from holozen.suggest import shorten, suggest
from holozen.transport.errors import BusError, ServiceError
from holozen.transport.graph import PARAMETERS
from holozen.transport.services import Server, answer_in_turn

if TYPE_CHECKING:
    from holozen.bus import Bus

MAX_NAMES = 1000  # names in one request
MAX_SHOWN = 80  # characters of a value or a name in a message
# s for another node of the same name to be discovered, and between two looks for it
TWIN_WAIT, TWIN_LOOK = (1.0, 0.05)
ELSE = "not set, since another parameter of the request was refused"


class Number(Struct, frozen=True):
    """A number from `low` to `high`. `write` gets a value in range; it must not fail."""

    name: str
    about: str
    unit: str
    low: float
    high: float
    read: Callable[[], float]
    write: Callable[[Any], None]

    def checked(self, value: Any) -> float:
        """`value` if it is allowed. Raises ValueError with the allowed values."""
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        # Its present value, such as one from a robot's file, is always allowed.
        if is_number and (self.low <= value <= self.high or value == self.read()):
            return float(value)
        wanted = f"use a number from {self.low:g} to {self.high:g} {self.unit}".rstrip()
        raise ValueError(f"{self.name}: {_shown(value)}: {wanted}")

    def described(self) -> r.ParameterDescriptor:
        """Its description and allowed values."""
        about = f"{self.about}, in {self.unit}" if self.unit else self.about
        return r.ParameterDescriptor(
            self.name, r.DOUBLE, about, floating_point_range=r.number_range(self.low, self.high)
        )


class Choice(Struct, frozen=True):
    """One of several words. Without a `write` it is read-only."""

    name: str
    about: str
    words: tuple[str, ...]
    read: Callable[[], str]
    write: Callable[[Any], None] | None = None

    def checked(self, value: Any) -> str:
        """`value` if it is allowed. Raises ValueError with the allowed values."""
        if isinstance(value, str) and (
            value == self.read() or (self.write and value in self.words)
        ):
            return value
        if self.write is None:
            raise ValueError(f"{self.name}: it is read-only")
        raise ValueError(f"{self.name}: {_shown(value)}: use one of {', '.join(self.words)}")

    def described(self) -> r.ParameterDescriptor:
        """Its description and allowed values."""
        words = f"one of {', '.join(self.words)}" if self.words else ""
        return r.ParameterDescriptor(
            self.name, r.STRING, self.about, words, read_only=self.write is None
        )


Parameter = Number | Choice


class Parameters:
    """Serves the parameters that `declared` returns. Call `answer()` in a loop, or `start()`
    once.
    """

    def __init__(
        self,
        bus: "Bus",
        node: str,
        declared: Callable[[], Iterable[Parameter]],
        report: Callable[[str], None] = report,
    ) -> None:
        self._node, self._declared, self._report = node, declared, report
        self._lock = threading.Lock()  # no reads of a partly applied request
        self._set_server = bus.serve(
            f"{node}/set_parameters", r.SetParametersRequest, r.SetParametersReply, self._set
        )
        self._servers: list[Server] = [
            self._set_server,
            bus.serve(
                f"{node}/get_parameters", r.GetParametersRequest, r.GetParametersReply, self._get
            ),
            bus.serve(
                f"{node}/describe_parameters",
                r.DescribeParametersRequest,
                r.DescribeParametersReply,
                self._describe,
            ),
            # Last: when its token appears, the others are there.
            bus.serve(
                f"{node}/list_parameters",
                r.ListParametersRequest,
                r.ListParametersReply,
                self._list,
            ),
        ]

    def answer(self) -> bool:
        """Answer waiting requests, for a short time. Returns whether it answered any."""
        return answer_in_turn(self._servers)

    def start(self) -> None:
        """Answer from threads, until the bus is closed."""
        for server in self._servers:
            server.start()

    def _list(self, request: r.ListParametersRequest) -> r.ListParametersReply:
        """The names below some prefixes, and their prefixes."""
        names = [name for name in self._known() if is_below(name, request.prefixes, request.depth)]
        prefixes = sorted({name.rpartition(".")[0] for name in names} - {""})
        return r.ListParametersReply(r.ListParametersResult(names, prefixes))

    def _get(self, request: r.GetParametersRequest) -> r.GetParametersReply:
        """The values of some parameters. Raises ServiceError for an unknown name."""
        with self._lock:
            return r.GetParametersReply(
                [r.ParameterValue.of(each.read()) for each in self._named(request.names)]
            )

    def _describe(self, request: r.DescribeParametersRequest) -> r.DescribeParametersReply:
        """The descriptions of some parameters. Raises ServiceError for an unknown name."""
        return r.DescribeParametersReply([each.described() for each in self._named(request.names)])

    def _set(self, request: r.SetParametersRequest) -> r.SetParametersReply:
        """Set all parameters of a request, or none: one result for each, with the reason of a
        refusal.
        """
        _check_count(request.parameters)
        with self._lock:
            known = self._known()
            reasons = [self._fault(each, known) for each in request.parameters]
            names = [each.name for each in request.parameters]
            if twice := next((name for name in names if names.count(name) > 1), ""):
                reasons = [f"{twice[:MAX_SHOWN]!r} is set twice in one request"] * len(names)
            if any(reasons):
                return r.SetParametersReply(
                    [r.SetParametersResult(False, reason or ELSE) for reason in reasons]
                )
            for each in request.parameters:
                self._write(known[each.name], each.value.plain())
        return r.SetParametersReply([r.SetParametersResult(True) for _ in names])

    def _write(self, parameter: Parameter, value: object) -> None:
        before, unit = parameter.read(), getattr(parameter, "unit", "")
        now = parameter.checked(value)
        if now == before or parameter.write is None:
            return
        parameter.write(now)
        by = self._set_server.caller or "an unknown caller"
        text = f"{_formatted(now)} {unit}".rstrip()
        self._report(
            f"{self._node}: {parameter.name} is {text} (was {_formatted(before)}), set by {by}"
        )

    def _fault(self, asked: r.Parameter, known: dict[str, Parameter]) -> str:
        if asked.name not in known:
            return unknown(self._node, asked.name, known)
        try:
            known[asked.name].checked(asked.value.plain())
        except ValueError as error:
            return str(error)
        return ""

    def _named(self, names: list[str]) -> list[Parameter]:
        _check_count(names)
        known = self._known()
        for name in names:
            if name not in known:
                raise ServiceError(unknown(self._node, name, known))
        return [known[name] for name in names]

    def _known(self) -> dict[str, Parameter]:
        return {parameter.name: parameter for parameter in self._declared()}


def warn_of_twin(bus: "Bus", node: str) -> None:
    """Report, soon after this returns, another process whose parameters have the name of this
    `node` too.
    """

    def look() -> None:
        with suppress(BusError), bus.graph(PARAMETERS.replace("**", node)) as graph:
            until = time.monotonic() + TWIN_WAIT
            while time.monotonic() < until:
                if twin := next((end for end in graph.endpoints() if end.session != bus.id), None):
                    report(f"{node}: {twin.source} does the same already; end one of the two")
                    return
                time.sleep(TWIN_LOOK)

    threading.Thread(target=look, daemon=True).start()


def unknown(node: str, name: str, known: Iterable[str]) -> str:
    """The error for an unknown parameter, with the closest name or the known ones."""
    names = list(known)
    hint = suggest(name[:MAX_SHOWN], names) or f"; it has {', '.join(names[:20])}"
    return f"{node} has no parameter {name[:MAX_SHOWN]!r}{hint}"


def _check_count(asked: list[r.Parameter] | list[str]) -> None:
    if len(asked) > MAX_NAMES:
        raise ServiceError(f"{len(asked)} parameters in one request; at most {MAX_NAMES}")


def is_below(name: str, prefixes: list[str], depth: int) -> bool:
    """Whether ListParameters includes a name."""
    rests = [name[len(p) + 1 :] for p in prefixes if name.startswith(f"{p}.")] or [""] * (
        name in prefixes
    )
    rests = rests if prefixes else [name]
    return any(not depth or rest.count(".") < depth for rest in rests)


def _shown(value: object) -> str:
    text = (
        "no value"
        if value is None
        else _formatted(value)
        if isinstance(value, float)
        else repr(value)
    )
    return shorten(text, MAX_SHOWN)


def _formatted(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
