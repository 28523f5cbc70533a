"""The nodes that have parameters, and what `holozen param` asks of them."""

from __future__ import annotations

from holozen.errors import BusError
from holozen.meanwhile import meanwhile

TYPE_CHECKING = False  # importing `typing` takes 3 ms
if TYPE_CHECKING:
    from typing import Any

    from holozen import rcl_interfaces as r
    from holozen.bus import Bus

LIST = "/list_parameters"
TOKENS = "@holozen/*/*/srv/rcl_interfaces/srv/ListParameters/**"


class Nodes:
    """The nodes with parameters, and what is asked of them."""

    def __init__(self, bus: Bus, timeout: float) -> None:
        self._bus, self._timeout = bus, timeout
        self.sessions: dict[str, list[str]] = {}
        looking = meanwhile(lambda: bus.graph(TOKENS).settled(bus.connected))
        from holozen import codec, rcl_interfaces  # noqa: F401 - loaded while the nodes are looked for

        for endpoint in looking():
            if endpoint.kind == "srv" and endpoint.key.endswith(LIST):
                self.sessions.setdefault(endpoint.key.removesuffix(LIST), []).append(endpoint.session[:6])

    def only(self, name: str) -> str:
        """`name` if one node has it. Raises BusError that says which there are."""
        found = self.sessions.get(name, [])
        if len(found) > 1:
            raise BusError(f"{self.twins(name)}; a request would reach any of them: end all but one")
        if not found:
            raise BusError(f"there is no node {name!r} with parameters; {self._there(name)}")
        return name

    def twins(self, name: str) -> str:
        """That more than one node has a name."""
        found = self.sessions[name]
        return f"{len(found)} nodes are called {name!r} ({', '.join(sorted(found))})"

    def names(self, node: str, prefixes: list[str] = []) -> list[str]:
        """The parameters of a node, sorted."""
        from holozen import rcl_interfaces as r

        request = r.ListParametersRequest(prefixes)
        return sorted(self._call(node, "list_parameters", request, r.ListParametersReply).result.names)

    def values(self, node: str, names: list[str]) -> list[r.ParameterValue]:
        """The values of some."""
        from holozen import rcl_interfaces as r

        reply = self._call(node, "get_parameters", r.GetParametersRequest(names), r.GetParametersReply)
        return _as_many(reply.values, names, node)

    def descriptors(self, node: str, names: list[str]) -> list[r.ParameterDescriptor]:
        """What some are."""
        from holozen import rcl_interfaces as r

        request = r.DescribeParametersRequest(names)
        reply = self._call(node, "describe_parameters", request, r.DescribeParametersReply)
        return _as_many(reply.descriptors, names, node)

    def set(self, node: str, wanted: dict[str, Any]) -> list[r.SetParametersResult]:
        """Set some, all or none of them."""
        from holozen import rcl_interfaces as r

        parameters = [r.Parameter(name, r.ParameterValue.of(value)) for name, value in wanted.items()]
        reply = self._call(node, "set_parameters", r.SetParametersRequest(parameters), r.SetParametersReply)
        return _as_many(reply.results, parameters, node)

    def _call(self, node: str, verb: str, request: Any, reply: type[Any]) -> Any:
        from holozen.codec import CodecError

        try:
            return self._bus.call(f"{node}/{verb}", request, reply, self._timeout)
        except CodecError as error:
            raise BusError(str(error)) from None

    def _there(self, name: str) -> str:
        import difflib

        if not self.sessions:
            return "no node has any; `holozen up` starts some"
        close = difflib.get_close_matches(name.replace("-", "_"), self.sessions, 1)
        return f"did you mean {close[0]}?" if close else f"there are {', '.join(sorted(self.sessions))}"


def _as_many(found: list[Any], asked: list[Any], node: str) -> list[Any]:
    if len(found) != len(asked):
        raise BusError(f"{node} gave {len(found)} answers to {len(asked)} questions")
    return found
