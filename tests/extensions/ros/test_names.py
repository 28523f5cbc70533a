"""ROS's names: expanded, checked, remapped, and as keys."""

from collections.abc import Callable
from typing import Any

import pytest

from holozen.ros.rclpy import names
from holozen.ros.rclpy.exceptions import (
    InvalidNamespaceException,
    InvalidNodeNameException,
    InvalidServiceNameException,
    InvalidTopicNameException,
    NameValidationException,
)


def test_a_name_is_absolute_relative_or_private() -> None:
    for name, full in [
        ("/cmd_vel", "/cmd_vel"),
        ("cmd_vel", "/ns/cmd_vel"),
        ("a/b", "/ns/a/b"),
        ("~", "/ns/tom"),
        ("~/state", "/ns/tom/state"),
        ("{node}/state", "/ns/tom/state"),
        ("{ns}/state", "/ns/state"),
        ("{namespace}/x_{node}", "/ns/x_tom"),
    ]:
        assert names.expand(name, "tom", "/ns") == full


def test_at_the_root_nothing_comes_before_a_name() -> None:
    assert names.expand("cmd_vel", "tom", "/") == "/cmd_vel"
    assert names.expand("~/state", "tom", "/") == "/tom/state"
    assert names.join("/", "tom") == "/tom"
    assert names.key("/ns/cmd_vel") == "ns/cmd_vel"


def test_a_wrong_name_is_reported_with_the_place() -> None:
    for name, place, fault in [
        ("", 0, "empty"),
        ("a b", 1, "' '"),
        ("cmd-vel", 3, "'-'"),
        ("/2d/scan", 1, "'2d' starts with a digit"),
        ("a//b", 2, "row"),
        ("cmd_vel/", 7, "ends with /"),
        ("a~", 1, "~ is only allowed"),
        ("~a", 1, "~/"),
        ("a/{robot}/b", 2, "{robot}"),
        ("a{", 1, "'{'"),
        ("*", 0, "'*'"),
        ("x" * 300, 247, "247"),
    ]:
        with pytest.raises(InvalidTopicNameException) as topic:
            names.expand(name, "tom", "/ns")
        assert fault in str(topic.value)
        assert topic.value.invalid_index == place
        assert "\n" not in str(topic.value)
        with pytest.raises(InvalidServiceNameException, match="service name"):
            names.expand(name, "tom", "/ns", kind="service")


def test_a_wrong_node_name_is_refused() -> None:
    for name in ["", "a/b", "2tom", "to m", "tom-1", "x" * 256]:
        with pytest.raises(InvalidNodeNameException):
            names.check_node_name(name)


def test_a_namespace_gets_its_slash() -> None:
    assert [names.check_namespace(name) for name in ("", "/", "a", "/a/b")] == [
        "/",
        "/",
        "/a",
        "/a/b",
    ]
    for name in ("/a/", "a//b", "/a-b", "//"):
        with pytest.raises(InvalidNamespaceException):
            names.check_namespace(name)


def test_a_name_that_is_no_text_is_a_type_error() -> None:
    checks: list[Callable[[Any], str]] = [
        names.check_node_name,
        names.check_namespace,
        lambda name: names.expand(name, "tom", "/"),
    ]
    for check in checks:
        with pytest.raises(TypeError, match=r"must be a str; 5 is an int"):
            check(5)


def test_a_rule_maps_a_name_for_a_node() -> None:
    assert names.remap("cmd_vel:=turtle") == names.Remap("cmd_vel", "turtle")
    assert names.remap("tom:cmd_vel:=/turtle") == names.Remap("cmd_vel", "/turtle", "tom")
    assert names.remap("__name:=anna") == names.Remap("__node", "anna")
    assert names.remap("tom:__ns:=/lab") == names.Remap("__ns", "/lab", "tom")
    assert names.remap("rosservice://add:=sum") == names.Remap("rosservice://add", "sum")


def test_a_wrong_rule_is_refused() -> None:
    for text in ["", "a", "a:=", ":=b", "__topic:=x", "a b:=c", "a:=c d", "t m:a:=b", "__ns:=lab"]:
        with pytest.raises((ValueError, NameValidationException)):
            names.remap(text)


def test_a_rule_is_for_topics_and_services_by_default() -> None:
    both, topics = names.remap("add:=sum"), names.remap("rostopic://add:=sum")
    assert both.renames("/ns/add", "tom", "/ns", "topic")
    assert both.renames("/ns/add", "tom", "/ns", "service")
    assert topics.renames("/ns/add", "tom", "/ns", "topic")
    assert not topics.renames("/ns/add", "tom", "/ns", "service")
    assert not both.renames("/add", "tom", "/ns", "topic")
    assert not names.remap("anna:add:=sum").renames("/ns/add", "tom", "/ns", "topic")
