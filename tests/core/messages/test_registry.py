"""Types are found by name, in our tables and in packages; a wrong name is reported with the closest
right one.
"""

from pathlib import Path

import pytest

from holozen.messages.definitions import Field, InterfaceError, whole_text
from holozen.messages.registry import Registry
from holozen.messages.type_hash import type_hash


@pytest.fixture
def lesson(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A student's package, with the interface of the lesson. The folders of other tests are not
    searched.
    """
    tmp_path.chmod(0o1777)
    for name, text in {
        "srv/NextGoal.srv": "int64 request_goal\n---\nfloat64 x_goal\nint64 end_of_list\n",
        "msg/Where.msg": "Header header\ngeometry_msgs/Pose2D at\nSpot[] spots\n",
        "msg/Spot.msg": "string<=8 name\n",
        "msg/README.md": "no definition",
        "package.xml": "<package><name>lesson</name></package>",
    }.items():
        path = tmp_path / "ws" / "src" / "lesson" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    for variable in ("AMENT_PREFIX_PATH", "ROS_PACKAGE_PATH"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path / "ws" / "src" / "lesson"


def refusal(registry: Registry, name: str) -> str:
    with pytest.raises(InterfaceError) as error:
        registry.find(name)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_a_message_has_its_fields_and_those_of_its_fields() -> None:
    twist = Registry().find("geometry_msgs/msg/Twist")
    assert (twist.name, twist.kind, twist.package) == (
        "geometry_msgs/msg/Twist",
        "msg",
        "geometry_msgs",
    )
    linear, angular = twist.fields
    assert (linear.name, angular.name, linear.type) == (
        "linear",
        "angular",
        "geometry_msgs/msg/Vector3",
    )
    assert linear.nested
    assert linear.nested.fields == (
        Field("x", "float64"),
        Field("y", "float64"),
        Field("z", "float64"),
    )


def test_a_service_has_a_request_and_a_response_that_are_messages_too() -> None:
    registry = Registry()
    half = registry.find("std_srvs/srv/SetBool_Request")
    service = registry.find("std_srvs/srv/SetBool")
    assert (service.kind, service.fields) == ("srv", ())
    assert service.request is half
    assert service.response is registry.find("std_srvs/srv/SetBool_Response")
    assert (half.kind, [field.name for field in half.fields]) == ("msg", ["data"])


def test_other_spellings_of_a_name_are_understood() -> None:
    for name in [
        "geometry_msgs/Twist",
        "geometry_msgs::msg::dds_::Twist_",
        "geometry_msgs::msg::Twist",
    ]:
        registry = Registry()
        assert registry.find(name) is registry.find("geometry_msgs/msg/Twist")


def test_a_short_name_may_be_a_service() -> None:
    assert Registry().find("std_srvs/Trigger").kind == "srv"


def test_a_package_that_is_given_is_read(lesson: Path) -> None:
    registry = Registry({"lesson": lesson})
    service = registry.find("lesson/srv/NextGoal")
    assert service.request
    assert service.request.fields == (Field("request_goal", "int64"),)
    where = registry.find("lesson/msg/Where")
    assert [field.type for field in where.fields] == [
        "std_msgs/msg/Header",
        "geometry_msgs/msg/Pose2D",
        "lesson/msg/Spot",
    ]
    assert {
        "lesson/msg/Spot",
        "lesson/msg/Where",
        "lesson/srv/NextGoal",
        "std_msgs/msg/Header",
    } <= set(registry.names())
    assert not any("README" in name for name in registry.names())


@pytest.mark.parametrize("variable", ["AMENT_PREFIX_PATH", "ROS_PACKAGE_PATH"])
def test_a_package_of_the_environment_is_read(
    variable: str, lesson: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    prefix = lesson.parents[2] / "install"
    (prefix / "share").mkdir(parents=True)
    (prefix / "share" / "lesson").symlink_to(lesson)
    monkeypatch.setenv(
        variable, f"/no/such/place:{prefix if variable.startswith('A') else lesson.parent}"
    )
    monkeypatch.chdir("/")
    registry = Registry()
    assert registry.find("lesson/srv/NextGoal").kind == "srv"
    assert "lesson/srv/NextGoal" in registry.names()


def test_a_package_around_the_working_folder_is_read(
    lesson: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder in (lesson, lesson.parent, lesson.parents[1]):
        monkeypatch.chdir(folder)
        assert Registry().find("lesson/srv/NextGoal").kind == "srv"


def test_a_package_that_is_given_comes_before_ours(lesson: Path) -> None:
    (lesson / "msg" / "Twist.msg").write_text("bool mine\n")
    assert Registry({"geometry_msgs": lesson}).find("geometry_msgs/msg/Twist").fields == (
        Field("mine", "bool"),
    )


def test_a_wrong_name_is_reported_with_the_closest(lesson: Path) -> None:
    for name, reason in [
        (
            "geometry_msgs/msg/Twsit",
            "no type 'geometry_msgs/msg/Twsit' (did you mean 'geometry_msgs/msg/Twist'?)",
        ),
        ("nav_msgs/msg/Twist", "no type 'nav_msgs/msg/Twist'; write geometry_msgs/msg/Twist"),
        (
            "std_msgs/msg/string",
            "no type 'std_msgs/msg/string' (did you mean 'std_msgs/msg/String'?)",
        ),
        ("geometry_msgs/msg/TWIST", " (did you mean 'geometry_msgs/msg/Twist'?)"),
        ("rosgraph_msgs/msg/Zzzzz", "; known: rosgraph_msgs/msg/Clock"),
        (
            "geometry_msg/msg/Twist",
            "no package 'geometry_msg' with interfaces (did you mean 'geometry_msgs'?)",
        ),
        ("lesson/srv/NextGoal", "; give its folder: --package lesson=DIR"),
        ("Twist", "'Twist' has no package; write geometry_msgs/msg/Twist"),
        ("Zwist", "'Zwist' is not a type; `holozen interface list` lists all"),
        ("a/msg/../B", "'a/msg/../B' is not a type; write PACKAGE/msg/NAME"),
        ("../a/b", "is not a type"),
        ("a/idl/B", "is not a type"),
        (
            "example_interfaces/action/Fibonaci",
            "did you mean 'example_interfaces/action/Fibonacci'?",
        ),
        ("", "'' is not a type"),
        ("std_srvs/srv/Trigger_Requst", "did you mean 'std_srvs/srv/Trigger'?"),
    ]:
        assert reason in refusal(Registry(), name)


def test_a_wrong_name_is_looked_up_once(lesson: Path) -> None:
    registry = Registry({"lesson": lesson})
    message = refusal(registry, "lesson/msg/New")
    (lesson / "msg" / "New.msg").write_text("bool a\n")
    assert refusal(registry, "lesson/msg/New") == message
    assert Registry({"lesson": lesson}).find("lesson/msg/New").fields == (Field("a", "bool"),)


def test_an_error_names_some_of_many_types(lesson: Path) -> None:
    for number in range(30):
        (lesson / "msg" / f"Many{number:02}.msg").touch()
    message = refusal(Registry({"lesson": lesson}), "lesson/msg/Zzz")
    assert "; known: lesson/msg/Many00, " in message
    assert message.endswith("lesson/msg/Many19 and 13 more")


def test_a_wrong_line_of_a_nested_type_is_reported_with_its_place(lesson: Path) -> None:
    (lesson / "msg" / "Spot.msg").write_text("# a spot\nflot64 x\n")
    message = refusal(Registry({"lesson": lesson}), "lesson/msg/Where")
    assert message == f"{lesson}/msg/Spot.msg:2: no type 'lesson/flot64' (did you mean 'float64'?)"
    (lesson / "msg" / "Spot.msg").write_text("float x\n")
    message = refusal(Registry({"lesson": lesson}), "lesson/msg/Where")
    assert message.endswith("/msg/Spot.msg:1: no type 'lesson/msg/float'; write float32 or float64")


def refusal_of_file(lesson: Path, file: str, text: str) -> str:
    """Why a file of the package is refused that holds this text."""
    (lesson / file).write_text(text)
    return refusal(Registry({"lesson": lesson}), f"lesson/{file.partition('.')[0]}")


def test_names_that_ros_refuses_are_reported_with_those_to_write(lesson: Path) -> None:
    for file, text, reason in [
        (
            "msg/Spot.msg",
            "float64 xGoal",
            "'xGoal' is not a valid name of a field; ROS 2 allows lower-case letters",
        ),
        ("msg/Spot.msg", "float64 x__goal_", "between them: x_goal"),
        (
            "msg/Spot.msg",
            "float64 x = 3",
            "name of a constant; write X, or for a field with a default float64 x 3.0",
        ),
        ("msg/Spot.msg", "Twist command", "no type 'lesson/Twist'; write geometry_msgs/Twist"),
        ("msg/Spot.msg", "Float64 x", "no type 'lesson/msg/Float64'; write float64"),
        (
            "msg/Spot.msg",
            "geometry_msgs/msg/Twist t",
            "'msg' that ROS 2 refuses in a file; write geometry_msgs/Twist",
        ),
        (
            "srv/next_goal.srv",
            "---",
            "'next_goal' is not a valid name of a type; ROS 2 allows letters and digits",
        ),
        ("srv/next_goal.srv", "---", "upper-case letter: NextGoal"),
    ]:
        message = refusal_of_file(lesson, file, text)
        assert message.startswith(f"{lesson}/{file}") and reason in message


def test_a_definition_from_elsewhere_may_have_names_of_ros_1() -> None:
    text = "float64 xGoal\ngeometry_msgs/msg/Twist t\nint8 max=3"
    assert [field.name for field in Registry().learn("old/msg/Goal", lambda _: text).fields] == [
        "xGoal",
        "t",
    ]


def test_what_is_no_definition_is_reported_with_its_file(lesson: Path) -> None:
    for file, text, reason in [
        (
            "msg/Spot.msg",
            "Spot other",
            "lesson/msg/Spot contains itself: lesson/msg/Spot > lesson/msg/Spot",
        ),
        ("msg/Spot.msg", "Where other", "contains itself"),
        ("msg/Spot.msg", "bool a\n---\nbool b", "'---' makes 2 parts; a .msg has 1"),
        ("msg/Spot.msg", "std_srvs/srv/Trigger a", "a field is a message, not a service"),
        ("msg/Spot.msg", "uint8[1000000000] a", "is too large: at least 1000000000 bytes"),
        ("srv/Spot.srv", "bool a", "'---' makes 1 part; a .srv has 2"),
    ]:
        assert reason in refusal_of_file(lesson, file, text)


def test_types_that_double_at_each_level_are_refused(lesson: Path) -> None:
    (lesson / "msg" / "T0.msg").write_text("bool a\n")
    for level in range(1, 16):
        (lesson / "msg" / f"T{level}.msg").write_text(f"T{level - 1} a\nT{level - 1} b\n")
    assert "is too large" in refusal(Registry({"lesson": lesson}), "lesson/msg/T15")


def test_types_that_are_nested_too_deeply_are_refused(lesson: Path) -> None:
    (lesson / "msg" / "T0.msg").write_text("bool a\n")
    for level in range(1, 300):
        (lesson / "msg" / f"T{level}.msg").write_text(f"T{level - 1} a\n")
    assert "nested more than 50 deep" in refusal(Registry({"lesson": lesson}), "lesson/msg/T299")


def test_unreadable_files_are_reported(lesson: Path) -> None:
    import os

    (lesson / "msg" / "Latin.msg").write_bytes(b"string a \xff\n")
    (lesson / "msg" / "Folder.msg").mkdir()
    os.mkfifo(lesson / "msg" / "Pipe.msg")
    registry = Registry({"lesson": lesson, "gone": lesson / "gone", "empty": lesson / "srv"})
    assert refusal(registry, "lesson/msg/Latin").endswith("Latin.msg: the text is not UTF-8")
    assert refusal(registry, "lesson/msg/Folder").endswith("Folder.msg is not a file")
    assert refusal(registry, "lesson/msg/Pipe").endswith("Pipe.msg is not a file")
    assert (
        refusal(registry, "gone/msg/A") == f"--package gone={lesson}/gone: there is no such folder"
    )
    assert "no .msg, .srv or .action files" in refusal(registry, "empty/msg/A")


def test_an_action_has_its_parts_with_the_id_of_a_goal() -> None:
    action = Registry().find("example_interfaces/Fibonacci")
    assert (action.name, action.kind) == ("example_interfaces/action/Fibonacci", "action")
    fields = {
        part.name.rpartition("_")[2]: [field.spelled(action.package) for field in part.fields]
        for part in action.parts
    }
    assert fields == {
        "Goal": ["int32"],
        "Result": ["int32[]"],
        "Feedback": ["int32[]"],
        "SendGoal": [],
        "GetResult": [],
        "FeedbackMessage": [
            "unique_identifier_msgs/UUID",
            "example_interfaces/action/Fibonacci_Feedback",
        ],
    }
    response = Registry().find("example_interfaces/action/Fibonacci_GetResult_Response")
    assert [field.name for field in response.fields] == ["status", "result"]


def test_an_action_is_learned_from_its_whole_text(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    name = "lesson/action/Turn_FeedbackMessage"
    known = Registry({"lesson": tmp_path})
    (tmp_path / "action").mkdir()
    (tmp_path / "action" / "Turn.action").write_text("float64 angle\n---\n---\nfloat64 left\n")
    text = whole_text(known.find(name))
    learned = Registry().learn(name, lambda _: text)
    assert [field.name for field in learned.fields] == ["goal_id", "feedback"]
    assert type_hash(learned) == type_hash(known.find(name))


def test_an_action_file_has_three_sections_and_is_no_field(lesson: Path) -> None:
    (lesson / "action").mkdir()
    (lesson / "action" / "Turn.action").write_text("float64 angle\n---\n")
    (lesson / "msg" / "Bad.msg").write_text("example_interfaces/action/Fibonacci it\n")
    registry = Registry({"lesson": lesson})
    assert "'---' makes 2 parts; a .action has 3" in refusal(registry, "lesson/action/Turn")
    assert "a field is a message, not an action" in refusal(registry, "lesson/msg/Bad")
