"""What a key takes: how a written value becomes the bytes of its type, one of ours or any interface's."""

import json
import re
from typing import TYPE_CHECKING, Any

from holozen import codec
from holozen.cli import values
from holozen.finite import not_finite
from holozen.messages import Message

if TYPE_CHECKING:
    from holozen.cli.reading import Packages
    from holozen.interfaces import Interface

TYPE = re.compile(r"\w+/((msg|srv)/)?\w+")
FORCE = "; --force sends it all the same"


class Ours:
    """A form of one of our types, the first of `kinds` that fits."""

    def __init__(self, kinds: values.Kinds, wire: str, force: bool) -> None:
        self.kind, self._kinds, self._wire, self._force = kinds[0], kinds, wire, force

    def payload(self, text: str) -> bytes:
        """The bytes of a written value; `kind` is its type from then on. Raises ValueError with the reason."""
        message = values.draft(text, self._kinds)
        self.kind = type(message)
        self._kinds = (self.kind,) if len(self._kinds) == 1 else self._kinds
        if (bad := not_finite(message)) and self._force:
            return values.forced(message, self._wire)
        if bad:
            raise ValueError(f"{self.kind.__name__}.{bad} is not a finite number{FORCE}")
        return codec.encode(message, self._wire)

    def stop(self) -> bytes | None:
        """The bytes that stop a robot; None where this is no command."""
        moves = self.kind.__name__ in ("Twist", "TwistStamped")
        return codec.encode(self.kind(), self._wire) if moves else None


class Foreign:
    """A form of any type for which there is a definition."""

    def __init__(self, interface: "Interface", wire: str, force: bool) -> None:
        self._interface, self._wire, self._force = interface, wire, force
        self.kind: type[Message] = type("Foreign", (Message,), {"ROS": interface.name, "__module__": __name__})

    def payload(self, text: str) -> bytes:
        """The bytes of a written value. Raises ValueError with the reason."""
        from holozen.interfaces.values import completed

        value: Any = completed(self._interface, values.plain(text))  # plain dicts are looked through as well
        if not self._force and (bad := not_finite(value)):
            raise ValueError(f"{bad} is not a finite number{FORCE}")
        if self._wire == "cdr":
            from holozen import cdr

            return cdr.write(self._interface, value)
        if self._wire == "msgpack":
            import msgspec

            return msgspec.msgpack.encode(value)
        return json.dumps(value).encode()

    def stop(self) -> bytes | None:
        """No command of ours."""
        return None


Form = Ours | Foreign


def named(name: str, wire: str, force: bool, packages: "Packages" = ()) -> Form:
    """The form of a type, `packages` being those of `--package`. Raises ValueError for one that nobody knows, with the
    closest there is.
    """
    given = dict(packages)
    if name.partition("/")[0] not in given and (kinds := values.kinds_named(name)):
        return Ours(kinds, wire, force)
    from holozen.interfaces import Registry

    return Foreign(Registry(given).find(name), wire, force)
