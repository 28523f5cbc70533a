"""The tags inside a plugin or a `<gazebo reference>`, in the spelling of ROS 1 (commandTopic), ROS 2, or mixed."""

import re
from collections.abc import Iterator

from holozen.robot.errors import cut
from holozen.robot.tag import LARGEST, Tag, number
from holozen.wire import COMMAND_SILENCE

SMALLEST = 1e-3  # m; of a wheel's radius, and between wheels

_KEY = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]*(/[A-Za-z0-9_][A-Za-z0-9_-]*)*")
_HUMP = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")


class Settings:
    """What the children of `owner` say, by their ROS 2 spelling; of two with one name the first counts."""

    def __init__(self, owner: Tag) -> None:
        self.owner = owner
        self._tags = {_snake_case(tag.name): tag for tag in reversed(owner.children)}

    def tag(self, *names: str) -> Tag:
        """The first of `names` that is there and not empty, else an empty tag."""
        found = self._found(names)
        return Tag(names[0], {}, self.owner.place, self.owner) if found is None else found

    def each(self, *names: str) -> list[Tag]:
        """Every child called one of `names` that is not empty, in the order of the file."""
        return [tag for tag in self.owner.children if _snake_case(tag.name) in names and tag.value()]

    def word(self, *names: str) -> str:
        """What the first of `names` says, or nothing."""
        found = self._found(names)
        return "" if found is None else found.value()

    def number(self, default: float, *names: str, zero: bool = True, most: float = LARGEST) -> float:
        """A number above zero, or zero where that is allowed, up to `most`. Raises RobotError."""
        word = self.word(*names)
        value = number(word) if word else default
        if value is None or value < 0 or (value == 0 and not zero):
            told = f"is {cut(word)}; it has to be a number {'not below' if zero else 'above'} 0"
            raise self.tag(*names).wrong(told)
        if value > most and word:
            raise self.tag(*names).wrong(f"is {cut(word)}; it has to be at most {most:g}")
        return value

    def maybe(self, *names: str, most: float = LARGEST) -> float | None:
        """A number not below zero, or None if none of `names` is there. Raises RobotError."""
        return self.number(0.0, *names, most=most) if self.word(*names) else None

    def maybe_measure(self, *names: str, least: float = SMALLEST) -> float:
        """Metres, at least `least`, or 0 if none of `names` is there. Raises RobotError."""
        value = self.number(0.0, *names, zero=False) if self.word(*names) else 0.0
        if 0 < value < least:
            raise self.tag(*names).wrong(f"is {cut(self.word(*names))}; it has to be at least {least:g} m")
        return value

    def timeout(self, *names: str) -> float:
        """Seconds, or -1 for a watchdog that is off. Raises RobotError."""
        value = number(self.word(*names) or "")
        return -1.0 if value is not None and value < 0 else self.number(COMMAND_SILENCE, *names, zero=False)

    def flag(self, *names: str, default: bool = True) -> bool:
        """True, false, 1 or 0; `default` if the file says neither. Raises RobotError."""
        word = self.word(*names).lower() or str(default).lower()
        if word not in ("true", "1", "false", "0"):
            raise self.tag(*names).wrong(f"is {cut(word)}; it has to be true or false")
        return word in ("true", "1")

    def frame(self, *names: str) -> str:
        """A frame's name without the slashes that ROS 1 put before it."""
        return self.word(*names).strip("/")

    def topic(self, default: str, *names: str) -> str:
        """The key of a topic: its name, as remapped, after the namespace unless it starts with a slash.

        Raises RobotError for what cannot be a key.
        """
        remapped = dict(self._remappings())
        topic = self.word(*names) or default
        topic = remapped.get(topic.strip("/"), remapped.get(default, topic))
        key = topic if topic.startswith("/") else f"{self._namespace()}/{topic}"
        key = re.sub("/+", "/", key).strip("/")
        if not _KEY.fullmatch(key):
            problem = f"makes the topic {cut(key)}; a topic has letters, digits, '_', '-' and single '/'"
            raise self.tag(*names).wrong(problem)
        return key

    def _found(self, names: tuple[str, ...]) -> Tag | None:
        return next((self._tags[name] for name in names if name in self._tags and self._tags[name].value()), None)

    def _namespace(self) -> str:
        ros = self._tags.get("ros")
        namespace = ros.first("namespace") if ros else None
        return namespace.value() if namespace else self.word("robot_namespace")

    def _remappings(self) -> Iterator[tuple[str, str]]:
        ros = self._tags.get("ros")
        for tag in (*(ros.all("remapping") if ros else ()), *self.owner.all("remapping")):
            old, _, new = tag.value().partition(":=")
            if new.strip():
                yield old.strip().removeprefix("~").strip("/"), new.strip()


def _snake_case(name: str) -> str:
    return _HUMP.sub("_", name).lower()
