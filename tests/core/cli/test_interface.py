"""`holozen interface` lists types, shows their fields, and gives messages that are ready to be
published.
"""

import json
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest
import yaml

from holozen import cli
from holozen.cli.values import checked
from holozen.messages import Odometry, Twist
from holozen.messages.codec import convert
from holozen.messages.definitions import completed
from holozen.messages.registry import Registry

REPO = Path(__file__).parents[3]


@pytest.fixture(autouse=True)
def no_ros(monkeypatch: pytest.MonkeyPatch) -> None:
    for variable in ("AMENT_PREFIX_PATH", "ROS_PACKAGE_PATH"):
        monkeypatch.delenv(variable, raising=False)


@pytest.fixture
def lesson(tmp_path: Path) -> Path:
    (tmp_path / "srv").mkdir()
    (tmp_path / "srv" / "NextGoal.srv").write_text(
        "# which\nint64 request_goal 3\n---\nstring KIND=a\x1bb\nfloat64 "
        "x_goal\ngeometry_msgs/Point[] path\n"
    )
    return tmp_path


def run(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    assert cli.main(["interface", *map(str, words)]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    return out


def test_the_list_has_messages_and_services_as_ros_prints_them(
    capsys: pytest.CaptureFixture[str],
) -> None:
    lines = run(capsys, "list").splitlines()
    services = lines.index("Services:")
    assert lines[0] == "Messages:"
    assert "    geometry_msgs/msg/Twist" in lines[:services]
    assert "    std_srvs/srv/Trigger" in lines[services:]
    assert "    holozen/srv/NextGoal" in lines[services:]


def test_the_list_may_have_one_kind_only(capsys: pytest.CaptureFixture[str]) -> None:
    assert "srv/" not in run(capsys, "list", "-m")
    assert "msg/" not in run(capsys, "list", "-s")


def test_the_list_in_json_is_one_type_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    rows = [json.loads(line) for line in run(capsys, "list", "--json").splitlines()]
    assert {"name": "geometry_msgs/msg/Twist", "kind": "msg"} in rows
    assert {"name": "std_srvs/srv/Trigger", "kind": "srv"} in rows


def test_a_package_that_is_given_is_listed_and_shown(
    lesson: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = ("--package", f"lesson={lesson}")
    assert "    lesson/srv/NextGoal\n" in run(capsys, "list", *given)
    assert run(capsys, "show", "lesson/srv/NextGoal", *given) == (
        'int64 request_goal 3\n---\nstring KIND="a?b"\nfloat64 x_goal\ngeometry_msgs/Point[] path\n'
        "\tfloat64 x\n\tfloat64 y\n\tfloat64 z\n"
    )
    assert run(capsys, "proto", "lesson/srv/NextGoal", *given) == "request_goal: 3\n"


def test_packages_around_the_working_folder_are_listed(
    lesson: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (lesson / "package.xml").write_text("<package><name>lesson</name></package>")
    for folder in (lesson.parent, lesson, lesson / "srv"):
        monkeypatch.chdir(folder)
        assert "    lesson/srv/NextGoal\n" in run(capsys, "list")
    assert cli.main(["interface", "show", "NextGoal"]) == 1
    expected = "'NextGoal' has no package; write holozen/srv/NextGoal or lesson/srv/NextGoal"
    assert capsys.readouterr().err == f"holozen interface show: {expected}\n"


def test_nested_types_are_indented_below_their_field(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "show", "geometry_msgs/msg/PoseStamped").splitlines() == [
        "std_msgs/Header header",
        "\tbuiltin_interfaces/Time stamp",
        "\t\tint32 sec",
        "\t\tuint32 nanosec",
        "\tstring frame_id",
        "Pose pose",
        "\tPoint position",
        "\t\tfloat64 x",
        "\t\tfloat64 y",
        "\t\tfloat64 z",
        "\tQuaternion orientation",
        "\t\tfloat64 x",
        "\t\tfloat64 y",
        "\t\tfloat64 z",
        "\t\tfloat64 w 1.0",
    ]


def test_a_type_in_json_has_its_fields_and_constants(capsys: pytest.CaptureFixture[str]) -> None:
    (line,) = run(capsys, "show", "simulation_interfaces/msg/Bounds", "--json").splitlines()
    output = json.loads(line)
    assert output["constants"][2] == {"name": "TYPE_SPHERE", "type": "uint8", "value": 2}
    assert [field["name"] for field in output["fields"]] == ["type", "points"]
    assert output["fields"][1]["array"] == "sequence"
    assert output["fields"][1]["nested"]["name"] == "geometry_msgs/msg/Vector3"
    (line,) = run(capsys, "show", "std_srvs/srv/SetBool", "--json").splitlines()
    assert json.loads(line)["request"]["fields"][0]["name"] == "data"


def test_a_prototype_is_yaml_that_can_be_published(capsys: pytest.CaptureFixture[str]) -> None:
    text = run(capsys, "proto", "geometry_msgs/msg/Twist")
    assert text == "linear:\n  x: 0.0\n  y: 0.0\n  z: 0.0\nangular:\n  x: 0.0\n  y: 0.0\n  z: 0.0\n"
    for kind in (Twist, Odometry):
        message = checked(run(capsys, "proto", kind.ROS), Registry().find(kind.ROS))
        assert convert(message, (kind,), strict=True) == kind()


def test_every_prototype_is_a_message_in_yaml_and_in_json(
    capsys: pytest.CaptureFixture[str],
) -> None:
    registry = Registry()
    for name in registry.names():
        interface = registry.find(name)
        message = interface.parts[0] if interface.parts else interface
        for value in (
            yaml.safe_load(run(capsys, "proto", name)),
            json.loads(run(capsys, "proto", name, "--json")),
        ):
            assert completed(message, value) == value, name
            assert set(value) == {field.name for field in message.fields}, name


def test_a_prototype_in_json_is_what_our_messages_begin_with(
    capsys: pytest.CaptureFixture[str],
) -> None:
    value = json.loads(run(capsys, "proto", "nav_msgs/msg/Odometry", "--json"))
    assert convert(value, (Odometry,)) == Odometry()
    assert value == msgspec.to_builtins(Odometry())


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (
            ("show", "geometry_msgs/msg/Twsit"),
            "no type 'geometry_msgs/msg/Twsit' (did you mean 'geometry_msgs/msg/Twist'?)",
        ),
        (("proto", "Twist"), "'Twist' has no package; write geometry_msgs/msg/Twist"),
        (
            ("show", "a b\x1b"),
            "'a b\\x1b' is not a type; write PACKAGE/msg/NAME, such as geometry_msgs/msg/Twist",
        ),
    ],
    ids=str,
)
def test_what_is_wrong_is_one_line_and_exit_code_1(
    words: tuple[str, ...], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["interface", *words]) == 1
    assert capsys.readouterr() == ("", f"holozen interface {words[0]}: {expected}\n")


def test_wrong_usage_is_exit_code_2(capsys: pytest.CaptureFixture[str]) -> None:
    for words in ("", "shwo", "show", "list --package a", "list x"):
        with pytest.raises(SystemExit) as end:
            cli.main(["interface", *words.split()])
        assert end.value.code == 2
        out, err = capsys.readouterr()
        assert (out, err.count("\n")) == ("", 1)


def test_an_unknown_verb_is_reported_with_the_closest(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        cli.main(["interface", "shwo"])
    assert "did you mean show?" in capsys.readouterr().err.replace("'", "")


def test_it_starts_without_anything_heavy() -> None:
    code = (
        "from holozen.cli import main; main(['interface', 'show', 'nav_msgs/msg/Odometry']); "
        "print(*sys.modules)"
    )
    packages = [path for path in sys.path if path.endswith("site-packages")]
    script = f"import sys; sys.path[:0] = {[str(REPO), *packages]!r}; {code}"
    done = subprocess.run(
        [sys.executable, "-S", "-I", "-c", script], capture_output=True, text=True, check=True
    )
    heavy = {
        "numpy",
        "msgspec",
        "zenoh",
        "yaml",
        "pathlib",
        "dataclasses",
        "inspect",
        "subprocess",
        "asyncio",
        "xacro",
        "xml.etree.ElementTree",
        "difflib",
        "holozen.bus",
    }
    assert heavy & set(done.stdout.splitlines()[-1].split()) == set()


def test_an_action_is_listed_shown_and_its_goal_given(capsys: pytest.CaptureFixture[str]) -> None:
    assert set(run(capsys, "list", "-a").split()) >= {"Actions:", "nav2_msgs/action/NavigateToPose"}
    assert run(capsys, "show", "example_interfaces/Fibonacci").split("---\n") == [
        "int32 order\n",
        "int32[] sequence\n",
        "int32[] sequence\n",
    ]
    shown = json.loads(run(capsys, "show", "example_interfaces/action/Fibonacci", "--json"))
    assert [shown[part]["name"].rpartition("_")[2] for part in ("goal", "result", "feedback")] == [
        "Goal",
        "Result",
        "Feedback",
    ]
    assert run(capsys, "proto", "example_interfaces/action/Fibonacci") == "order: 0\n"
