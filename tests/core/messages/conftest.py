"""An independent library that reads and writes CDR: rosbags."""

from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from holozen.messages.definitions import Field, Interface


class Rosbags:
    """rosbags, with values as plain dicts. Types that it does not have are taught to it as text."""

    def __init__(self) -> None:
        self.store = get_typestore(Stores.ROS2_JAZZY)

    def learn(self, interface: Interface) -> None:
        """A type of ours, and those within it."""
        for field in interface.fields:
            if field.nested:
                self.learn(field.nested)
        name = self.name(interface)
        if name not in self.store.types:
            text = "\n".join(f"{field.spelled()} {field.name}" for field in interface.fields)
            self.store.register(get_types_from_msg(text.replace("/msg/", "/"), name))

    def write(
        self, interface: Interface, value: dict[str, Any], little_endian: bool = True
    ) -> bytes:
        self.learn(interface)
        message = self._message(interface, value)
        return bytes(
            self.store.serialize_cdr(message, self.name(interface), little_endian=little_endian)
        )

    def read(self, interface: Interface, payload: bytes) -> dict[str, Any]:
        self.learn(interface)
        return self._plain(interface, self.store.deserialize_cdr(payload, self.name(interface)))

    def name(self, interface: Interface) -> str:
        return interface.name.replace("/srv/", "/msg/").replace("_Re", "Re")  # it knows no services

    def _message(self, interface: Interface, value: dict[str, Any]) -> Any:
        kind = self.store.types[self.name(interface)]
        if not interface.fields:
            return kind(structure_needs_at_least_one_member=0)
        return kind(
            **{field.name: self._given(field, value[field.name]) for field in interface.fields}
        )

    def _given(self, field: Field, value: Any) -> Any:
        if field.nested:
            many = [
                self._message(field.nested, each) for each in (value if field.array else [value])
            ]
            return many if field.array else many[0]
        if not field.array or field.type == "string":
            return value
        return np.array(value, dtype={"byte": "uint8", "char": "uint8"}.get(field.type, field.type))

    def _plain(self, interface: Interface, message: Any) -> dict[str, Any]:
        return {
            field.name: self._plain_value(field, getattr(message, field.name))
            for field in interface.fields
        }

    def _plain_value(self, field: Field, value: Any) -> Any:
        if field.nested:
            many = [self._plain(field.nested, each) for each in (value if field.array else [value])]
            return many if field.array else many[0]
        return value.tolist() if isinstance(value, np.ndarray) else value


@pytest.fixture(scope="module")
def rosbags() -> Rosbags:
    return Rosbags()
