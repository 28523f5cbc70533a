"""`holozen list` shows what is in the world, `holozen delete` takes it out."""

import json
import math
from collections.abc import Callable

import pytest

from holozen.messages import Quaternion
from holozen.messages import simulation_interfaces as si
from holozen.transport.errors import ServiceError

from .conftest import FakeSim

Run = Callable[..., tuple[int, str, str]]


def test_names_are_listed_with_their_places(sim: FakeSim, run: Run) -> None:
    sim.put("hb_bot", 1, -2.5, -0.04, Quaternion(0, 0, math.sin(0.5), math.cos(0.5)))
    sim.put("Fred", -1e-9, 0, 0, Quaternion(0, 0, -1e-9, 1))
    lines = (
        "Fred    x 0.000  y 0.000  z 0.000 m  yaw 0.0 deg",
        "hb_bot  x 1.000  y -2.500  z -0.040 m  yaw 57.3 deg",
    )
    assert run("list") == (0, "".join(f"{line}\n" for line in lines), "")


def test_as_json_they_are_names_and_poses(sim: FakeSim, run: Run) -> None:
    assert run("list", "--json") == (0, "", "")
    sim.put("Fred", 1)
    sim.put("Ann")
    _, entity = [json.loads(line) for line in run("list", "--json")[1].splitlines()]
    assert entity["name"] == "Fred"
    assert entity["pose"] == {
        "position": {"x": 1, "y": 0, "z": 0},
        "orientation": {"x": 0, "y": 0, "z": 0, "w": 1},
    }


def test_an_empty_world_explains_how_to_fill_it(sim: FakeSim, run: Run) -> None:
    expected = "the world is empty; holozen spawn FILE --name NAME puts a robot there\n"
    assert run("list") == (0, "", expected)


def test_one_that_goes_while_it_is_listed_is_left_out(
    sim: FakeSim, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    sim.put("Fred")
    sim.put("gone")

    def refuse(request: si.GetEntityStateRequest) -> str:
        if request.entity == "gone":
            raise ServiceError("there is no entity 'gone'")
        return request.entity

    monkeypatch.setattr(sim, "known", refuse)
    assert run("list")[1].startswith("Fred ") and run("list")[1].count("\n") == 1


def test_several_are_deleted(sim: FakeSim, run: Run) -> None:
    for name in ("Fred", "Bob", "box"):
        sim.put(name)
    assert run("delete", "Fred", "box") == (0, "Fred is deleted\nbox is deleted\n", "")
    assert list(sim.entities) == ["Bob"]


def test_an_unknown_one_is_reported_with_the_sims_reason_and_the_others_go(
    sim: FakeSim, run: Run
) -> None:
    sim.put("Fred")
    sim.put("Bob")
    expected = "holozen delete: there is no entity 'nobody'; there are Fred, Bob\n"
    assert run("delete", "nobody", "Bob") == (1, "Bob is deleted\n", expected)


def test_deleted_ones_are_an_object_a_line_as_json(sim: FakeSim, run: Run) -> None:
    sim.put("Fred")
    code, out, err = run("delete", "nobody", "Fred", "--json")
    reason = "there is no entity 'nobody'; there are Fred"
    assert [json.loads(line) for line in out.splitlines()] == [
        {"name": "nobody", "deleted": False, "reason": reason},
        {"name": "Fred", "deleted": True, "reason": ""},
    ]
    assert (code, err) == (1, f"holozen delete: {reason}\n")


def test_wildcards_stand_for_names_as_in_a_shell(sim: FakeSim, run: Run) -> None:
    for name in ("bot0", "bot1", "bot22", "Bot3"):
        sim.put(name)
    assert run("delete", "bot?", "x*") == (
        1,
        "bot0 is deleted\nbot1 is deleted\n",
        "holozen delete: no name matches 'x*'; there are Bot3, bot0, bot1, bot22\n",
    )
    assert list(sim.entities) == ["bot22", "Bot3"]


def test_an_illegal_name_is_wrong_usage_and_asks_nothing(sim: FakeSim, run: Run) -> None:
    sim.put("Fred")
    for name in ("a/b", "", "9"):
        code, _, err = run("delete", "Fred", name)
        assert code == 2 and f"robot name {name!r}: use a letter" in err
    assert sim.log == []


def test_what_lies_on_its_side_is_reported(sim: FakeSim, run: Run) -> None:
    sim.put("Fred", q=Quaternion(math.sqrt(0.5), 0, 0, math.sqrt(0.5)))
    sim.put("Ann", q=Quaternion(0.01, 0, 0, 1))
    ann, fred = run("list")[1].splitlines()
    assert fred.endswith("  tilted by 90 deg") and "tilted" not in ann
