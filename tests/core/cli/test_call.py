"""`service call`: a type that is given is looked up, and the server's reply decides the rest."""

from collections.abc import Callable
from pathlib import Path

import pytest

from holozen.messages import NextGoalReply, NextGoalRequest
from holozen.testing import Wire
from tests.present import VERBS

Run = Callable[..., tuple[int, str, str]]
LESSON = Path(__file__).parents[3] / "examples" / "lesson"
TYPE, REQUEST = "hb_interfaces/srv/NextGoal", "{request_goal: 2}"
REPLY = "x_goal: 2.0\ny_goal: 2.5\ntheta_goal: 0.0\nend_of_list: 0\n"
THING = "string name\n---\nint32 count\n"


def serves(wire: Wire) -> None:
    """next_goal as our pose service has it."""
    bus = wire.bus("pose_service")
    bus.serve(
        "next_goal",
        NextGoalRequest,
        NextGoalReply,
        lambda r: NextGoalReply(float(r.request_goal), 2.5),
    ).start()


@pytest.fixture
def thing(tmp_path: Path) -> Path:
    """A package with a service that our table calls otherwise."""
    folder = tmp_path / "ws" / "src" / "my_if"
    (folder / "srv").mkdir(parents=True)
    (folder / "package.xml").write_text("<package><name>my_if</name></package>")
    (folder / "srv" / "NextGoal.srv").write_text(THING)
    return folder


@pytest.fixture
def theirs(wire: Wire, thing: Path) -> None:
    """A script's services of the type in that package: on a key that our table knows, and on one
    that it does not.
    """
    if "run" not in VERBS:
        pytest.skip("left out: run")
    from holozen.ros import importer
    from holozen.ros.generated import find

    importer.install({"my_if": thing})
    kind = find("my_if/srv/NextGoal")
    for key in ("next_goal", "my_goal"):
        bus = wire.bus(f"script_{key}")
        bus.serve(
            key, kind.Request, kind.Response, lambda r: kind.Response(count=len(r.name))
        ).start()
    importer.remove()


@pytest.mark.parametrize("where", [LESSON, LESSON / "hb_control", LESSON.parent])
def test_the_type_of_a_package_with_the_same_fields_calls_our_service(
    wire: Wire, run: Run, where: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    serves(wire)
    monkeypatch.chdir(where)
    assert run("service", "call", "/next_goal", TYPE, REQUEST) == (0, REPLY, "")
    assert run("service", "call", "/next_goal", "hb_interfaces/NextGoal", REQUEST) == (0, REPLY, "")
    code, _, err = run("service", "call", "next_goal", TYPE, "{request_gaol: 2}")
    assert (code, "did you mean 'request_goal'?" in err, err.count("\n")) == (1, True, 1)


def test_a_package_that_is_not_found_calls_a_service_of_the_same_name_and_reports_it(
    wire: Wire, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    serves(wire)
    monkeypatch.chdir(tmp_path)
    code, out, err = run("service", "call", "/next_goal", TYPE, REQUEST)
    assert (code, out) == (0, REPLY)
    assert (
        "--package hb_interfaces=DIR; until then the request is checked as holozen/srv/NextGoal"
        in err
    )
    given = ("--package", f"hb_interfaces={LESSON / 'hb_interfaces'}")
    assert run("service", "call", "/next_goal", TYPE, REQUEST, *given) == (0, REPLY, "")


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        (
            "std_srvs/srv/Trigger",
            "next_goal: its type is holozen/srv/NextGoal, not std_srvs/srv/Trigger\n",
        ),
        (
            "std_srvs/srv/Triger",
            "no type 'std_srvs/srv/Triger' (did you mean 'std_srvs/srv/Trigger'?)",
        ),
        (
            "hb_interface/srv/GetPose",
            "give its folder: --package hb_interface=DIR; its type is holozen/srv/NextGoal\n",
        ),
        ("geometry_msgs/msg/Twist", "next_goal: geometry_msgs/msg/Twist is a message; "),
    ],
)
def test_a_type_that_it_does_not_have_is_one_line(
    wire: Wire, run: Run, kind: str, expected: str
) -> None:
    serves(wire)
    code, out, err = run("service", "call", "next_goal", kind, "{}")
    assert (code, out, err.count("\n")) == (1, "", 1)
    assert expected in err


@pytest.mark.parametrize("key", ["next_goal", "my_goal"])
def test_the_type_of_a_live_server_goes_before_our_table(
    wire: Wire, run: Run, theirs: None, thing: Path, key: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # where it is beside, below, and not found
    for where in (thing, thing.parents[1], thing.parents[2]):
        monkeypatch.chdir(where)
        for words in ([], ["my_if/srv/NextGoal"]):
            assert run("service", "call", key, *words, "{name: four}") == (0, "count: 4\n", "")
    for words in ([], ["my_if/srv/NextGoal"]):
        assert run("service", "call", key, *words) == (0, "count: 0\n", "")
        code, _, err = run("service", "call", key, *words, "{nmae: four}")
        assert (code, "nmae" in err, err.count("\n")) == (1, True, 1), err


def test_a_value_on_standard_input_is_read_once(
    wire: Wire, run: Run, theirs: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    import io

    monkeypatch.setattr("sys.stdin", io.StringIO("name: three"))
    assert run("service", "call", "next_goal", "-")[:2] == (0, "count: 5\n")


def test_an_unknown_key_is_reported_with_the_closest_service(wire: Wire, run: Run) -> None:
    serves(wire)
    assert (
        "'nextgoal' has no known type (did you mean 'next_goal'?)"
        in run("service", "call", "nextgoal")[2]
    )
