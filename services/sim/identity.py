"""What a robot is called and what it is, from which its keys follow."""

from functools import cached_property

from holozen.robot.keys import aliases, command_key, keys_of
from holozen.robot.model import Force, Pushed, RobotModel
from holozen.wire import key_for


class Identity:
    """A robot or object by its names.

    Attributes:
        name: Its name in the world.
        prefix: What its keys begin with; empty at the root.
        model: What it is made of.
    """

    def __init__(self, name: str, prefix: str, model: RobotModel) -> None:
        self.name = name
        self.prefix = prefix
        self.model = model

    @cached_property
    def drives(self) -> bool:
        """Whether cmd_vel moves it."""
        return self.model.drive is not None and not isinstance(self.model.drive.mechanism, Pushed)

    @cached_property
    def command_key(self) -> str:
        """The key of its velocity commands."""
        return command_key(self.model, self.prefix)

    @property
    def command_aliases(self) -> tuple[str, ...]:
        """The other keys on which it takes velocity commands."""
        return aliases(self.model, self.prefix)

    @property
    def namespace(self) -> str:
        """Where its services and joints are: the robot's file may give a namespace in place of a
        name.
        """
        return self.command_key.rpartition("/")[0]

    @property
    def odometry_key(self) -> str | None:
        """The key of its odometry; None without a drive."""
        return key_for(self.model.drive.odometry_topic, self.prefix) if self.model.drive else None

    @property
    def wire_name(self) -> str:
        """What `holozen stop` calls it: its prefix, or without one the namespace in its file."""
        return self.prefix or self.namespace

    @property
    def keys(self) -> list[tuple[str, str]]:
        """All its keys, each with what is there."""
        return keys_of(self.model, self.prefix)

    @cached_property
    def forces(self) -> dict[str, list[Force]]:
        """The forces that move it, by the keys of their commands."""
        found: dict[str, list[Force]] = {}
        for force in self.model.forces:
            found.setdefault(key_for(force.topic, self.prefix), []).append(force)
        return found
