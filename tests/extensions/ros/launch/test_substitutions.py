"""Substitutions and conditions: the texts of a launch file, and when its actions are done."""

import sys
from pathlib import Path

import pytest

from holozen.ros import descriptions, packages
from holozen.ros.launch import conditions as c
from holozen.ros.launch import substitutions as s
from holozen.ros.launch.actions import DeclareLaunchArgument, LogInfo
from holozen.ros.launch.launch_context import LaunchContext, LaunchError, text

from ..conftest import Write
from .conftest import Follow

VALUE = s.LaunchConfiguration("value")


@pytest.fixture
def context(my_bot: Path) -> LaunchContext:
    context = LaunchContext()
    context.scope.configurations["value"] = "7"
    context.scope = context.scope.within(my_bot / "launch" / "a.launch.py")
    return context


def test_a_substitution_is_a_text(context: LaunchContext) -> None:
    for substitution, found in [
        (s.TextSubstitution(text="a b"), "a b"),
        (VALUE, "7"),
        (s.LaunchConfiguration("other", default="x"), "x"),
        (s.LaunchConfiguration("other", default=["a", VALUE]), "a7"),
        (s.LaunchConfiguration("other", default=True), "True"),
        (s.PathJoinSubstitution(["a", "b", [VALUE, ".txt"]]), "a/b/7.txt"),
        (s.EnvironmentVariable("NOT_SET", default_value="none"), "none"),
        (s.PythonExpression(["'", VALUE, "' == '7' and ", VALUE, " > 3"]), "True"),
        (s.PythonExpression(["round(degrees(pi))"]), "180"),
        (s.EqualsSubstitution(VALUE, "7"), "true"),
        (s.NotEqualsSubstitution(VALUE, "7"), "false"),
        (s.EqualsSubstitution("true", True), "true"),
        (s.NotSubstitution(s.EqualsSubstitution(VALUE, "8")), "true"),
        (s.AndSubstitution("true", "false"), "false"),
        (s.OrSubstitution("1", "false"), "true"),
        (s.IfElseSubstitution("true", "yes", "no"), "yes"),
        (s.IfElseSubstitution(s.EqualsSubstitution(VALUE, "8"), "yes", ["no", VALUE]), "no7"),
        (s.FindExecutable(name="xacro"), "xacro"),
    ]:
        assert text(context, substitution) == found


def test_places_of_the_launch_file_and_of_packages(
    context: LaunchContext, my_bot: Path, write: Write
) -> None:
    write("src/my_bot/scripts/a.py")
    write("notes.txt", "hello")
    assert text(context, s.ThisLaunchFileDir()) == str(my_bot / "launch")
    assert text(context, s.ThisLaunchFile()) == str(my_bot / "launch" / "a.launch.py")
    assert text(context, [s.FindPackageShare("my_bot"), "/urdf"]) == f"{my_bot}/urdf"
    assert text(context, s.FindPackagePrefix(package="my_bot")) == str(my_bot)
    assert text(context, s.ExecutableInPackage("a.py", "my_bot")) == str(
        my_bot / "scripts" / "a.py"
    )
    assert s.FindPackageShare("other").find("my_bot") == str(my_bot)
    assert text(context, s.FileContent("notes.txt")) == "hello"
    assert text(context, s.FindExecutable(name=sys.executable)) == sys.executable


def test_what_gives_no_text_is_reported_with_its_place(context: LaunchContext) -> None:
    for substitution, message in [
        (
            s.LaunchConfiguration("valu"),
            r"launch argument 'valu' is not declared before it is used \(did you mean 'value'",
        ),
        (s.EnvironmentVariable("NOT_SET"), "the environment variable 'NOT_SET' is not set"),
        (s.FindPackageShare("my_boot"), r"no package 'my_boot' around .* \(did you mean 'my_bot'"),
        (s.ExecutableInPackage("a.py", "my_bot"), "package 'my_bot' has no executable 'a.py'"),
        (s.FindExecutable(name="no_such_program"), "no program 'no_such_program' on the PATH"),
        (
            s.PythonExpression(["1 / 0"]),
            "PythonExpression '1 / 0': ZeroDivisionError: division by zero",
        ),
        (s.PythonExpression(["a b"]), "PythonExpression 'a b': SyntaxError"),
        (s.FileContent("nowhere.txt"), "cannot read nowhere.txt: No such file"),
        (
            s.NotSubstitution("maybe"),
            "the value of NotSubstitution is 'maybe'; it must be true or false",
        ),
        (7, "7 is not a text; write a str, a substitution, or a list of both"),
        (
            s.Command(["rm -r ", "x"]),
            "Command 'rm -r x': only `xacro FILE name:=value ...` and `cat FILE` are run here",
        ),
        (
            s.Command(["xacro", "x"]),
            "Command 'xacrox': .* are run here; its parts are joined as they are: write 'xacro '",
        ),
        (s.Command("xacro"), "Command 'xacro': write `xacro FILE"),
        (s.Command("xacro nowhere.xacro"), "nowhere.xacro: No such file"),
        (s.Command("xacro 'a"), "No closing quotation"),
    ]:
        with pytest.raises(LaunchError, match=message) as error:
            text(context, substitution)
        assert str(error.value).startswith(f"{__file__}:") == (substitution != 7)
        assert str(error.value).isprintable()


XACRO = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="robot" default="none"/><link name="$(arg robot)"/></robot>"""


def test_xacro_is_expanded_here(context: LaunchContext, write: Write) -> None:
    write("my bot.xacro", XACRO)
    for start in ["xacro ", "ros2 run xacro xacro --inorder ", "python3 -m xacro "]:
        found = text(context, s.Command([start, "'my bot.xacro'", " robot:=", VALUE]))
        assert '<link name="7"/>' in found
        assert descriptions.origin(found) == ["my bot.xacro", "robot:=7"]


def test_xacro_reads_an_environment_variable_only_if_the_launch_allows_it(
    context: LaunchContext, write: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TOKEN", "secret")
    write("bot.xacro", XACRO.replace("$(arg robot)", "$(env TOKEN)"))
    with pytest.raises(LaunchError, match="--allow-env TOKEN"):
        text(context, s.Command("xacro bot.xacro"))
    packages.use({}, env=["TOKEN"])
    assert '"secret"' in text(context, s.Command("xacro bot.xacro"))


def test_cat_reads_a_file(context: LaunchContext, write: Write) -> None:
    write("a.urdf", "<robot/>")
    assert text(context, s.Command(["cat ", "a.urdf"])) == "<robot/>"


def test_an_action_is_done_if_its_condition_holds(
    follow: Follow, capsys: pytest.CaptureFixture[str]
) -> None:
    for condition, holds in [
        (c.IfCondition("true"), True),
        (c.IfCondition("False"), False),
        (c.IfCondition(s.LaunchConfiguration("one")), True),
        (c.UnlessCondition("0"), True),
        (c.UnlessCondition(s.PythonExpression(["1 == 1"])), False),
        (c.LaunchConfigurationEquals("one", "1"), True),
        (c.LaunchConfigurationEquals("two", "2"), False),
        (c.LaunchConfigurationEquals("two", None), True),
        (c.LaunchConfigurationNotEquals("one", "1"), False),
    ]:
        follow([LogInfo(msg="done", condition=condition)], one="1")
        assert capsys.readouterr().err == ("done\n" if holds else "")


def test_a_condition_that_is_neither_is_reported_with_its_place(follow: Follow) -> None:
    with pytest.raises(
        LaunchError, match=rf"^{__file__}:\d+: the condition is 'perhaps'; it must be true or false"
    ):
        follow(
            [DeclareLaunchArgument("gui"), LogInfo(msg="", condition=c.IfCondition(VALUE))],
            gui="1",
            value="perhaps",
        )


def test_what_is_no_condition_is_reported(follow: Follow) -> None:
    with pytest.raises(
        LaunchError, match=r"condition=True is not a condition; write IfCondition\(...\)"
    ):
        LogInfo(msg="", condition=True)
