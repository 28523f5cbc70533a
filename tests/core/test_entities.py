"""A client hears of a refusal in whichever way the interface allows."""

import pytest

from holozen import entities
from holozen.messages import simulation_interfaces as si
from holozen.testing import Wire
from holozen.transport.errors import NoReply, ServiceError


@pytest.mark.parametrize(
    ("result", "expected"),
    [
        (si.Result(si.Result.NOT_FOUND, "no such thing"), "no such thing"),
        (si.Result(si.Result.NOT_FOUND), "delete_entity failed with result 2"),
    ],
)
def test_a_result_that_is_not_ok_is_a_refusal(wire: Wire, result: si.Result, expected: str) -> None:
    def refuse(_request: si.DeleteEntityRequest) -> si.DeleteEntityReply:
        return si.DeleteEntityReply(result)

    wire.bus("sim").serve(
        "delete_entity", si.DeleteEntityRequest, si.DeleteEntityReply, refuse
    ).start()
    with pytest.raises(ServiceError, match=f"^{expected}$"):
        entities.delete(wire.bus(), "Fred")


def test_a_sim_that_does_not_answer_in_time_is_reported(
    wire: Wire, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(entities, "PATIENCE", 0.1)
    with pytest.raises(NoReply, match=r"no reply from .get_entity_state. within 0\.1 s"):
        entities.pose(wire.bus(), "Fred")
