"""xacro files are expanded without ROS, and every failure is one line with its place."""

import sys
from pathlib import Path

import pytest
import xacro as library

from holozen.robot.errors import RobotError
from holozen.robot.files.loading import both
from holozen.robot.files.xacro import expand_xacro, is_xacro

pytestmark = pytest.mark.usefixtures("forked")

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'


@pytest.fixture
def folder(home: Path) -> Path:
    """A repository cloned as `clone`, without package.xml."""
    (home / "clone" / "urdf").mkdir(parents=True)
    return home / "clone" / "urdf"


CLOSE = "close each element, inner ones first: </name>, or /> at the end of its tag"


def write(folder: Path, body: str, name: str = "robot.urdf.xacro") -> Path:
    path = folder / name
    path.write_text(f"{HEAD}\n{body}\n</robot>")
    return path


def failure(path: Path, **packages: Path) -> str:
    with pytest.raises(RobotError) as error:
        expand_xacro(path, packages=packages)
    message = str(error.value)
    assert "\n" not in message
    return message


def test_the_text_is_the_librarys(folder: Path) -> None:
    path = write(
        folder, '<xacro:property name="x" value="${2*pi}"/><link name="l${x}"/><!-- kept -->'
    )
    assert expand_xacro(path) == library.process(str(path))
    assert 'name="l6.28' in expand_xacro(path)


def test_a_plain_urdf_is_not_expanded(folder: Path) -> None:
    text = '<robot name ="r">\r\n  <!-- $(find holo) ${1/0} --><link name="l"/>\r\n</robot>\r\n'
    path = folder / "robot.urdf"
    path.write_bytes(text.encode())
    assert both(path, {}, {}, strict=True, allow_env=())[1] == text


def test_xacro_in_a_file_called_urdf_is_expanded(folder: Path) -> None:
    path = write(folder, '<xacro:property name="x" value="3"/><link name="l${x}"/>', "robot.urdf")
    assert is_xacro(path, path.read_text())
    assert 'name="l3"' in expand_xacro(path)


def test_a_byte_order_mark_and_crlf_are_accepted(folder: Path) -> None:
    for name in ("robot.urdf", "robot.xacro"):
        path = folder / name
        path.write_bytes(b"\xef\xbb\xbf" + f'{HEAD}\r\n<link name="l"/>\r\n</robot>'.encode())
        assert '<link name="l"/>' in expand_xacro(path)


@pytest.mark.parametrize("package", ["holo", "hb_task_1b"])
def test_find_means_the_tree_of_the_file_whatever_the_package_is_called(
    folder: Path, package: str
) -> None:
    write(folder, '<material name="black"/>', "materials.xacro")
    body = (
        f'<xacro:include filename="$(find {package})/urdf/materials.xacro"/><link name="$(find '
        f'{package})"/>'
    )
    expanded = expand_xacro(write(folder, body))
    assert '<material name="black"/>' in expanded
    assert f'name="{folder.parent}"' in expanded


def test_an_include_of_another_machine_is_found_by_its_name(
    folder: Path, home: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lost = "/home/asha/ws/src/holo/urdf/parts/wheel.xacro"
    path = write(folder, f'<xacro:include filename="{lost}"/>')
    assert f"line 2: No such file or directory: {lost}" in failure(path)
    (folder / "parts").mkdir()
    found = write(folder / "parts", '<xacro:include filename="rim.xacro"/>', "wheel.xacro")
    other = write(folder, "<wrong/>", "wheel.xacro")  # less of the path's end is the same
    write(folder / "parts", "<rim/>", "rim.xacro")
    for _ in range(2):  # the second text comes from the cache
        assert "<rim/>" in expand_xacro(path)
        assert capsys.readouterr().err == (
            f"warning: {path}, line 2: there is no file '{lost}'; {found}, which has the same "
            "name, is included;"
            f" write $(find clone)/urdf/parts/wheel.xacro; others of that name: {other}\n"
        )
    (home / "clone" / "package.xml").write_text("<package><name>holo</name></package>")
    found.touch()
    found.write_text(found.read_text() + "\n")
    expand_xacro(path)
    assert "write $(find holo)/urdf/parts/wheel.xacro" in capsys.readouterr().err


def test_an_include_of_another_machine_is_not_searched_in_the_whole_home(
    folder: Path, home: Path
) -> None:
    write(home, "<a/>", "wheel.xacro")
    assert "No such file" in failure(
        write(folder, '<xacro:include filename="/home/asha/wheel.xacro"/>')
    )


def test_a_given_package_is_used(folder: Path, home: Path) -> None:
    path = write(folder, '<link name="$(find holo)/x"/>')
    assert f'name="{home}/x"' in expand_xacro(path, packages={"holo": home})


def test_arguments_are_given_and_default(folder: Path) -> None:
    path = write(folder, '<xacro:arg name="n" default="a"/><link name="$(arg n)"/>')
    assert 'name="a"' in expand_xacro(path)
    given = {"n": "b"}
    assert 'name="b"' in expand_xacro(path, given)
    assert given == {"n": "b"}


ARGUMENTS = """
<xacro:arg name="height" default="1"/><xacro:if value="0"><xacro:arg name="skipped" default=""/></xacro:if>
<link name="$(arg read)_$(eval evaluated + 1)_${xacro.arg('exposed')}"/>"""  # noqa: E501


def test_an_argument_that_nothing_asks_for_is_a_warning(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(folder, ARGUMENTS)
    given = {"read": "a", "evaluated": "2", "exposed": "b"}
    assert 'name="a_3_b"' in expand_xacro(path, {**given, "height": "2"})
    assert capsys.readouterr().err == ""
    known = "its arguments are: evaluated, exposed, height, read"
    for _ in range(2):  # the second text comes from the cache
        expand_xacro(path, {**given, "hieght": "2", "skipped": "x"})
        assert capsys.readouterr().err == (
            f"warning: {path}: there is no argument 'hieght' (did you mean 'height'?); {known}\n"
            f"warning: {path}: there is no argument 'skipped'; {known}\n"
        )


def test_one_failure_does_not_spoil_the_next_expansion(folder: Path) -> None:
    failure(
        write(folder, '<xacro:macro name="m"><a b="${nope}"/></xacro:macro><xacro:m/>', "bad.xacro")
    )
    message = failure(write(folder, '<link name="${nope}"/>'))
    assert "macro" not in message and "bad.xacro" not in message


def test_an_unknown_package_is_reported_with_the_way_out(home: Path, folder: Path) -> None:
    path = write(home, '<link name="$(find holo)"/>')
    message = failure(path)
    assert message.startswith(f"{path}, line 2: there is no package 'holo'; packages found: none;")
    assert message.endswith("--package holo=DIR")
    including = failure(write(home, '<xacro:include filename="$(find holo)/a.xacro"/>'))
    assert including.endswith("--package holo=DIR")  # nothing was included


def test_broken_xml_is_reported_with_its_line(folder: Path) -> None:
    path = write(folder, "<link>\n<joint>\n</link>")
    assert (
        failure(path)
        == f"{path}, line 4: broken XML: mismatched tag; <joint> of line 3 is still open; {CLOSE}"
    )


def test_a_double_dash_in_a_comment_is_named(folder: Path) -> None:
    path = write(folder, "<!-- a -- b -->")
    assert "; a comment must not contain -- before its end" in failure(path)


def test_broken_xml_in_an_include_is_reported_with_that_file_and_its_line(folder: Path) -> None:
    inner = write(folder, "<link", "inner.xacro")
    path = write(folder, '<xacro:include filename="inner.xacro"/>')
    problem = "broken XML: not well-formed (invalid token)"
    assert failure(path).startswith(
        f"{inner}, line 3: {problem} (included at {path}, line 2); write each element as "
    )


def test_a_bad_expression_is_reported_with_the_chain_of_macros_and_includes(folder: Path) -> None:
    width = '<xacro:property name="width" value="1"/>'
    wheel = '<xacro:macro name="wheel" params="r">\n<xacro:rim r="${r}"/></xacro:macro>'
    rim = '<xacro:macro name="rim" params="r">\n<link name="${r * widht}"/></xacro:macro>'
    inner = write(folder, f'{width}{wheel}{rim}\n\n<xacro:wheel r="2"/>', "wheels.xacro")
    path = write(folder, '<xacro:include filename="wheels.xacro"/>')
    assert failure(path) == (
        f"{inner}, line 4: name 'widht' is not defined when evaluating expression 'r * widht' "
        "(did you mean 'width'?)"
        f" (in macro 'rim' called at {inner}, line 3, in macro 'wheel' called at {inner}, line 6,"
        f" included at {path}, line 2)"
    )


def test_a_macro_without_its_prefix_is_named(folder: Path) -> None:
    for params, name in [('params="name"', "${name}"), ("", "left")]:
        macro = f'<macro name="wheel" {params}>\n<link name="{name}"/></macro>'
        message = failure(write(folder, f"{macro}\n<xacro:wheel/>"))
        assert message.endswith(
            "; <macro> lacks its prefix: write <xacro:macro ...> ... </xacro:macro>"
        )


def test_a_missing_include_under_a_guessed_package_names_the_guess(folder: Path) -> None:
    message = failure(write(folder, '<xacro:include filename="$(find other)/urdf/gone.xacro"/>'))
    assert f"No such file or directory: {folder.parent}/urdf/gone.xacro" in message
    assert f"no package.xml names 'other', so {folder.parent} was taken for it" in message
    assert message.endswith("--package other=DIR")


def test_a_missing_include_under_a_given_package_guesses_nothing(folder: Path) -> None:
    message = failure(
        write(folder, '<xacro:include filename="$(find other)/gone.xacro"/>'), other=folder
    )
    assert message.endswith(f"No such file or directory: {folder}/gone.xacro")


def test_every_other_failure_is_one_line_with_the_file(folder: Path) -> None:
    for body, message in [
        ('<link name="$(arg n)"/>', "$(arg n) has no value; give one with n:=VALUE"),
        ("""<link name="${xacro.arg('n')}"/>""", "there is no 'n'"),
        ("<xacro:wheel/>", "unknown macro name: xacro:wheel"),
        ('<link name="${1/0}"/>', "division by zero when evaluating expression '1/0'"),
        ('<link name="$(fnd holo)"/>', "'dirname', 'arg'] (did you mean 'find'?)"),
        ('<link name="$(pi/2)"/>', "; to calculate, write ${pi/2}"),
        ('<link name="${0.5^2}"/>', "; write ** for a power"),
        (
            '<property name="r" value="1"/><link name="${r}"/>',
            "; <property> lacks its prefix: write <xacro:property ...>",
        ),
        (
            '<xacro:include filename="package://holo/a.xacro"/>',
            "has no package://; write $(find PACKAGE)/...",
        ),
        ('<xacro:if value="maybe"/>', "not a boolean expression"),
        ("<xacro:macro/>", "missing attribute 'name'"),
        ('<xacro:insert_block name="b"/>', 'Undefined block "b"'),
        ('<link name="$(env HOLOZEN_NOT_SET)"/>', "HOLOZEN_NOT_SET"),
    ]:
        line = failure(write(folder, body))
        assert line.startswith(f"{folder}/robot.urdf.xacro, line 2: ") and message in line
        assert len(line) < 1500


def test_a_misspelt_name_is_reported_with_one_that_looks_alike(folder: Path) -> None:
    for body, message in [
        (
            '<xacro:macro name="wheel"><a/></xacro:macro><xacro:wheell/>',
            "unknown macro name: xacro:wheell (did you mean 'wheel'?)",
        ),
        (
            '<xacro:property name="width" value="1"/><l n="${widht}"/>',
            "'widht' (did you mean 'width'?)",
        ),
        ('<l n="${r}"/>', "name 'r' is not defined when evaluating expression 'r'"),
        (
            '<l n="${r}"/>\n<xacro:property name="r" value="1"/>',
            "'r'; it is defined further down, in line 3: move that up",
        ),
        (
            '<xacro:macro name="wheel" params="name"><a/></xacro:macro><l n="${name}"/>',
            "'name'; it is known only inside the macro 'wheel'",
        ),
        (
            '<l n="${r}"/><xacro:macro name="m"><xacro:property name="r" value="1"/></xacro:macro>',
            "'r'; it is known only inside the macro 'm'",
        ),
        (
            '<xacro:macro name="m"><xacro:property name="r" value="1"/></xacro:macro><l n="${r}"/>',
            "'r'; it is known only inside the macro 'm'",
        ),
        (
            '<xacro:property name="y" value="\u22121"/><l n="${y/2}"/>',
            "y is the text '\u22121', not a number; write -1",
        ),
        (
            '<xacro:m/>\n<xacro:macro name="m"><a/></xacro:macro>',
            "xacro:m; it is defined further down, in line 3: move that up",
        ),
        (
            '<xacro:property name="r" value="0,05"/><l n="${r/2}"/>',
            "r is the text '0,05', not a number; write 0.05",
        ),
        (
            '<xacro:arg name="side" default="1"/><l n="$(arg sied)"/>',
            "default in <xacro:arg> (did you mean 'side'?)",
        ),
        (
            '<xacro:macro name="m" params="radius *b"><a/></xacro:macro><xacro:m raduis="1"/>',
            "Invalid parameter \"raduis\" (did you mean 'radius'?)",
        ),
        (
            '<xacro:macro name="m" params="name, x,*b"><a/></xacro:macro><xacro:m name="1"/>',
            "; in xacro:macro write params='name x *b': spaces stand between them, not commas",
        ),
        (
            '<xacro:macro name="m" params="radius *b"><a/></xacro:macro><xacro:m/>',
            "Not enough blocks; xacro:m takes radius, b",
        ),
        (
            '<xacro:property name="b"><a/></xacro:property><xacro:insert_block name="c"/>',
            'Undefined block "c"',
        ),
    ]:
        assert failure(write(folder, body)).endswith(message)


def test_the_line_is_that_of_the_element_also_in_a_block_and_under_a_condition(
    folder: Path,
) -> None:
    bad = '<link\n name="${nope}"/>'
    for body in (f'<xacro:if value="1">\n{bad}</xacro:if>', f"<a/>\n{bad}", f"<a>\n{bad}</a>"):
        assert failure(write(folder, body)).startswith(f"{folder}/robot.urdf.xacro, line 3: ")
    block = (
        '<xacro:macro name="m" params="*b"><xacro:insert_block '
        f'name="b"/></xacro:macro><xacro:m>\n{bad}</xacro:m>'
    )
    assert failure(write(folder, block)).startswith(f"{folder}/robot.urdf.xacro, line 3: ")


@pytest.mark.parametrize("call", ["<xacro:m/>", '<xacro:include filename="inner.xacro"/>'])
def test_after_a_call_or_an_include_the_place_is_the_callers_again(folder: Path, call: str) -> None:
    write(folder, "\n\n<a/>", "inner.xacro")
    message = failure(write(folder, f'<xacro:macro name="m">\n<a/></xacro:macro>\n{call}${{nope}}'))
    assert message.startswith(f"{folder}/robot.urdf.xacro, line 4: ")
    assert "inner" not in message and "macro 'm'" not in message


def test_an_unknown_macro_is_reported_without_anything_around_it(folder: Path) -> None:
    message = f"{folder}/robot.urdf.xacro, line 2: unknown macro name: xacro:wheel"
    assert failure(write(folder, "<xacro:wheel/>")) == message


def test_a_long_chain_is_cut(folder: Path) -> None:
    macros = '<xacro:macro name="m0"><a b="${nope}"/></xacro:macro>' + "".join(
        f'<xacro:macro name="m{i}"><xacro:m{i - 1}/></xacro:macro>' for i in range(1, 8)
    )
    short, long = (failure(write(folder, f"{macros}<xacro:m{top}/>")) for top in (5, 7))
    assert "'m0'" in short and "'m5'" in short and "more" not in short
    assert "'m5'" in long and "'m6'" not in long and long.endswith("and 2 more)")


def test_a_missing_library_is_reported_with_the_way_to_get_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        sys, "path", [place for place in sys.path if not Path(place, "xacro").is_dir()]
    )
    assert (
        failure(write(folder, ""))
        == "the xacro library is missing; install it with: pip install xacro"
    )


def test_a_file_that_cannot_be_read_is_reported(folder: Path) -> None:
    assert failure(folder / "gone.urdf") == f"{folder}/gone.urdf: No such file or directory"
    assert failure(folder) == f"{folder}: Is a directory"
    (folder / "latin.urdf").write_bytes(b"<robot>\n\xe9</robot>")
    problem = "byte 8 is not UTF-8 text; save the file as UTF-8"
    assert failure(folder / "latin.urdf") == f"{folder}/latin.urdf, line 2: {problem}"
    (folder / "empty.xacro").touch()
    assert failure(folder / "empty.xacro").startswith(
        f"{folder}/empty.xacro, line 1: broken XML: the file is empty; "
    )
