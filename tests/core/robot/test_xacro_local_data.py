"""What a robot file makes xacro read stays on this machine, unless it belongs to the robot or was
allowed.
"""

from pathlib import Path

import pytest

from holozen.cli import main
from holozen.robot.errors import RobotError
from holozen.robot.files.loading import load
from holozen.robot.files.xacro import expand_xacro
from tests.present import needs

pytestmark = pytest.mark.usefixtures("forked")

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
SECRET = "correct-horse"


@pytest.fixture
def robot(home: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A robot's file in a package of a home folder that holds secrets."""
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setenv("TOKEN", SECRET)
    (home / ".config").mkdir()
    (home / ".config" / "hosts.yml").write_text(f"token: {SECRET}\n")
    (home / "secret.yaml").write_text(f"token: {SECRET}\n")
    (home / "secret.xml").write_text(f"<settings><password>{SECRET}</password></settings>")
    (home / "notes.txt").write_text(SECRET)
    package = home / "bot"
    (package / "urdf").mkdir(parents=True)
    (package / "config").mkdir()
    (package / "package.xml").write_text("<package><name>bot</name></package>")
    (package / "config" / "sizes.yaml").write_text("length: 0.25\n")
    (package / "config" / ".env").write_text(SECRET)
    (package / "config" / "link.yaml").symlink_to(home / "secret.yaml")
    (package / "urdf" / "link.xml").symlink_to(home / "secret.xml")
    return package / "urdf" / "robot.urdf.xacro"


def write(path: Path, body: str) -> Path:
    path.write_text(f"{HEAD}\n<link name='base'/>{body}</robot>")
    return path


def refusal(path: Path) -> str:
    with pytest.raises(RobotError) as error:
        expand_xacro(path)
    message = str(error.value)
    assert "\n" not in message and SECRET not in message
    return message


def test_load_yaml_reads_inside_known_packages_only(robot: Path, home: Path) -> None:
    for function, name in [
        ("xacro.load_yaml", "{home}/secret.yaml"),
        ("load_yaml", "{home}/.config/hosts.yml"),
        ("xacro.load_yaml", "../../secret.yaml"),
        ("load_yaml", "$(find bot)/../secret.yaml"),
        ("xacro.load_yaml", "$(find bot)/config/link.yaml"),
        ("load_yaml", "$(find bot)/config/.env"),
    ]:
        body = (
            f'<xacro:property name="f" value="{name.format(home=home)}"/><l '
            f't="${{{function}(f)}}"/>'
        )
        expected = refusal(write(robot, body))
        assert expected.startswith(
            f"{robot}, line 2: load_yaml reads inside known packages only, and "
        )
        assert expected.endswith("--package NAME=DIR")


def test_load_yaml_reads_what_a_package_holds(robot: Path, home: Path) -> None:
    read = "<l n=\"${xacro.load_yaml('%s')['length']}\"/>"
    for name in ("../config/sizes.yaml", f"{robot.parents[1]}/config/sizes.yaml"):
        assert 'n="0.25"' in expand_xacro(write(robot, read % name))
    (home / "data").mkdir()
    (home / "data" / "sizes.yaml").write_text("length: 7")
    write(robot, read % f"{home}/data/sizes.yaml")
    assert "--package NAME=DIR" in refusal(robot)
    assert 'n="7"' in expand_xacro(robot, packages={"data": home / "data"})


def test_a_home_folder_is_no_package_even_if_it_looks_like_one(robot: Path, home: Path) -> None:
    (home / "urdf").mkdir()
    (home / "package.xml").write_text("<package><name>mine</name></package>")
    alone = write(
        home / "urdf" / "robot.xacro", f"<l t=\"${{xacro.load_yaml('{home}/secret.yaml')}}\"/>"
    )
    assert "load_yaml reads inside known packages only" in refusal(alone)


@pytest.mark.parametrize("use", ["$(env TOKEN)", "$(optenv TOKEN none)"])
def test_an_environment_variable_is_read_only_if_it_is_allowed(robot: Path, use: str) -> None:
    write(robot, f'<l t="{use}"/>')
    message = refusal(robot)
    assert message == (
        f"{robot}, line 2: reads the environment variable 'TOKEN', whose value would be sent on "
        "with the robot;"
        " allow that with --allow-env TOKEN"
    )
    assert f't="{SECRET}"' in expand_xacro(robot, allow_env=["TOKEN"])
    assert message == refusal(robot), "the text that was allowed is not used again"


def test_a_variable_that_is_not_set_has_its_default(
    robot: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("TOKEN")
    write(robot, '<l t="$(optenv TOKEN none)"/>')
    assert 't="none"' in expand_xacro(robot)
    monkeypatch.setenv("TOKEN", SECRET)
    assert "--allow-env TOKEN" in refusal(robot), "nor is the text from when it was not set"


@pytest.mark.parametrize(
    "name", ["{home}/secret.xml", "../../secret.xml", "link.xml", "{home}/secret*.xml"]
)
def test_xml_that_is_no_robot_is_not_included_from_elsewhere(
    robot: Path, home: Path, name: str
) -> None:
    message = refusal(write(robot, f'<xacro:include filename="{name.format(home=home)}"/>'))
    assert (
        message.startswith(f"{robot}, line 2: ")
        and "is outside the robot's folder and all known packages" in message
    )


def test_an_included_file_that_is_no_xml_is_not_quoted(robot: Path, home: Path) -> None:
    message = refusal(write(robot, f'<xacro:include filename="{home}/notes.txt"/>'))
    assert (
        f"{home}/notes.txt is outside the robot's folder and all known packages, and is not a "
        "robot file" in message
    )


def test_robot_files_are_included_from_anywhere_and_other_xml_from_the_package(
    robot: Path, home: Path
) -> None:
    (robot.parent / "part.xml").write_text("<part><a/></part>")
    (home / "arm.xacro").write_text(f"{HEAD}<b/></robot>")
    names = ("part.xml", f"{home}/arm.xacro")
    text = expand_xacro(
        write(robot, "".join(f'<xacro:include filename="{name}"/>' for name in names))
    )
    assert "<a/>" in text and "<b/>" in text


def test_a_robot_is_loaded_with_the_variables_that_are_allowed(robot: Path) -> None:
    write(robot, '<l t="$(env TOKEN)"/>')
    with pytest.raises(RobotError, match="--allow-env TOKEN"):
        load(robot)
    assert load(robot, allow_env=["TOKEN"])


@needs("check")
def test_check_reports_a_variable_and_takes_the_flag(robot: Path) -> None:
    from holozen.check.report import check

    write(robot, '<gazebo t="$(env TOKEN)"/>')
    (finding,) = check(robot)[0]
    assert (finding.rule, finding.place.line) == ("file", 2)
    assert "--allow-env TOKEN" in finding.problem
    assert "file" not in {finding.rule for finding in check(robot, allow_env=["TOKEN"])[0]}


def test_the_flag_of_the_command_line_allows_one_variable(
    robot: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(robot, '<l t="$(env TOKEN)" u="$(env HOME)"/>')
    assert main(["xacro", str(robot), "--allow-env", "TOKEN"]) == 1
    assert capsys.readouterr().err.endswith("allow that with --allow-env HOME\n")
    assert main(["xacro", str(robot), "--allow-env", "TOKEN", "--allow-env", "HOME"]) == 0
    assert SECRET in capsys.readouterr().out
    assert main(["spawn", str(robot)]) == 1
    assert "--allow-env TOKEN" in capsys.readouterr().err
