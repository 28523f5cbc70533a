"""A sim that only keeps what it receives."""

from typing import TypeVar

import pytest

from holozen.messages import Point, Pose, PoseStamped, Quaternion
from holozen.messages import simulation_interfaces as si
from holozen.testing import Wire
from holozen.transport.errors import ServiceError

OK = si.Result(si.Result.OK)
Request = TypeVar("Request", si.DeleteEntityRequest, si.GetEntityStateRequest)


class FakeSim:
    """`entities` by name; `refusal` and `warnings` are for the next spawn, `log` the services that
    were called.
    """

    def __init__(self, wire: Wire) -> None:
        self.entities: dict[str, si.SpawnEntityRequest] = {}
        self.refusal = self.warnings = ""
        self.log: list[str] = []
        bus = wire.bus("sim")
        bus.serve("spawn_entity", si.SpawnEntityRequest, si.SpawnEntityReply, self.spawn).start()
        bus.serve(
            "delete_entity", si.DeleteEntityRequest, si.DeleteEntityReply, self.delete
        ).start()
        bus.serve("get_entities", si.GetEntitiesRequest, si.GetEntitiesReply, self.names).start()
        bus.serve(
            "get_entity_state", si.GetEntityStateRequest, si.GetEntityStateReply, self.state
        ).start()

    def spawn(self, request: si.SpawnEntityRequest) -> si.SpawnEntityReply:
        self.log.append("spawn")
        if self.refusal:
            raise ServiceError(
                self.refusal,
                result={
                    "result": si.SpawnEntityReply.RESOURCE_PARSE_ERROR,
                    "error_message": self.refusal,
                },
            )
        if request.name in self.entities:
            taken = f"there is an entity {request.name!r} already"
            raise ServiceError(
                taken,
                result={"result": si.SpawnEntityReply.NAME_NOT_UNIQUE, "error_message": taken},
            )
        self.entities[request.name] = request
        return si.SpawnEntityReply(si.Result(si.Result.OK, self.warnings), request.name)

    def delete(self, request: si.DeleteEntityRequest) -> si.DeleteEntityReply:
        self.log.append("delete")
        del self.entities[self.known(request)]
        return si.DeleteEntityReply(OK)

    def names(self, _request: si.GetEntitiesRequest) -> si.GetEntitiesReply:
        return si.GetEntitiesReply(OK, entities=list(self.entities))

    def state(self, request: si.GetEntityStateRequest) -> si.GetEntityStateReply:
        pose = self.entities[self.known(request)].initial_pose.pose
        return si.GetEntityStateReply(OK, state=si.EntityState(pose=pose))

    def known(self, request: Request) -> str:
        if request.entity not in self.entities:
            raise ServiceError(
                f"there is no entity {request.entity!r}; there are {', '.join(self.entities)}"
            )
        return request.entity

    def put(
        self, name: str, x: float = 0.0, y: float = 0.0, z: float = 0.0, q: Quaternion | None = None
    ) -> None:
        """An entity that is there already."""
        pose = Pose(Point(x, y, z), q or Quaternion())
        self.entities[name] = si.SpawnEntityRequest(name=name, initial_pose=PoseStamped(pose=pose))


@pytest.fixture
def sim(wire: Wire) -> FakeSim:
    """A sim with nothing in it."""
    return FakeSim(wire)
