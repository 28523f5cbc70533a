"""What viewers read of our messages: names of ROS, and schemas with everything in place."""

import json
from typing import Any

import pytest

from holozen.bag.schemas import json_schema, known

TYPES = {"boolean", "string", "number", "integer", "object", "array"}


def assert_plain(schema: dict[str, Any]) -> None:
    """As Foxglove's and Lichtblick's readers take it: a type everywhere, no references, items and properties."""
    assert schema["type"] in TYPES
    assert schema.keys() <= {"type", "properties", "items", "title"}
    if schema["type"] == "object":
        for field in schema["properties"].values():
            assert_plain(field)
    if schema["type"] == "array":
        assert_plain(schema["items"])


@pytest.mark.parametrize("name", sorted(known()))
def test_a_viewer_can_read_the_schema_of_every_message(name: str) -> None:
    schema = json.loads(json_schema(known()[name]))
    assert schema["title"] == name
    assert_plain(schema)


def test_odometry_has_its_fields_to_the_last() -> None:
    schema = json.loads(json_schema(known()["nav_msgs/msg/Odometry"]))
    pose = schema["properties"]["pose"]["properties"]
    assert list(pose["pose"]["properties"]["position"]["properties"]) == ["x", "y", "z"]
    assert pose["covariance"] == {"type": "array", "items": {"type": "number"}}
    transform = json.loads(json_schema(known()["tf2_msgs/msg/TFMessage"]))["properties"]["transforms"]["items"]
    assert transform["properties"]["header"]["properties"]["frame_id"] == {"type": "string"}
