"""Definitions are parsed as ROS writes them, and values of a type are checked and completed."""

import contextlib
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holozen.messages.definitions import (
    Constant,
    Field,
    Interface,
    InterfaceError,
    Section,
    completed,
    parse,
    prototype,
)
from holozen.messages.registry import Registry

POSE = Interface("geometry_msgs/msg/Pose", "msg")


def resolve(name: str) -> Interface:
    if name not in (
        "Pose",
        "geometry_msgs/Pose",
        "geometry_msgs/msg/Pose",
        "builtin_interfaces/Time",
    ):
        raise InterfaceError(f"no type {name!r}")
    return POSE


def section(text: str) -> Section:
    (found,) = parse(text, "X.msg", resolve)
    return found


def test_a_field_is_read() -> None:
    for line, field in [
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
        ("string a é\t\\", Field("a", "string", default="é\t\\")),
        ("int32[] n [1, -2,3]", Field("n", "int32", "sequence", default=[1, -2, 3])),
        ("int32[] n []", Field("n", "int32", "sequence", default=[])),
        ("string[2] n ['a, b', \"c\"]", Field("n", "string", "fixed", 2, default=["a, b", "c"])),
    ]:
        assert section(line) == section(field.line()) == Section((field,), ())


def test_a_constant_is_read() -> None:
    for line, constant in [
        ("uint8 TYPE_BOX=0", Constant("TYPE_BOX", "uint8", 0)),
        ("uint8 TYPE_BOX   = 0x0F # why", Constant("TYPE_BOX", "uint8", 15)),
        ("float32 PI=3.5", Constant("PI", "float32", 3.5)),
        ("string NAME=it's # a", Constant("NAME", "string", "it's")),
        ("string NAME=a = b", Constant("NAME", "string", "a = b")),
        ('string NAME="a # b"', Constant("NAME", "string", "a # b")),
        ('string NAME=""', Constant("NAME", "string", "")),
    ]:
        assert section(line) == section(constant.line()) == Section((), (constant,))


def test_comments_blank_lines_and_line_ends_are_ignored() -> None:
    assert section("# all\r\n\r\n   # of it\nbool a # isn't\r\n\tbool b\n") == Section(
        (Field("a", "bool"), Field("b", "bool")), ()
    )


def test_a_service_has_two_sections() -> None:
    request, response = parse("int64 goal\n---\nbool ok", "X.srv", resolve)
    assert (request.fields[0].name, response.fields[0].name) == ("goal", "ok")
    assert parse("---", "X.srv", resolve) == [Section((), ())] * 2


def test_a_wrong_line_is_reported_with_file_and_line() -> None:
    for line, reason in [
        (
            "float64",
            "'float64' is not a field; write TYPE NAME, TYPE NAME DEFAULT, TYPE NAME=VALUE, or # "
            "COMMENT",
        ),
        ("float64 x[3]", "'float64 x[3]' is not a field; write"),
        ("x float64", "'x float64' is not a field; the type comes first: float64 x"),
        ("----", "'----' is not a field; the line between two parts is ---"),
        ("float64 2x", "'float64 2x' is not a field"),
        ("float64 x;", "is not a field"),
        ("float64[-1] x", "is not a field"),
        ("float64[0] x", "[0]: an array has from 1 to 4294967295 elements"),
        ("float64[9999999999] x", "an array has from 1 to"),
        ("flot64 x", "no type 'flot64'"),
        ("float64<=3 x", "float64<=3: only a string has a bound"),
        ("string<=0 x", "string<=0: only a string has a bound, from 1 up"),
        ("uint8 x 256", "'x': '256' is not a valid uint8"),
        ("uint8 X=-1", "'X': '-1' is not a valid uint8"),
        ("int32 x 1.5", "'x': '1.5' is not a valid int32"),
        ("bool x yes", "'x': 'yes' is not a valid bool"),
        ("float64 x one", "'x': 'one' is not a valid float64"),
        ("string<=2 x abc", "'x': 'abc' is not a valid string"),
        ("Pose p 1", "'p': a message has no default"),
        ("Pose P=1", "'P': a constant is one number, bool or string"),
        ("int8[] N=[1]", "'N': a constant is one number"),
        ("int8[] n 1", "'n': '1' is not a list; write [1, 2]"),
        ("int8[2] n [1]", "'n': 1 values for int8[2]"),
        ("int8[<=1] n [1, 2]", "'n': 2 values for int8[<=1]"),
        ("int8[] n [,]", "'n': ',' is not a list of values"),
        ("bool first", "'first' is defined twice"),
    ]:
        with pytest.raises(InterfaceError) as error:
            parse(f"bool first\n\n{line}\nbool last", "pkg/msg/X.msg", resolve)
        assert str(error.value).startswith("pkg/msg/X.msg:3: ")
        assert reason in str(error.value)
        assert "\n" not in str(error.value)


def test_a_file_that_is_too_long_is_not_read() -> None:
    with pytest.raises(
        InterfaceError, match=r"^X.msg: 1000001 characters; at most 1000000 are read$"
    ):
        parse("#" * 1_000_001, "X.msg", resolve)


@given(st.text() | st.text("uint8 string[]<=0123=\"'#\\-,abcX\n"))
def test_any_text_is_a_definition_or_an_error(text: str) -> None:
    try:
        assert all(isinstance(found, Section) for found in parse(text, "X.msg", resolve))
    except InterfaceError as error:
        assert str(error).startswith("X.msg:")


def test_a_long_line_is_read_in_a_moment() -> None:
    for text in [
        '"' * 50_000,
        "string a " + "'\\" * 50_000,
        "int8[] a [" + "'," * 50_000,
        "#" * 90_000,
    ]:
        with contextlib.suppress(InterfaceError):
            parse(text, "X.msg", resolve)


POINT = Interface("t/msg/Point", "msg", (Field("x", "float32"), Field("y", "float32", default=2.0)))
COUNT = Interface("t/msg/Count", "msg", (Field("name", "string"), Field("count", "uint8")))
ALL = Interface(
    "t/msg/All",
    "msg",
    (
        Field("on", "bool"),
        Field("byte", "byte"),
        Field("n", "int8", default=-3),
        Field("text", "string", longest=4),
        Field("wide", "float64"),
        Field("three", "uint16", "fixed", 3),
        Field("few", "int32", "bounded", 2),
        Field("names", "string", "sequence", default=["a"]),
        Field("at", POINT.name, nested=POINT),
        Field("path", POINT.name, "sequence", nested=POINT),
        Field("ends", POINT.name, "fixed", 2, nested=POINT),
        Field("counts", COUNT.name, "sequence", nested=COUNT),
    ),
)
DEFAULT = {
    "on": False,
    "byte": 0,
    "n": -3,
    "text": "",
    "wide": 0.0,
    "three": [0, 0, 0],
    "few": [],
    "names": ["a"],
    "at": {"x": 0.0, "y": 2.0},
    "path": [],
    "ends": [{"x": 0.0, "y": 2.0}] * 2,
    "counts": [],
}


def test_a_prototype_has_every_field_at_its_default() -> None:
    assert prototype(ALL) == DEFAULT
    assert prototype(Registry().find("geometry_msgs/msg/Quaternion")) == {
        "x": 0.0,
        "y": 0.0,
        "z": 0.0,
        "w": 1.0,
    }


def test_prototypes_share_no_lists() -> None:
    prototype(ALL)["names"].append("b")
    completed(ALL, {})["names"].append("b")
    assert prototype(ALL) == DEFAULT


def test_what_is_left_out_is_at_its_default() -> None:
    assert completed(ALL, {}) == DEFAULT
    assert completed(ALL, {"at": {"x": 1}, "path": [{}]}) == DEFAULT | {
        "at": {"x": 1.0, "y": 2.0},
        "path": [{"x": 0.0, "y": 2.0}],
    }


def test_what_fits_is_kept() -> None:
    rows: list[dict[str, Any]] = [
        {"on": True},
        {"byte": 255},
        {"n": 127},
        {"n": -128},
        {"text": "abcd"},
        {"wide": 1.7e308},
        {"wide": math.inf},
        {"three": [1, 2, 65535]},
        {"few": [1]},
        {"names": []},
        {"at": {"x": -math.inf, "y": 3.4e38}},
    ]
    for value in rows:
        assert completed(ALL, value) == DEFAULT | value


def test_nan_is_a_number() -> None:
    assert math.isnan(completed(ALL, {"at": {"x": math.nan}})["at"]["x"])


def test_pairs_may_be_written_as_a_mapping() -> None:
    pairs = [{"name": "late", "count": 3}, {"name": "odd", "count": 1}]
    assert (
        completed(ALL, {"counts": {"late": 3, "odd": 1}})
        == completed(ALL, {"counts": pairs})
        == DEFAULT | {"counts": pairs}
    )


def test_what_does_not_fit_is_reported_with_its_path() -> None:
    rows: list[tuple[Any, str]] = [
        ([], "t/msg/All: [] is not a mapping of fields"),
        (None, "t/msg/All: None is not a mapping of fields"),
        ({"txet": ""}, "t/msg/All has no field 'txet' (did you mean 'text'?)"),
        ({"at": {"z": 1}}, "t/msg/Point has no field 'at.z'; it has x, y"),
        ({1: 2}, "t/msg/All has no field '1'"),
        ({"on": 1}, "on: 1 is not a valid bool"),
        ({"on": "yes"}, "on: 'yes' is not a valid bool"),
        ({"byte": 256}, "byte: 256 is not a valid byte"),
        ({"byte": True}, "byte: True is not a valid byte"),
        ({"n": -129}, "n: -129 is not a valid int8"),
        ({"n": 1.0}, "n: 1.0 is not a valid int8"),
        ({"text": "abcde"}, "text: 'abcde' is not a valid string<=4"),
        ({"text": "äöü"}, "is not a valid string<=4"),
        ({"text": "\ud800"}, "is not a valid string<=4"),
        ({"text": 1}, "text: 1 is not a valid string<=4"),
        ({"wide": "1"}, "wide: '1' is not a valid float64"),
        ({"wide": True}, "wide: True is not a valid float64"),
        ({"wide": 10**400}, "is not a valid float64"),
        ({"wide": None}, "wide: None is not a valid float64"),
        ({"at": {"x": 3.5e38}}, "at.x: 3.5e+38 is not a valid float32"),
        ({"at": []}, "at: [] is not a mapping of fields"),
        ({"three": [1, 2]}, "three: 2 values for uint16[3]"),
        ({"three": 1}, "three: 1 is not a list"),
        ({"three": {}}, "three: {} is not a list"),
        ({"few": [1, 2, 3]}, "few: 3 values for int32[<=2]"),
        ({"few": [1, "2"]}, "few[1]: '2' is not a valid int32"),
        ({"path": [{}, {"x": "1"}]}, "path[1].x: '1' is not a valid float32"),
        ({"path": {"x": 1}}, "path[0].x: 'x' is not a valid float32"),
        ({"counts": {"late": 256}}, "counts[0].count: 256 is not a valid uint8"),
        ({"names": "abc"}, "names: 'abc' is not a list"),
        ({"names": "x" * 10_000}, "xxx... is not a list"),
    ]
    for value, reason in rows:
        with pytest.raises(InterfaceError) as error:
            completed(ALL, value)
        assert reason in str(error.value)
        assert len(str(error.value)) < 200
