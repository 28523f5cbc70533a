"""The messages of ROS's simulation_interfaces (1.0) that the sim serves, field for field.

An entity is a robot or another object in the world. Reply codes are those of `Result`, and above 100 those of
SpawnEntity. A request that fails is answered with an error reply, which carries the same `result`.
"""

from typing import Annotated, ClassVar

from msgspec import Meta, field

from holozen.messages import Header, Message, Pose, Twist, Vector3

FEATURE_UNSUPPORTED, OK, NOT_FOUND, INCORRECT_STATE, OPERATION_FAILED = range(5)
NAME_NOT_UNIQUE, NAME_INVALID, UNSUPPORTED_FORMAT, NO_RESOURCE, NAMESPACE_INVALID = range(101, 106)
RESOURCE_PARSE_ERROR, MISSING_ASSETS, UNSUPPORTED_ASSETS, INVALID_POSE = range(106, 110)

Byte = Annotated[int, Meta(ge=0, le=255)]


class Result(Message):
    """How a request ended: `OK`, or another code with a line that says why."""

    ROS: ClassVar[str] = "simulation_interfaces/msg/Result"
    result: Byte = OK
    error_message: str = ""


class PoseStamped(Message):
    ROS: ClassVar[str] = "geometry_msgs/msg/PoseStamped"
    header: Header = field(default_factory=Header)
    pose: Pose = field(default_factory=Pose)


class Accel(Message):
    ROS: ClassVar[str] = "geometry_msgs/msg/Accel"
    linear: Vector3 = field(default_factory=Vector3)
    angular: Vector3 = field(default_factory=Vector3)


class EntityState(Message):
    """Where an entity is and how it moves, in the world frame."""

    ROS: ClassVar[str] = "simulation_interfaces/msg/EntityState"
    header: Header = field(default_factory=Header)
    pose: Pose = field(default_factory=Pose)
    twist: Twist = field(default_factory=Twist)
    acceleration: Accel = field(default_factory=Accel)


class TagsFilter(Message):
    ROS: ClassVar[str] = "simulation_interfaces/msg/TagsFilter"
    tags: list[str] = field(default_factory=list)
    filter_mode: Byte = 0


class Bounds(Message):
    ROS: ClassVar[str] = "simulation_interfaces/msg/Bounds"
    type: Byte = 0
    points: list[Vector3] = field(default_factory=list)


class EntityCategory(Message):
    ROS: ClassVar[str] = "simulation_interfaces/msg/EntityCategory"
    category: Byte = 0


class EntityFilters(Message):
    """Which entities are asked for. `filter` is a regular expression; an empty one takes all."""

    ROS: ClassVar[str] = "simulation_interfaces/msg/EntityFilters"
    filter: str = ""
    categories: list[EntityCategory] = field(default_factory=list)
    tags: TagsFilter = field(default_factory=TagsFilter)
    bounds: Bounds = field(default_factory=Bounds)


class SpawnEntityRequest(Message):
    """A robot or object from `resource_string`, URDF or SDF text (xacro is expanded by who asks).

    `name` is also where its keys are, unless there is an `entity_namespace`; a slash there is the root. With
    `allow_renaming`, or without a name, one is made that is free. A zero in `initial_pose.position.z` with an empty
    `header.frame_id` is a height like any other.
    """

    ROS: ClassVar[str] = "simulation_interfaces/srv/SpawnEntity"
    name: str = ""
    allow_renaming: bool = False
    uri: str = ""
    resource_string: str = ""
    entity_namespace: str = ""
    initial_pose: PoseStamped = field(default_factory=PoseStamped)


class SpawnEntityReply(Message):
    ROS: ClassVar[str] = "simulation_interfaces/srv/SpawnEntity"
    result: Result = field(default_factory=Result)
    entity_name: str = ""


class DeleteEntityRequest(Message):
    ROS: ClassVar[str] = "simulation_interfaces/srv/DeleteEntity"
    entity: str = ""


class DeleteEntityReply(Message):
    ROS: ClassVar[str] = "simulation_interfaces/srv/DeleteEntity"
    result: Result = field(default_factory=Result)


class GetEntitiesRequest(Message):
    ROS: ClassVar[str] = "simulation_interfaces/srv/GetEntities"
    filters: EntityFilters = field(default_factory=EntityFilters)


class GetEntitiesReply(Message):
    ROS: ClassVar[str] = "simulation_interfaces/srv/GetEntities"
    result: Result = field(default_factory=Result)
    entities: list[str] = field(default_factory=list)


class GetEntityStateRequest(Message):
    ROS: ClassVar[str] = "simulation_interfaces/srv/GetEntityState"
    entity: str = ""


class GetEntityStateReply(Message):
    ROS: ClassVar[str] = "simulation_interfaces/srv/GetEntityState"
    result: Result = field(default_factory=Result)
    state: EntityState = field(default_factory=EntityState)


class SetEntityStateRequest(Message):
    ROS: ClassVar[str] = "simulation_interfaces/srv/SetEntityState"
    entity: str = ""
    state: EntityState = field(default_factory=EntityState)


class SetEntityStateReply(Message):
    ROS: ClassVar[str] = "simulation_interfaces/srv/SetEntityState"
    result: Result = field(default_factory=Result)
