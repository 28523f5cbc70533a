"""Values of a type as plain dicts: defaults are filled in, and what does not fit is told with its path."""

import math
from typing import Any

import pytest

from holozen.interfaces import Field, Interface, InterfaceError, Registry
from holozen.interfaces.values import completed, prototype

POINT = Interface("t/msg/Point", "msg", (Field("x", "float32"), Field("y", "float32", default=2.0)))
COUNT = Interface("t/msg/Count", "msg", (Field("name", "string"), Field("count", "uint8")))
ALL = Interface(
    "t/msg/All",
    "msg",
    (
        Field("on", "bool"), Field("byte", "byte"), Field("n", "int8", default=-3), Field("text", "string", longest=4),
        Field("wide", "float64"), Field("three", "uint16", "fixed", 3), Field("few", "int32", "bounded", 2),
        Field("names", "string", "sequence", default=["a"]), Field("at", POINT.name, nested=POINT),
        Field("path", POINT.name, "sequence", nested=POINT), Field("ends", POINT.name, "fixed", 2, nested=POINT),
        Field("counts", COUNT.name, "sequence", nested=COUNT),
    ),
)  # fmt: skip
DEFAULT = {
    "on": False, "byte": 0, "n": -3, "text": "", "wide": 0.0, "three": [0, 0, 0], "few": [], "names": ["a"],
    "at": {"x": 0.0, "y": 2.0}, "path": [], "ends": [{"x": 0.0, "y": 2.0}] * 2, "counts": [],
}  # fmt: skip


def test_a_prototype_has_every_field_at_its_default() -> None:
    assert prototype(ALL) == DEFAULT
    assert prototype(Registry().find("geometry_msgs/msg/Quaternion")) == {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}


def test_prototypes_share_no_lists() -> None:
    prototype(ALL)["names"].append("b")
    completed(ALL, {})["names"].append("b")
    assert prototype(ALL) == DEFAULT


def test_what_is_left_out_is_at_its_default() -> None:
    assert completed(ALL, {}) == DEFAULT
    assert completed(ALL, {"at": {"x": 1}, "path": [{}]}) == DEFAULT | {
        "at": {"x": 1.0, "y": 2.0}, "path": [{"x": 0.0, "y": 2.0}]
    }  # fmt: skip


@pytest.mark.parametrize(
    "value",
    [
        {"on": True}, {"byte": 255}, {"n": 127}, {"n": -128}, {"text": "abcd"}, {"wide": 1.7e308}, {"wide": math.inf},
        {"three": [1, 2, 65535]}, {"few": [1]}, {"names": []}, {"at": {"x": -math.inf, "y": 3.4e38}},
    ],
    ids=str,
)  # fmt: skip
def test_what_fits_is_kept(value: dict[str, Any]) -> None:
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


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        ([], "t/msg/All: [] is no mapping of fields"),
        (None, "t/msg/All: None is no mapping of fields"),
        ({"txet": ""}, "t/msg/All has no field 'txet'; did you mean text?"),
        ({"at": {"z": 1}}, "t/msg/Point has no field 'at.z'; it has x, y"),
        ({1: 2}, "t/msg/All has no field '1'"),
        ({"on": 1}, "on: 1 is no bool"),
        ({"on": "yes"}, "on: 'yes' is no bool"),
        ({"byte": 256}, "byte: 256 is no byte"),
        ({"byte": True}, "byte: True is no byte"),
        ({"n": -129}, "n: -129 is no int8"),
        ({"n": 1.0}, "n: 1.0 is no int8"),
        ({"text": "abcde"}, "text: 'abcde' is no string<=4"),
        ({"text": "äöü"}, "is no string<=4"),
        ({"text": "\ud800"}, "is no string<=4"),
        ({"text": 1}, "text: 1 is no string<=4"),
        ({"wide": "1"}, "wide: '1' is no float64"),
        ({"wide": True}, "wide: True is no float64"),
        ({"wide": 10**400}, "is no float64"),
        ({"wide": None}, "wide: None is no float64"),
        ({"at": {"x": 3.5e38}}, "at.x: 3.5e+38 is no float32"),
        ({"at": []}, "at: [] is no mapping of fields"),
        ({"three": [1, 2]}, "three: 2 values for uint16[3]"),
        ({"three": 1}, "three: 1 is no list"),
        ({"three": {}}, "three: {} is no list"),
        ({"few": [1, 2, 3]}, "few: 3 values for int32[<=2]"),
        ({"few": [1, "2"]}, "few[1]: '2' is no int32"),
        ({"path": [{}, {"x": "1"}]}, "path[1].x: '1' is no float32"),
        ({"path": {"x": 1}}, "path[0].x: 'x' is no float32"),
        ({"counts": {"late": 256}}, "counts[0].count: 256 is no uint8"),
        ({"names": "abc"}, "names: 'abc' is no list"),
        ({"names": "x" * 10_000}, "xxx... is no list"),
    ],
    ids=lambda value: str(value)[:40],
)
def test_what_does_not_fit_is_told_with_its_path(value: Any, reason: str) -> None:
    with pytest.raises(InterfaceError) as error:
        completed(ALL, value)
    assert reason in str(error.value)
    assert len(str(error.value)) < 200
