"""A sim that only keeps what it is told."""

from collections.abc import Callable
from typing import TypeVar

import pytest

from holozen import cli
from holozen import simulation_interfaces as si
from holozen.errors import ServiceError
from holozen.messages import Point, Pose, Quaternion
from holozen.testing import Wire

Request = TypeVar("Request", si.DeleteEntityRequest, si.GetEntityStateRequest)


class FakeSim:
    """`entities` by name; `refusal` is what it says to the next spawn, `log` the services that were called."""

    def __init__(self, wire: Wire) -> None:
        self.entities: dict[str, si.SpawnEntityRequest] = {}
        self.refusal = ""
        self.log: list[str] = []
        bus = wire.bus("sim")
        bus.serve("spawn_entity", si.SpawnEntityRequest, si.SpawnEntityReply, self.spawn).start()
        bus.serve("delete_entity", si.DeleteEntityRequest, si.DeleteEntityReply, self.delete).start()
        bus.serve("get_entities", si.GetEntitiesRequest, si.GetEntitiesReply, self.names).start()
        bus.serve("get_entity_state", si.GetEntityStateRequest, si.GetEntityStateReply, self.state).start()

    def spawn(self, request: si.SpawnEntityRequest) -> si.SpawnEntityReply:
        self.log.append("spawn")
        if self.refusal:
            raise ServiceError(self.refusal, result={"result": si.RESOURCE_PARSE_ERROR, "error_message": self.refusal})
        if request.name in self.entities:
            taken = f"there is an entity {request.name!r} already"
            raise ServiceError(taken, result={"result": si.NAME_NOT_UNIQUE, "error_message": taken})
        self.entities[request.name] = request
        return si.SpawnEntityReply(entity_name=request.name)

    def delete(self, request: si.DeleteEntityRequest) -> si.DeleteEntityReply:
        self.log.append("delete")
        del self.entities[self.known(request)]
        return si.DeleteEntityReply()

    def names(self, _request: si.GetEntitiesRequest) -> si.GetEntitiesReply:
        return si.GetEntitiesReply(entities=list(self.entities))

    def state(self, request: si.GetEntityStateRequest) -> si.GetEntityStateReply:
        pose = self.entities[self.known(request)].initial_pose.pose
        return si.GetEntityStateReply(state=si.EntityState(pose=pose))

    def known(self, request: Request) -> str:
        if request.entity not in self.entities:
            raise ServiceError(f"there is no entity {request.entity!r}; there are {', '.join(self.entities)}")
        return request.entity

    def put(self, name: str, x: float = 0.0, y: float = 0.0, z: float = 0.0, q: Quaternion | None = None) -> None:
        """An entity that is there already."""
        pose = Pose(Point(x, y, z), q or Quaternion())
        self.entities[name] = si.SpawnEntityRequest(name=name, initial_pose=si.PoseStamped(pose=pose))


@pytest.fixture
def sim(wire: Wire) -> FakeSim:
    """A sim with nothing in it."""
    return FakeSim(wire)


@pytest.fixture
def run(wire: Wire, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Run `holozen VERB WORDS...` in this process: exit code, output, errors."""

    def run(*words: object) -> tuple[int, str, str]:
        try:
            code = cli.main([*map(str, words), *wire.flags])
        except SystemExit as end:
            code = int(end.code or 0)
        return code, *capsys.readouterr()

    return run
