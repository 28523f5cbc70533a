"""`holozen run PACKAGE EXECUTABLE` finds what `ros2 run` would, in sources and where it is
installed.
"""

from pathlib import Path

import pytest

from holozen.messages.definitions import InterfaceError
from holozen.messages.registry import Registry
from holozen.ros import packages
from holozen.ros.executables import NotFound, find, from_file, names

from .conftest import Write


def test_a_script_is_found_with_and_without_its_ending(my_bot: Path, write: Write) -> None:
    for name in ["controller", "controller.py"]:
        for folder in ["scripts", "my_bot", "nodes", "src"]:
            path = write(f"src/my_bot/{folder}/controller.py")
            script = find("my_bot", name)
            assert (script.path, script.root, script.function) == (path, path.parent, "")
            path.unlink()


def test_a_script_without_ending_has_to_be_executable_and_python(
    my_bot: Path, write: Write
) -> None:
    path = write("src/my_bot/scripts/drive", "#!/usr/bin/env python3\n")
    with pytest.raises(NotFound, match="no executable 'drive'"):
        find("my_bot", "drive")
    path.chmod(0o755)
    assert find("my_bot", "drive").path == path
    path.write_text("\x7fELF\0")
    with pytest.raises(NotFound, match="drive is not a Python script: its name must end"):
        find("my_bot", "drive")


def test_a_link_runs_beside_what_it_leads_to(my_bot: Path, write: Write) -> None:
    """As Python does: `import helper` is looked up where the file really lies."""
    real = write("elsewhere/controller.py")
    (my_bot / "scripts").mkdir()
    (my_bot / "scripts" / "controller.py").symlink_to(real)
    assert find("my_bot", "controller.py").root == real.parent


SETUP_PY = """
from setuptools import setup
package_name = 'my_bot'
setup(name=package_name, entry_points={'console_scripts': [
    'drive = my_bot.controller:main',
    f'shape = {package_name}.shape:run',
    'pose = ' + package_name + '.pose:Pose.start',
]})
"""


def test_console_scripts_are_read_from_setup_py_without_running_it(
    my_bot: Path, write: Write
) -> None:
    write("src/my_bot/setup.py", SETUP_PY + "raise SystemExit('this was run')")
    for name, module, function in [
        ("drive", "my_bot.controller", "main"),
        ("shape", "my_bot.shape", "run"),
        ("pose", "my_bot.pose", "Pose.start"),
    ]:
        path = write(f"src/my_bot/{module.replace('.', '/')}.py")
        script = find("my_bot", name)
        assert (script.module, script.function, script.path, script.root) == (
            module,
            function,
            path,
            my_bot,
        )


def test_console_scripts_are_read_from_setup_cfg(my_bot: Path, write: Write) -> None:
    write(
        "src/my_bot/setup.cfg",
        "[options.entry_points]\nconsole_scripts =\n  drive = my_bot.controller:main\n",
    )
    write("src/my_bot/my_bot/controller.py")
    assert find("my_bot", "drive").function == "main"


def test_a_console_script_without_its_module_is_reported(my_bot: Path, write: Write) -> None:
    write("src/my_bot/setup.py", SETUP_PY)
    with pytest.raises(
        NotFound, match=r"'drive' is my_bot.controller:main in its setup file, but .*\.py does not"
    ):
        find("my_bot", "drive")


def test_a_setup_file_that_cannot_be_read_is_reported(my_bot: Path, write: Write) -> None:
    for file, text, message in [
        ("setup.py", "setup(\n  entry_points={'console", r"setup.py:2: unterminated string"),
        ("setup.cfg", "[options.entry_points", r"setup.cfg: File contains no section headers"),
    ]:
        write(f"src/my_bot/{file}", text)
        with pytest.raises(NotFound, match=message) as error:
            find("my_bot", "drive")
        assert str(error.value).isprintable()


CMAKE = """
project(my_bot)
set(TOOLS tools/a.py "${CMAKE_CURRENT_SOURCE_DIR}/tools/deep/b") # install(PROGRAMS no.py DESTINATION lib/x)
file(GLOB MORE more/*.py)
install(PROGRAMS ${TOOLS}
  ${MORE} lost.py
  DESTINATION lib/${PROJECT_NAME})
install(PROGRAMS tools/a.py DESTINATION lib/${PROJECT_NAME} RENAME renamed)
install(DIRECTORY demos/ DESTINATION lib/${PROJECT_NAME})
"""  # noqa: E501


def test_programs_that_the_build_installs_are_found_wherever_they_lie(
    my_bot: Path, write: Write
) -> None:
    write("src/my_bot/CMakeLists.txt", CMAKE)
    write("src/my_bot/setup.py", "setup(scripts=['other/e.py'])")
    for name in ("tools/a.py", "tools/deep/b", "more/c.py", "demos/d.py", "other/e.py", "no.py"):
        write(f"src/my_bot/{name}", "#!/usr/bin/env python3\n")
    known = names("my_bot")
    assert known == ["a.py", "b", "c.py", "d.py", "e.py", "renamed"]
    assert [find("my_bot", name).path.name for name in known] == [
        "a.py",
        "b",
        "c.py",
        "d.py",
        "e.py",
        "a.py",
    ]


def test_where_it_is_installed_lib_is_looked_into(
    home: Path, write: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    (home / "install/share/my_bot").mkdir(parents=True)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(home / "install"))
    path = write("install/lib/my_bot/controller.py")
    packages.use({})
    assert find("my_bot", "controller.py").path == path


def test_an_unknown_executable_is_reported_with_all_there_are(my_bot: Path, write: Write) -> None:
    write("src/my_bot/setup.py", SETUP_PY)
    write("src/my_bot/scripts/service_node.py")
    write("src/my_bot/my_bot/__init__.py")
    with pytest.raises(NotFound) as error:
        find("my_bot", "servce_node.py")
    message = (
        "no executable 'servce_node.py' (did you mean 'service_node.py'?); executables in "
        f"{my_bot}: "
    )
    assert str(error.value).endswith(f"{message}drive, pose, service_node.py, shape")
    with pytest.raises(NotFound, match=r"^give an executable; executables in"):
        find("my_bot", "")


def test_an_unknown_package_is_reported_with_those_around(my_bot: Path) -> None:
    with pytest.raises(
        NotFound, match=r"no package 'my_boot' around .* \(did you mean 'my_bot'\?\); .* --package"
    ):
        find("my_boot", "controller.py")


def test_a_folder_without_a_package_name_cannot_be_run(home: Path, write: Write) -> None:
    write("urdf/hb_bot.urdf.xacro")
    path = write("scripts/controller.py")
    packages.use({})
    with pytest.raises(
        NotFound, match=rf"^no package 'hb_contrl' around {home}; packages found: none; to give .*"
    ):
        find("hb_contrl", "controller.py")
    with pytest.raises(NotFound, match=r"^no package 'hb_contrl'"):
        find("hb_contrl", "other.py", nameless=True)
    assert find("hb_contrl", "controller.py", nameless=True).path == path


def test_a_package_is_found_from_anywhere_in_its_workspace(
    my_bot: Path, write: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    write("src/my_bot/scripts/a.py")
    for where in [my_bot.parents[1], my_bot.parent, my_bot, my_bot / "scripts"]:
        monkeypatch.chdir(where)
        packages.use({})
        assert find("my_bot", "a").path == my_bot / "scripts" / "a.py"


def test_a_package_in_a_repository_of_packages_is_found(my_bot: Path, write: Write) -> None:
    write("src/repo/arm/package.xml", "<package><name>arm</name></package>")
    write("src/repo/arm/scripts/a.py")
    assert find("arm", "a").path.parts[-4:] == ("repo", "arm", "scripts", "a.py")


HB = "<package><name>hb</name></package>"


@pytest.mark.parametrize("place", ["ws", "ws/src", "ws/src/other/scripts", "ws/src/hb/scripts"])
def test_a_package_in_the_workspace_is_run_and_none_above_or_beside_it(
    write: Write, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    for folder in ["", "hb/", "ws/src/hb/", "ws/src/old/deep/hb/"]:
        write(f"{folder}package.xml", HB)
        write(f"{folder}scripts/ctl.py")
    write("ws/src/other/package.xml", "<package><name>other</name></package>")
    write("ws/src/other/scripts/a.py")
    monkeypatch.chdir(place)
    packages.use({})
    assert find("hb", "ctl").root.parts[-4:] == ("ws", "src", "hb", "scripts")


def test_two_packages_that_are_equally_near_are_named_and_not_run(
    home: Path, write: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder in ["src/hb", "src/hb_copy"]:
        write(f"{folder}/package.xml", HB)
        write(f"{folder}/scripts/ctl.py")
        write(f"{folder}/msg/Thing.msg")
    (home / "src" / "linked").symlink_to(home / "src" / "hb")
    both = (
        rf"^several packages are called 'hb', and none is nearer: {home}/src/hb, "
        rf"{home}/src/hb_copy; choose one by"
    )
    packages.use({})
    with pytest.raises(NotFound, match=both):
        find("hb", "ctl")
    with pytest.raises(InterfaceError, match=both):
        Registry().find("hb/msg/Thing")
    monkeypatch.chdir("src/hb_copy/scripts")
    packages.use({})
    assert find("hb", "ctl").path == home / "src/hb_copy/scripts/ctl.py"


def test_the_packages_of_a_workspace_inside_a_repository_are_found_from_its_root(
    home: Path, write: Write
) -> None:
    write("src/ws/src/hb/package.xml", HB)
    path = write("src/ws/src/hb/scripts/ctl.py")
    write("src/ws/src/hb/msg/Thing.msg", "float64 width\n")
    packages.use({})
    assert find("hb", "ctl").path == path
    assert "hb/msg/Thing" in Registry().names()
    assert Registry().find("hb/msg/Thing").fields[0].name == "width"


def test_a_file_that_is_not_there_is_reported_with_its_neighbours(write: Write) -> None:
    path = write("scripts/controller.py")
    with pytest.raises(
        NotFound, match=r"controler.py does not exist \(did you mean 'controller.py'\?\)"
    ):
        from_file(path.with_name("controler.py"))
    with pytest.raises(
        NotFound, match=r"x\.py does not exist; Python files in that folder: controller\.py"
    ):
        from_file(path.with_name("x.py"))
    with pytest.raises(NotFound, match="is a folder; give a Python file, or PACKAGE EXECUTABLE"):
        from_file(path.parent)
