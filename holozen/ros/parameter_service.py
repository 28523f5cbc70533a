"""The services of a node's parameters, on ROS's names: `<node>/get_parameters` and so on. Answered while it spins."""

from typing import Any

from holozen.parameters import ELSE, MOST, unknown
from holozen.ros import names
from holozen.ros.parameter import Parameter
from holozen.ros.qos import qos_profile_parameters
from holozen.ros.service import Refusal


def serve(node: Any, fqn: str) -> None:
    """Serve the parameters of a node with that absolute name."""
    from holozen.ros.generated import find

    answers = {
        "DescribeParameters": _describe, "GetParameterTypes": _types, "GetParameters": _get, "SetParameters": _set,
        "SetParametersAtomically": _set_atomically,
        # Last: who sees its token knows that the others are there.
        "ListParameters": _list,
    }  # fmt: skip
    for name, answer in answers.items():
        snake = "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in name).lstrip("_")
        node.create_service(
            find(f"rcl_interfaces/srv/{name}"), names.join(fqn, snake), _bound(answer, node),
            qos_profile=qos_profile_parameters,
        )  # fmt: skip


def _bound(answer: Any, node: Any) -> Any:
    def answered(request: Any, response: Any) -> Any:
        asked: list[Any] = getattr(request, "names", None) or getattr(request, "parameters", [])
        if len(asked) > MOST:
            raise Refusal(f"{len(asked)} parameters in one request; at most {MOST}")
        for name in getattr(request, "names", ()):
            if reason := _stranger(node, name):
                raise Refusal(reason)
        answer(node, request, response)
        return response

    return answered


def _stranger(node: Any, name: str) -> str:
    """That the node has no parameter of that name, and takes none; empty if it has or would."""
    store = node._holozen.store
    is_taken = name in store.values or store.allow_undeclared
    return "" if is_taken else unknown(names.key(node._holozen.fqn), name, store.values)


def _describe(node: Any, request: Any, response: Any) -> None:
    response.descriptors = node.describe_parameters(request.names)


def _types(node: Any, request: Any, response: Any) -> None:
    response.types = [kind.value for kind in node.get_parameter_types(request.names)]


def _get(node: Any, request: Any, response: Any) -> None:
    """A parameter that has no value yet is one of type NOT_SET."""
    values = node._holozen.store.values
    response.values = [(values.get(name) or Parameter(name)).get_parameter_value() for name in request.names]


def _list(node: Any, request: Any, response: Any) -> None:
    response.result = node.list_parameters(request.prefixes, request.depth)


def _set(node: Any, request: Any, response: Any) -> None:
    """Set all or none, as every node of holozen does."""
    from holozen.ros.parameters import result

    reasons = _faults(node, request.parameters)
    if not any(reasons):
        reason = node._holozen.store.set([Parameter.from_parameter_msg(each) for each in request.parameters])
        reasons = [reason, *[reason and ELSE] * len(reasons[1:])] if reasons else []
    elif len(reasons) > 1:
        reasons = [reason or ELSE for reason in reasons]
    response.results = [result(reason) for reason in reasons]


def _set_atomically(node: Any, request: Any, response: Any) -> None:
    from holozen.ros.parameters import result

    reason = next(filter(None, _faults(node, request.parameters)), "")
    response.result = result(
        reason or node._holozen.store.set([Parameter.from_parameter_msg(each) for each in request.parameters])
    )


def _faults(node: Any, asked: Any) -> list[str]:
    """Why each cannot be set, as far as nobody needs to be asked."""
    reasons, seen = [], set()
    for each in asked:
        reason = f"{each.name!r} is set twice in one request" if each.name in seen else _stranger(node, each.name)
        seen.add(each.name)
        try:
            reason = reason or node._holozen.store.fault(Parameter.from_parameter_msg(each))
        except (TypeError, ValueError, RuntimeError) as error:
            reason = str(error)
        reasons.append(reason)
    return reasons
