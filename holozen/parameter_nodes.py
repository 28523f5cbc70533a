"""The parameters of other nodes: who has any, and requests to read and set them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from holozen.background import background
from holozen.bus import Bus
from holozen.process import deferred_interrupt
from holozen.suggest import suggest
from holozen.transport.errors import BusError, NoReply
from holozen.transport.graph import UNREACHED

if TYPE_CHECKING:
    from holozen.messages import rcl_interfaces as r

LIST = "/list_parameters"


class Nodes:
    """The nodes with parameters (by name, their sessions), and the requests to them."""

    def __init__(self, bus: Bus, timeout: float) -> None:
        self._bus, self._timeout = bus, timeout
        self.sessions: dict[str, list[str]] = {}
        looking = background(bus.endpoints)
        with deferred_interrupt():  # while nodes are discovered
            from holozen.messages import codec, rcl_interfaces  # noqa: F401
        for endpoint in looking():
            if endpoint.kind == "srv" and endpoint.key.endswith(LIST):
                self.sessions.setdefault(endpoint.key.removesuffix(LIST), []).append(
                    endpoint.session[:6]
                )

    def only(self, name: str) -> str:
        """`name`, if exactly one node has it. Raises BusError that lists the nodes found."""
        found = self.sessions.get(name, [])
        if len(found) > 1:
            raise BusError(
                f"{self.twins(name)}; a request would reach any of them: end all but one"
            )
        if not found:
            if hung := [end.source for end in self._bus.hidden() if end.key == f"{name}{LIST}"]:
                raise BusError(UNREACHED.format(source=hung[0]))
            raise BusError(f"there is no node {name!r} with parameters{self._known(name)}")
        return name

    def twins(self, name: str) -> str:
        """The message that several nodes share a name."""
        found = self.sessions[name]
        return f"{len(found)} nodes are called {name!r} ({', '.join(sorted(found))})"

    def names(self, node: str, prefixes: list[str] = []) -> list[str]:
        """The parameters of a node, sorted."""
        return sorted(self._call(node, "list_parameters", prefixes).result.names)

    def values(self, node: str, names: list[str]) -> list[r.ParameterValue]:
        """The values of the named parameters."""
        return _as_many(self._call(node, "get_parameters", names).values, names, node)

    def descriptors(self, node: str, names: list[str]) -> list[r.ParameterDescriptor]:
        """The descriptors of the named parameters."""
        return _as_many(self._call(node, "describe_parameters", names).descriptors, names, node)

    def set(self, node: str, wanted: dict[str, Any]) -> list[r.SetParametersResult]:
        """Set parameters, all or none of them."""
        from holozen.messages import rcl_interfaces as r

        parameters = [
            r.Parameter(name, r.ParameterValue.of(value)) for name, value in wanted.items()
        ]
        return _as_many(self._call(node, "set_parameters", parameters).results, parameters, node)

    def _call(self, node: str, verb: str, *fields: Any) -> Any:
        """The reply of a node's service to a request with these fields."""
        from holozen.messages import named
        from holozen.messages.codec import CodecError

        kind = f"rcl_interfaces/srv/{verb.title().replace('_', '')}"
        request, reply = named(f"{kind}_Request"), named(f"{kind}_Response")
        try:
            return self._bus.call(f"{node}/{verb}", request(*fields), reply, self._timeout)
        except CodecError as error:
            raise BusError(str(error)) from None
        except NoReply:  # it was there a moment ago
            if not (found := self.sessions.get(node)):
                raise
            what = f"no reply from '{node}/{verb}' within {self._timeout:g} s"
            hung = UNREACHED.format(source=f"{node}@{found[0]}")
            raise BusError(f"{what}: {hung}") from None

    def _known(self, name: str) -> str:
        if not self.sessions:
            return "; no node has any; `holozen up` starts a robot"
        return (
            suggest(name, sorted(self.sessions))
            or f"; there are {', '.join(sorted(self.sessions))}"
        )


def _as_many(found: list[Any], asked: list[Any], node: str) -> list[Any]:
    if len(found) != len(asked):
        raise BusError(f"{node} replied with {len(found)} results for {len(asked)} parameters")
    return found
