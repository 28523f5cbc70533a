"""The part of ROS's simulation_interfaces (1.0) that the sim serves.

An entity is a robot or another object in the world. Reply codes are those of `Result`, and above
100 those of SpawnEntity. A request that fails is answered with an error reply, which carries the
same `result`.
"""

from typing import ClassVar

from msgspec import field

from holozen.messages.action import Action, ActionPart
from holozen.messages.geometry_msgs import Accel, Pose, PoseStamped, Twist, Vector3
from holozen.messages.message import Message, UInt8, UInt64
from holozen.messages.std_msgs import Header


class Result(Message):
    """How a request ended: `OK`, or another code with a line that gives the reason.

    When a robot was spawned although something in its text was replaced or left out, the result is
    `OK` and `error_message` holds the warnings, one per line.
    """

    FEATURE_UNSUPPORTED: ClassVar[UInt8] = 0
    OK: ClassVar[UInt8] = 1
    NOT_FOUND: ClassVar[UInt8] = 2
    INCORRECT_STATE: ClassVar[UInt8] = 3
    OPERATION_FAILED: ClassVar[UInt8] = 4

    result: UInt8 = 0
    error_message: str = ""


class EntityState(Message):
    """The pose and the motion of an entity, in the world frame."""

    header: Header = field(default_factory=Header)
    pose: Pose = field(default_factory=Pose)
    twist: Twist = field(default_factory=Twist)
    acceleration: Accel = field(default_factory=Accel)


class TagsFilter(Message):
    FILTER_MODE_ANY: ClassVar[UInt8] = 0
    FILTER_MODE_ALL: ClassVar[UInt8] = 1

    tags: list[str] = field(default_factory=list)
    filter_mode: UInt8 = 0


class Bounds(Message):
    TYPE_BOX: ClassVar[UInt8] = 0
    TYPE_CONVEX_HULL: ClassVar[UInt8] = 1
    TYPE_SPHERE: ClassVar[UInt8] = 2

    type: UInt8 = 0
    points: list[Vector3] = field(default_factory=list)


class EntityCategory(Message):
    CATEGORY_UNKNOWN: ClassVar[UInt8] = 0
    CATEGORY_OBJECT: ClassVar[UInt8] = 1
    CATEGORY_ROBOT: ClassVar[UInt8] = 2
    CATEGORY_HUMAN: ClassVar[UInt8] = 3
    CATEGORY_DYNAMIC_OBJECT: ClassVar[UInt8] = 4
    CATEGORY_STATIC_OBJECT: ClassVar[UInt8] = 5

    category: UInt8 = 0


class EntityFilters(Message):
    """Selects entities. `filter` is a regular expression on their names; an empty one selects
    all.
    """

    filter: str = ""
    categories: list[EntityCategory] = field(default_factory=list)
    tags: TagsFilter = field(default_factory=TagsFilter)
    bounds: Bounds = field(default_factory=Bounds)


class SpawnEntityRequest(Message):
    """A robot or object from `resource_string`, URDF or SDF text (clients expand xacro).

    Its keys are below `entity_namespace`, by default below `name`; a slash is the root. With
    `allow_renaming`, or without a name, an unused name is chosen.
    """

    name: str = ""
    allow_renaming: bool = False
    uri: str = ""
    resource_string: str = ""
    entity_namespace: str = ""
    initial_pose: PoseStamped = field(default_factory=PoseStamped)


class SpawnEntityReply(Message):
    NAME_NOT_UNIQUE: ClassVar[UInt8] = 101
    NAME_INVALID: ClassVar[UInt8] = 102
    UNSUPPORTED_FORMAT: ClassVar[UInt8] = 103
    NO_RESOURCE: ClassVar[UInt8] = 104
    NAMESPACE_INVALID: ClassVar[UInt8] = 105
    RESOURCE_PARSE_ERROR: ClassVar[UInt8] = 106
    MISSING_ASSETS: ClassVar[UInt8] = 107
    UNSUPPORTED_ASSETS: ClassVar[UInt8] = 108
    INVALID_POSE: ClassVar[UInt8] = 109

    result: Result = field(default_factory=Result)
    entity_name: str = ""


class DeleteEntityRequest(Message):
    entity: str = ""


class DeleteEntityReply(Message):
    result: Result = field(default_factory=Result)


class GetEntitiesRequest(Message):
    filters: EntityFilters = field(default_factory=EntityFilters)


class GetEntitiesReply(Message):
    result: Result = field(default_factory=Result)
    entities: list[str] = field(default_factory=list)


class GetEntityStateRequest(Message):
    entity: str = ""


class GetEntityStateReply(Message):
    result: Result = field(default_factory=Result)
    state: EntityState = field(default_factory=EntityState)


class SetEntityStateRequest(Message):
    entity: str = ""
    state: EntityState = field(default_factory=EntityState)


class SetEntityStateReply(Message):
    result: Result = field(default_factory=Result)


class SimulationState(Message):
    """Stopped is paused and reset, before the first step."""

    STATE_STOPPED: ClassVar[UInt8] = 0
    STATE_PLAYING: ClassVar[UInt8] = 1
    STATE_PAUSED: ClassVar[UInt8] = 2
    STATE_QUITTING: ClassVar[UInt8] = 3

    state: UInt8 = 0


class GetSimulationStateRequest(Message):
    pass


class GetSimulationStateReply(Message):
    state: SimulationState = field(default_factory=SimulationState)
    result: Result = field(default_factory=Result)


class SetSimulationStateRequest(Message):
    state: SimulationState = field(default_factory=SimulationState)


class SetSimulationStateReply(Message):
    """The result is `ALREADY_IN_TARGET_STATE` if there was nothing to do; that is no error."""

    ALREADY_IN_TARGET_STATE: ClassVar[UInt8] = 101
    STATE_TRANSITION_ERROR: ClassVar[UInt8] = 102
    INCORRECT_TRANSITION: ClassVar[UInt8] = 103

    result: Result = field(default_factory=Result)


class StepSimulationRequest(Message):
    """`steps` of a sim that is paused; the reply comes after the last of them."""

    steps: UInt64 = 1


class StepSimulationReply(Message):
    result: Result = field(default_factory=Result)


class ResetSimulationRequest(Message):
    """`scope` is a sum: SCOPE_TIME sets the time to zero, SCOPE_STATE moves every entity to where
    it was added, SCOPE_SPAWNED removes those that were spawned. All of them, the default, also
    restore entities of the start that were deleted.
    """

    SCOPE_DEFAULT: ClassVar[UInt8] = 0
    SCOPE_TIME: ClassVar[UInt8] = 1
    SCOPE_STATE: ClassVar[UInt8] = 2
    SCOPE_SPAWNED: ClassVar[UInt8] = 4
    SCOPE_ALL: ClassVar[UInt8] = 255

    scope: UInt8 = 0


class ResetSimulationReply(Message):
    result: Result = field(default_factory=Result)


class SimulateStepsGoal(ActionPart):
    """As the service step_simulation, with the progress as feedback."""

    steps: UInt64 = 0


class SimulateStepsResult(ActionPart):
    result: Result = field(default_factory=Result)


class SimulateStepsFeedback(ActionPart):
    completed_steps: UInt64 = 0
    remaining_steps: UInt64 = 0


SimulateSteps = Action(SimulateStepsGoal, SimulateStepsResult, SimulateStepsFeedback)
