""".msg and .srv files: what ROS writes is read, and what is wrong is told with file and line."""

import contextlib
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holozen.interfaces import Constant, Field, Interface, InterfaceError
from holozen.interfaces.parser import Section, parse

POSE = Interface("geometry_msgs/msg/Pose", "msg")


def resolve(name: str) -> Interface:
    if name not in ("Pose", "geometry_msgs/Pose", "geometry_msgs/msg/Pose", "builtin_interfaces/Time"):
        raise InterfaceError(f"no type {name!r}")
    return POSE


def section(text: str) -> Section:
    (found,) = parse(text, "X.msg", resolve)
    return found


@pytest.mark.parametrize(
    ("line", "field"),
    [
        ("float64 x", Field("x", "float64")),
        ("  string\tname   # a comment", Field("name", "string")),
        ("uint8[] data", Field("data", "uint8", "sequence")),
        ("float64[36] covariance", Field("covariance", "float64", "fixed", 36)),
        ("string<=10[<=5] names", Field("names", "string", "bounded", 5, longest=10)),
        ("wstring<=3 w", Field("w", "wstring", longest=3)),
        ("Pose[] poses", Field("poses", POSE.name, "sequence", nested=POSE)),
        ("geometry_msgs/Pose pose", Field("pose", POSE.name, nested=POSE)),
        ("geometry_msgs/msg/Pose pose", Field("pose", POSE.name, nested=POSE)),
        ("time stamp", Field("stamp", POSE.name, nested=POSE)),
        ("float64 w 1", Field("w", "float64", default=1.0)),
        ("int8 n -0x10", Field("n", "int8", default=-16)),
        ("bool on true", Field("on", "bool", default=True)),
        ("bool off 0", Field("off", "bool", default=False)),
        ("string a hello world  # said", Field("a", "string", default="hello world")),
        ('string a "x # \\"y\\"" # no', Field("a", "string", default='x # "y"')),
        ("string a 'it''s'", Field("a", "string", default="it''s")),
        ("string a 'it\\'s'", Field("a", "string", default="it's")),
        ("int32[] n [1, -2,3]", Field("n", "int32", "sequence", default=[1, -2, 3])),
        ("int32[] n []", Field("n", "int32", "sequence", default=[])),
        ("string[2] n ['a, b', \"c\"]", Field("n", "string", "fixed", 2, default=["a, b", "c"])),
    ],
)
def test_a_field_is_read(line: str, field: Field) -> None:
    assert section(line) == Section((field,), ())


@pytest.mark.parametrize(
    ("line", "constant"),
    [
        ("uint8 TYPE_BOX=0", Constant("TYPE_BOX", "uint8", 0)),
        ("uint8 TYPE_BOX   = 0x0F # why", Constant("TYPE_BOX", "uint8", 15)),
        ("float32 PI=3.5", Constant("PI", "float32", 3.5)),
        ("string NAME=it's # a", Constant("NAME", "string", "it's")),
        ("string NAME=a = b", Constant("NAME", "string", "a = b")),
        ('string NAME="a # b"', Constant("NAME", "string", "a # b")),
    ],
)
def test_a_constant_is_read(line: str, constant: Constant) -> None:
    assert section(line) == Section((), (constant,))


def test_comments_blank_lines_and_line_ends_say_nothing() -> None:
    assert section("# all\r\n\r\n   # of it\nbool a # isn't\r\n\tbool b\n") == Section(
        (Field("a", "bool"), Field("b", "bool")), ()
    )


def test_a_service_has_two_sections() -> None:
    request, response = parse("int64 goal\n---\nbool ok", "X.srv", resolve)
    assert (request.fields[0].name, response.fields[0].name) == ("goal", "ok")
    assert parse("---", "X.srv", resolve) == [Section((), ())] * 2


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("float64", "'float64' is no field; write TYPE NAME, TYPE NAME DEFAULT or TYPE NAME=VALUE"),
        ("float64 2x", "'float64 2x' is no field"),
        ("float64 x;", "is no field"),
        ("float64[-1] x", "is no field"),
        ("float64[0] x", "[0]: an array has from 1 to 4294967295 elements"),
        ("float64[9999999999] x", "an array has from 1 to"),
        ("flot64 x", "no type 'flot64'"),
        ("float64<=3 x", "float64<=3: only a string has a bound"),
        ("string<=0 x", "string<=0: only a string has a bound, from 1 up"),
        ("uint8 x 256", "'x': '256' is no uint8"),
        ("uint8 X=-1", "'X': '-1' is no uint8"),
        ("int32 x 1.5", "'x': '1.5' is no int32"),
        ("bool x yes", "'x': 'yes' is no bool"),
        ("float64 x one", "'x': 'one' is no float64"),
        ("string<=2 x abc", "'x': 'abc' is no string"),
        ("Pose p 1", "'p': a message has no default"),
        ("Pose P=1", "'P': a constant is one number, bool or string"),
        ("int8[] N=[1]", "'N': a constant is one number"),
        ("int8[] n 1", "'n': '1' is no list; write [1, 2]"),
        ("int8[2] n [1]", "'n': 1 values for int8[2]"),
        ("int8[<=1] n [1, 2]", "'n': 2 values for int8[<=1]"),
        ("int8[] n [,]", "'n': ',' is no list of values"),
        ("bool first", "'first' is there twice"),
    ],
)
def test_a_wrong_line_is_told_with_file_and_line(line: str, reason: str) -> None:
    with pytest.raises(InterfaceError) as error:
        parse(f"bool first\n\n{line}\nbool last", "pkg/msg/X.msg", resolve)
    assert str(error.value).startswith("pkg/msg/X.msg:3: ")
    assert reason in str(error.value)
    assert "\n" not in str(error.value)


def test_a_file_that_is_too_long_is_not_read() -> None:
    with pytest.raises(InterfaceError, match=r"^X.msg: 1000001 characters; at most 1000000 are read$"):
        parse("#" * 1_000_001, "X.msg", resolve)


@given(st.text() | st.text("uint8 string[]<=0123=\"'#\\-,abcX\n"))
def test_any_text_is_a_definition_or_an_error(text: str) -> None:
    try:
        assert all(isinstance(found, Section) for found in parse(text, "X.msg", resolve))
    except InterfaceError as error:
        assert str(error).startswith("X.msg:")


@pytest.mark.parametrize(
    "text", ['"' * 50_000, "string a " + "'\\" * 50_000, "int8[] a [" + "'," * 50_000, "#" * 90_000]
)
def test_a_long_line_is_read_in_a_moment(text: Any) -> None:
    with contextlib.suppress(InterfaceError):
        parse(text, "X.msg", resolve)
