"""`holozen check` as a person runs it."""

import json
from functools import partial
from pathlib import Path

import pytest

from holozen import data
from tests.integration.conftest import Verb

BOT = data.find("urdf", "hb_bot.urdf.xacro")
TYPO = """<robot name="r">
<link name="a">
<inertial><mass value="1"/><inertia ixx="1" iyy="1" ivz="0" izz="1"/></inertial>
<collision><geometry><sphere radius="1"/></geometry></collision></link></robot>"""
WARNS = """<robot name="r">
<link name="a"><inertial><mass value="1"/><inertia ixx="9" iyy="9" izz="9" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><sphere radius="0.1"/></geometry></collision></link></robot>"""  # noqa: E501


@pytest.fixture
def run(call: Verb) -> Verb:
    return partial(call, "check")


def test_a_good_file_is_summed_up_in_one_line(run: Verb, tmp_path: Path) -> None:
    done = run(str(BOT))
    assert (done.returncode, done.stdout, done.stderr) == (
        0,
        "ok: 5 links, 3 wheels, planar_move on cmd_vel\n",
        "",
    )
    (tmp_path / "r.urdf").write_text(WARNS.replace("9", "0.004"))
    assert run(str(tmp_path / "r.urdf"), "--json").stdout == ""
    # wheels whose collision shapes are those of rollers
    omni = "ok: 40 links, holozen_omni_drive on cmd_vel\n"
    assert run(str(data.find("urdf", "omni.urdf.xacro"))).stdout == omni
    force = (
        '<plugin name="f" '
        'filename="libgazebo_ros_force.so"><bodyName>a</bodyName><topicName>push</topicName></plugin>'
    )
    (tmp_path / "f.urdf").write_text(
        WARNS.replace("9", "0.004").replace("</robot>", f"<gazebo>{force}</gazebo></robot>")
    )
    assert run(str(tmp_path / "f.urdf")).stdout == "ok: 1 link, force on push\n"
    expected = "ok: 1 link, no drive: holozen spawn --drive planar_move moves it as a whole\n"
    assert run(str(tmp_path / "r.urdf")).stdout == expected
    assert run(str(data.find("urdf", "materials.xacro"))).stdout.startswith(
        "ok: no links: a file for others to include"
    )


def test_a_file_without_links_is_an_error_unless_it_is_for_others_to_include(
    run: Verb, tmp_path: Path
) -> None:
    for name in ("r.urdf", "r.xacro"):
        (tmp_path / name).write_text('<robot name="r"/>')
        done = run(str(tmp_path / name))
        assert (done.returncode, done.stdout.count("error: <robot name='r'> has no <link>")) == (
            1,
            1,
        ), done


def test_an_error_is_reported_with_its_line_and_the_fix(run: Verb, tmp_path: Path) -> None:
    (tmp_path / "r.urdf").write_text(TYPO)
    done = run(str(tmp_path / "r.urdf"))
    assert (done.returncode, done.stderr) == (1, "")
    where, why = done.stdout.splitlines()
    assert where.startswith(f"{tmp_path / 'r.urdf'}:3: error: ")
    assert "'ivz'" in where and where.endswith("[attribute]")
    assert "write iyz=" in why or "write ixz=" in why or "write ixy=" in why


def test_warnings_alone_are_no_failure(run: Verb, tmp_path: Path) -> None:
    (tmp_path / "r.urdf").write_text(WARNS)
    done = run(str(tmp_path / "r.urdf"))
    assert done.returncode == 0
    assert ": warning: " in done.stdout and "[inertia-size]" in done.stdout


def test_json_has_one_object_a_line(run: Verb, tmp_path: Path) -> None:
    (tmp_path / "r.urdf").write_text(TYPO)
    done = run(str(tmp_path / "r.urdf"), "--json")
    (finding,) = map(json.loads, done.stdout.splitlines())
    assert done.returncode == 1
    assert set(finding) == {
        "severity",
        "rule",
        "file",
        "line",
        "expanded",
        "problem",
        "reason",
        "fix",
    }
    assert (finding["line"], finding["rule"], finding["severity"]) == (3, "attribute", "error")


def test_a_task_sets_size_and_names(run: Verb, tmp_path: Path) -> None:
    (tmp_path / "names.txt").write_text("link base_link\nlink body\n")
    done = run(str(BOT), "--fits", "0.4x0.2", "--require", str(tmp_path / "names.txt"))
    assert done.returncode == 1
    assert "has to fit into 0.4 x 0.2 m" in done.stdout
    assert (
        "there is no link 'body'" in done.stdout
        and "'base_link'" not in done.stdout.partition("there are:")[0]
    )


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--fits", "big"], "write metres as 0.4x0.2"),
        (["n=1"], "write n:=1"),
        (["--fits", "1x-1"], "write metres"),
        (["--fits", "400x200"], "(length, width, height), each at most 20"),
    ],
)
def test_wrong_words_are_reported(run: Verb, words: list[str], expected: str) -> None:
    done = run(str(BOT), *words)
    assert done.returncode == 2
    assert expected in done.stderr and "Traceback" not in done.stderr


def test_a_file_that_is_not_there_is_one_finding(run: Verb, tmp_path: Path) -> None:
    done = run(str(tmp_path / "nowhere.xacro"))
    assert (done.returncode, len(done.stdout.splitlines()), done.stderr) == (1, 2, "")
