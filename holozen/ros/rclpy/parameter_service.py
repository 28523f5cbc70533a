"""The parameter services of a node under ROS's names: `<node>/get_parameters` and so on. Answered while it is spun."""

from collections.abc import Callable
from typing import Any

from holozen.ros.generated import find
from holozen.ros.rclpy import names
from holozen.ros.rclpy.parameter import Parameter, ParameterStore, set_result
from holozen.ros.rclpy.qos import qos_profile_parameters
from holozen.ros.rclpy.service import Refusal
from holozen.transport.parameters import ELSE, MAX_NAMES, unknown

Answer = Callable[[Any, Any], None]


def serve(node: Any, full_name: str, store: ParameterStore) -> None:
    """Provide the services of a node with that absolute name and those parameters."""
    services = _ParameterServices(node, names.key(full_name), store)
    for name, answer in services.answers().items():
        kind = find(f"rcl_interfaces/srv/{name.title().replace('_', '')}")
        place = names.join(full_name, name)
        node.create_service(kind, place, services.checked(answer), qos_profile=qos_profile_parameters)


class _ParameterServices:
    def __init__(self, node: Any, key: str, store: ParameterStore) -> None:
        self._node, self._key, self._store = node, key, store

    def answers(self) -> dict[str, Answer]:
        """Name of a service -> the function that fills in a response."""
        return {
            "describe_parameters": self._describe, "get_parameter_types": self._types, "get_parameters": self._get,
            "set_parameters": self._set, "set_parameters_atomically": self._set_atomically,
            # Last: once it is in the graph the others are as well.
            "list_parameters": self._list,
        }  # fmt: skip

    def checked(self, answer: Answer) -> Callable[[Any, Any], Any]:
        """A callback that refuses requests with too many parameters or with unknown ones."""

        def callback(request: Any, response: Any) -> Any:
            requested: list[Any] = getattr(request, "names", None) or getattr(request, "parameters", [])
            if len(requested) > MAX_NAMES:
                raise Refusal(f"{len(requested)} parameters in one request; at most {MAX_NAMES}")
            for name in getattr(request, "names", ()):
                if reason := self._unknown(name):
                    raise Refusal(reason)
            answer(request, response)
            return response

        return callback

    def _unknown(self, name: str) -> str:
        """The reason to refuse a parameter that the node neither has nor allows; empty for any other."""
        is_allowed = name in self._store.values or self._store.allow_undeclared
        return "" if is_allowed else unknown(self._key, name, self._store.values)

    def _describe(self, request: Any, response: Any) -> None:
        response.descriptors = self._node.describe_parameters(request.names)

    def _types(self, request: Any, response: Any) -> None:
        response.types = [kind.value for kind in self._node.get_parameter_types(request.names)]

    def _get(self, request: Any, response: Any) -> None:
        """A parameter without a value has the type NOT_SET."""
        values = self._store.values
        response.values = [(values.get(name) or Parameter(name)).get_parameter_value() for name in request.names]

    def _list(self, request: Any, response: Any) -> None:
        response.result = self._node.list_parameters(request.prefixes, request.depth)

    def _set(self, request: Any, response: Any) -> None:
        """Set all or none, as every holozen node does."""
        reasons = self._rejections(request.parameters)
        if not any(reasons):
            reason = self._store.set([Parameter.from_parameter_msg(each) for each in request.parameters])
            reasons = [reason, *[reason and ELSE] * len(reasons[1:])] if reasons else []
        elif len(reasons) > 1:
            reasons = [reason or ELSE for reason in reasons]
        response.results = [set_result(reason) for reason in reasons]

    def _set_atomically(self, request: Any, response: Any) -> None:
        reason = next(filter(None, self._rejections(request.parameters)), "")
        response.result = set_result(
            reason or self._store.set([Parameter.from_parameter_msg(each) for each in request.parameters])
        )

    def _rejections(self, requested: Any) -> list[str]:
        """Rejections found before user callbacks run, one for each parameter; empty for those that may be set."""
        reasons, seen = [], set()
        for each in requested:
            reason = f"{each.name!r} is set twice in one request" if each.name in seen else self._unknown(each.name)
            seen.add(each.name)
            try:
                reason = reason or self._store.rejection(Parameter.from_parameter_msg(each))
            except (TypeError, ValueError, RuntimeError) as error:
                reason = str(error)
            reasons.append(reason)
        return reasons
