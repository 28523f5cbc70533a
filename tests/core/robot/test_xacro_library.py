"""The text is the xacro library's own, byte for byte, whatever the file makes use of."""

import sys
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType

import pytest
import xacro as library

from holozen import data
from holozen.packages import find_package
from holozen.robot.errors import RobotError
from holozen.robot.files.xacro import expand_xacro

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
LESSONS = sorted(data.find("urdf").glob("*.xacro"))

BODIES = {
    "find": '<xacro:include filename="$(find holo)/urdf/part.xacro"/><m f="$(find holo)/a.dae"/>',
    "arg": '<xacro:arg name="n" default="${1+1}"/><l n="$(arg n)_${xacro.arg(\'n\')}"/>',
    "env": '<l n="$(env HOLOZEN_TEST)" o="$(optenv HOLOZEN_TEST no)" p="$(optenv HOLOZEN_NOT_SET '
    'a b)"/>',
    "eval": """<xacro:arg name="n" default="3"/><l n="$(eval 2 * n)" o="$(eval n + 1 == 4)" p="$(eval pi)"/>""",  # noqa: E501
    "maths": '<l a="${sin(pi/3)}" b="${2**-3}" d="${max(1, 2.50)}" e="$${x} $$(y) $1" '
    'f="${1e-9}"/>',
    "python": """<l a="${[i*i for i in python.range(3)]}" b="${python.sorted('cab')}" c="${'%.3f' % pi}"/>""",  # noqa: E501
    "cwd": '<l n="$(cwd)"/>',
    "include": '<xacro:include filename="part.xacro"/><xacro:shaft r="2"/>${depth}',
    "include in a namespace": '<xacro:include filename="part.xacro" ns="p"/><xacro:p.shaft '
    'r="3"/><l n="${p.depth}"/>',
    "include by wildcard": '<xacro:include filename="p*.xacro"/><xacro:include '
    'filename="none*.xacro"/>',
    "optional include": '<xacro:include filename="gone.xacro" optional="true"/><l/>',
    "macro": """<xacro:macro name="m" params="a b:=2 c:='x y' d:=^|7 e:=^"><l n="${a}${b}${c}${d}${e}"/></xacro:macro>
        <xacro:property name="e" value="5"/><xacro:m a="1"/><xacro:m a="${1+1}" d="q" b="3"/>""",  # noqa: E501
    "blocks": """<xacro:macro name="m" params="n *one **many"><a><xacro:insert_block name="one"/></a><b>
        <xacro:insert_block name="many"/></b></xacro:macro>
        <xacro:m n="1"><x v="${n2}"/><y><p/><!-- c --><q/></y></xacro:m>""",  # noqa: E501
    "property block": '<xacro:property name="b"><i '
    'v="${1+1}"/></xacro:property><a><xacro:insert_block name="b"/></a>',
    "conditions": """<xacro:if value="${1 == 1}"><a/></xacro:if><xacro:unless value="true"><b/></xacro:unless>
        <xacro:if value="0"><c/></xacro:if><xacro:unless value="${False}"><d/></xacro:unless>""",  # noqa: E501
    "scope": """<xacro:macro name="m" params=""><xacro:property name="p" value="1" scope="parent"/>
        <xacro:property name="g" value="${1+1}" scope="global"/><xacro:property name="l" value="3"/></xacro:macro>
        <xacro:m/><l n="${p} ${g}"/><xacro:property name="p" value="9" lazy_eval="false"/><l n="${p}"/>
        <xacro:property name="q" default="4"/><l n="${q}"/><xacro:property name="q" remove="true"/>""",  # noqa: E501
    "yaml": """<xacro:property name="y" value="${xacro.load_yaml('values.yaml')}"/>
        <l r="${y['wheel']['r']}" d="${y.wheel.r * 2}" u="${y.turn}" n="${len(y.list)} ${y.list[1]}"/>""",  # noqa: E501
    "dynamic call": '<xacro:macro name="m" params="v"><l n="${v}"/></xacro:macro><xacro:call '
    'macro="${\'m\'}" v="1"/>',
    "element and attribute": """<xacro:element xacro:name="${'li'+'nk'}" a="1"/>
        <l><xacro:attribute name="n" value="v${2}"/></l>""",
    "comments": "<!-- kept ${1/0} --><!-- xacro:eval-comments --><!-- ${1+1} --><l/><!-- é -->",
    "text and entities": "<t> ${1+1} &lt;&amp;&gt; é </t><![CDATA[ <raw> ]]><l n='a&quot;b'/>",
    "other namespaces": '<g:x xmlns:g="http://example.org/g" g:a="${1}"/><?pi some?>',
    "redefined symbols": '<xacro:property name="max" value="1"/><l n="${max}"/>',
}


@pytest.fixture
def folder(home: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A robot's folder with a part and some values, and a variable to ask for."""
    folder = home / "holo" / "urdf"
    folder.mkdir(parents=True)
    part = (
        '<xacro:property name="depth" value="7"/><xacro:macro name="shaft" params="r"><s '
        'r="${r}"/></xacro:macro>'
    )
    (folder / "part.xacro").write_text(f'{HEAD}{part}<material name="m"/></robot>')
    (folder / "values.yaml").write_text("wheel: {r: 0.25}\nturn: !degrees 90\nlist: [1, two]\n")
    monkeypatch.setenv("HOLOZEN_TEST", "given")
    return folder


def librarys(path: Path, args: Mapping[str, str], monkeypatch: pytest.MonkeyPatch) -> str:
    """What the library makes of a file where ROS's package index answers as our lookup does."""
    index = ModuleType("ament_index_python.packages")
    index.get_package_share_directory = lambda name: str(find_package(name, path))  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "ament_index_python", ModuleType("ament_index_python"))
    monkeypatch.setitem(sys.modules, "ament_index_python.packages", index)
    return str(library.process_file(str(path), mappings=dict(args)).toprettyxml(indent="  "))


def test_every_file_of_the_lessons_is_as_the_library_makes_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for path in LESSONS:
        assert expand_xacro(path) == librarys(path, {}, monkeypatch), path


def test_what_a_file_may_use_is_as_the_library_makes_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = folder / "robot.xacro"
    uses = "\n".join(f'<use of="{use}"/>{given}' for use, given in BODIES.items())
    text = f'<?xml version="1.0"?>\n{HEAD}<xacro:property name="n2" value="2"/>\n{uses}</robot>'
    for end, args in (("\n", {}), ("\r\n", {"n": "5"})):
        path.write_bytes(text.replace("\n", end).encode())
        expanded = expand_xacro(path, args, allow_env=["HOLOZEN_TEST"])
        assert expanded == librarys(path, args, monkeypatch)
        assert expanded.count("<use ") == len(BODIES)


def test_a_relative_path_is_as_the_library_makes_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "robot.xacro").write_text(f"{HEAD}{BODIES['include']}</robot>")
    monkeypatch.chdir(folder)
    path = Path("robot.xacro")
    assert expand_xacro(path) == librarys(path, {}, monkeypatch)


def test_what_the_librarys_command_line_prints_is_the_same_text(folder: Path) -> None:
    path = folder / "robot.xacro"
    path.write_text(f"{HEAD}{BODIES['macro']}</robot>")
    assert expand_xacro(path) == library.process(str(path))


def test_what_the_library_refuses_is_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for body in [
        '<l n="$(dirname)"/>',
        '<l n="$(anon x)"/>',
        '<l n="$(find a b)"/>',
        "<l n=\"$(eval find('holo'))\"/>",
    ]:
        path = folder / "robot.xacro"
        path.write_text(f"{HEAD}{body}</robot>")
        with pytest.raises(library.XacroException):
            librarys(path, {}, monkeypatch)
        with pytest.raises(RobotError, match=r"robot\.xacro, line 1: "):
            expand_xacro(path)


def test_files_that_nest_as_deep_as_the_library_can_go_are_expanded(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = folder / "robot.xacro"
    macros = "".join(
        f'<xacro:macro name="m{i}"><xacro:m{i - 1}/></xacro:macro>' for i in range(1, 290)
    )
    path.write_text(f'{HEAD}<xacro:macro name="m0"><l/></xacro:macro>{macros}<xacro:m289/></robot>')
    assert expand_xacro(path) == librarys(path, {}, monkeypatch)


def test_the_process_that_asks_is_left_as_it_was(folder: Path) -> None:
    path = folder / "robot.xacro"
    path.write_text(f"{HEAD}{BODIES['find']}</robot>")
    expand_xacro(path)
    assert "ament_index_python" not in sys.modules


def test_a_warning_of_the_library_is_one_line_with_its_place(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = folder / "robot.xacro"
    path.write_text(f"{HEAD}\n{BODIES['redefined symbols']}</robot>")
    for _ in range(2):  # the second text comes from the cache
        expand_xacro(path)
        assert (
            capsys.readouterr().err == f"warning: {path}, line 2: redefining global symbol: max\n"
        )
