"""What a person wrote as a message: its type, and its bytes."""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
from collections.abc import Sequence
from typing import Any

from holozen import wire
from holozen.cli import values
from holozen.console import Failure
from holozen.fields import as_object
from holozen.limits import not_finite
from holozen.messages import encoding_of
from holozen.messages.definitions import Interface, InterfaceError, completed, with_mappings
from holozen.messages.registry import Registry
from holozen.suggest import suggest
from holozen.transport.graph import Endpoint, on_key

FORCE = "; --force sends it all the same"


class Form:
    """Encodes values as the first of some types that fits: `kind`, once there is one."""

    def __init__(self, args: argparse.Namespace, type_names: Sequence[str]) -> None:
        """Raises ValueError for an unknown type, with the most similar one."""
        registry = Registry(dict(args.package))
        self._kinds = [registry.find(name) for name in type_names]
        self.kind, self._wire, self._force = self._kinds[0], args.wire, args.force
        # A package that is given has its own types, whatever their names are here.
        ours = not any(
            name.startswith(f"{package}/") for package, _ in args.package for name in type_names
        )
        self._key, self._is_command = args.key, ours and wire.is_command(args.key, type_names)
        self.stops: set[bytes] = set()
        """The bytes that stop what its payloads move."""
        self.command: Any = None
        """The last payload as an object, if it is a command."""

    @property
    def encoding(self) -> str:
        """The Encoding of its bytes."""
        return encoding_of(self._wire, self.kind.name)

    @property
    def is_velocity(self) -> bool:
        """Whether it commands a velocity."""
        return self._is_command and self.kind.name in wire.VELOCITIES

    @property
    def is_goal(self) -> bool:
        """Whether it is a goal, to which a controller drives."""
        return self._is_command and not self.status_key

    @property
    def status_key(self) -> str | None:
        """The key of the status of its commands: for joints and forces that of the robot's cmd_vel;
        None for goals.
        """
        if self.is_velocity:
            return f"{self._key}_status"
        moves = self._is_command and self.kind.name in (
            "sensor_msgs/msg/JointState",
            "geometry_msgs/msg/Wrench",
        )
        return wire.key_for("cmd_vel_status", self._key.rpartition("/")[0]) if moves else None

    def payload(self, text: str) -> bytes:
        """The bytes of a written value. Raises ValueError with the reason."""
        value = self._message(values.plain(text))
        bad = not_finite(value)
        if bad and not self._force:
            raise ValueError(f"{bad} is not a finite number{FORCE}")
        if self._is_command:
            command = self.command = as_object(value)
            if not self._force and (bad := wire.implausible(command, self.kind.name)):
                raise ValueError(f"{bad}{FORCE}")
            if (fields := wire.stop(command, self.kind.name)) is not None:
                self.stops.add(written(self.kind, completed(self.kind, fields), self._wire))
        return written(self.kind, value, self._wire)

    def _message(self, value: Any) -> dict[str, Any]:
        """All fields of the first type that fits; the error is that of the type with most of the
        names.
        """
        names = set(value) if isinstance(value, dict) else set()
        best = max(
            self._kinds,
            key=lambda kind: len(names.intersection(field.name for field in kind.fields)),
        )
        for kind in self._kinds:
            with contextlib.suppress(InterfaceError):
                found, self.kind = completed(kind, value), kind
                return found
        return completed(best, value)


def written(kind: Interface, value: dict[str, Any], wire: str) -> bytes:
    """The bytes of a message with all its fields, whose numbers need not be finite as for
    `codec.encode`.
    """
    if wire == "cdr":
        from holozen.messages import cdr

        return cdr.write(kind, value)
    return json.dumps(with_mappings(kind, value), separators=(",", ":")).encode()


def form_of(args: argparse.Namespace) -> Form | None:
    """The form of the given type, else of the wire table's row; None if only a subscriber can
    determine it.
    """
    args.value = "{}" if args.value is None else args.value
    if args.value == "-":
        args.value = sys.stdin.read(values.LARGEST + 1)
    row = wire.topic(args.key)
    if not args.type:
        return Form(args, row.type_names) if row else None
    try:
        form = Form(args, [args.type])
    except ValueError as error:
        raise Failure(f"{args.key}: {error}") from None
    if row and form.kind.name not in row.type_names and not args.force:
        raise Failure(
            f"{args.key}: its type is {' or '.join(row.type_names)}, not {args.type}{FORCE}"
        )
    return form


def form_of_listener(found: list[Endpoint], args: argparse.Namespace) -> Form:
    """The form of the type that the key's subscribers expect: a robot's file may give its topics
    any name.
    """
    wanted = {end.type for end in on_key(found, args.key, "sub")}
    if row := next((row for row in wire.TOPICS if wanted.intersection(row.type_names)), None):
        return Form(args, row.type_names)
    for name in sorted(wanted):
        with contextlib.suppress(ValueError):
            return Form(args, [name])
    known = [topic.key for topic in wire.TOPICS]
    robot = args.key[: args.key.rfind("/") + 1]
    near = suggest(
        args.key,
        [*(f"{robot}{key}" for key in known), *(end.key for end in found if end.kind == "sub")],
    )
    raise Failure(
        f"{args.key!r} has no known type{near}; known keys: {', '.join(known)}, each also as "
        "ROBOT/key;"
        f" for any other give the type: holozen topic pub {args.key} geometry_msgs/msg/Twist VALUE"
    )
