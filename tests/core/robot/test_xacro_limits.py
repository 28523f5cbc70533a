"""No file hangs or fills the machine: each runaway ends in one line with the place, the cause and
the limit.
"""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from holozen.robot.errors import RobotError
from holozen.robot.files import xacro
from holozen.robot.files.elements import MAX_ELEMENTS
from holozen.robot.files.xacro import expand_xacro

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'


def nested(inner: str, outer: Callable[[int], str], depth: int) -> str:
    return inner + "".join(f"\n{outer(i)}" for i in range(1, depth))


MACROS = nested(
    '<xacro:macro name="m0"><a/></xacro:macro>',
    lambda i: f'<xacro:macro name="m{i}">{f"<xacro:m{i - 1}/>" * 10}</xacro:macro>',
    9,
)
BLOCKS = nested(
    '<xacro:property name="b0"><a/></xacro:property>',
    lambda i: (
        "<xacro:property "
        f'name="b{i}">{f"""<xacro:insert_block name="b{i - 1}"/>""" * 10}</xacro:property>'
    ),
    9,
)
PROPERTIES = nested(
    '<xacro:property name="p0" value="aaaaaaaaaa"/>',
    lambda i: f'<xacro:property name="p{i}" value="{f"${{p{i - 1}}}" * 10}"/>',
    12,
)
SLOW = "takes longer than the limit of 0.1 s"
LARGE = "needs too much memory; an expansion has 512 MB"
CALLS = "macros, blocks and includes call each other without end; at most 5000 calls are made"
ENDLESS = "calls itself without end"


@pytest.fixture
def folder(home: Path) -> Path:
    (home / "urdf").mkdir()
    return home / "urdf"


def failure(folder: Path, body: str, head: str = HEAD) -> str:
    path = folder / "robot.xacro"
    path.write_text(f"{head}\n{body}\n</robot>")
    with pytest.raises(RobotError) as error:
        expand_xacro(path)
    message = str(error.value).removeprefix(f"{folder}/")
    assert "\n" not in message
    assert len(message) < 1500
    return message


def test_a_step_that_takes_too_long_or_too_much_memory_ends_in_a_line(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(xacro, "STEP_TIME", 0.1)
    child = "from holozen.robot.files.xacro_child"
    shorter = f"from holozen.robot.files import xacro\nxacro.STEP_TIME = 0.1\n{child}"
    monkeypatch.setattr(xacro, "BOOT", xacro.BOOT.replace(child, shorter))
    rows = [
        ('<a/>\n<l n="${9**9**9}"/>', 3, f"the expression '9**9**9' {SLOW}"),
        ('<l n="$(eval 9**9**9)"/>', 2, f"the expression '$(eval 9**9**9)' {SLOW}"),
        (
            '<l m="${python.sum(python.range(10**12))}"/>',
            2,
            f"'python.sum(python.range(10**12))' {SLOW}",
        ),
        (f'<xacro:macro name="m" params="a:={"b" * 40}\'"/>', 2, f"this element {SLOW}"),
        ("<l n=\"${'a'*10**10}\"/>", 2, f"{LARGE} when evaluating expression ''a'*10**10'"),
        # whichever a busy machine comes to first
        (f'{PROPERTIES}<l n="${{p11}}"/>', 13, f"{LARGE}|{SLOW}"),
    ]
    for body, line, expected in rows:
        check(folder, body, line, expected)


def check(folder: Path, body: str, line: int, expected: str) -> None:
    reported = failure(folder, body)
    assert reported.startswith(f"robot.xacro, line {line}: ")
    assert any(words in reported for words in expected.split("|"))


@pytest.mark.usefixtures("forked")
def test_a_runaway_ends_in_a_line(folder: Path) -> None:
    rows = [
        ('<xacro:macro name="m">\n<xacro:m/></xacro:macro><xacro:m/>', 3, ENDLESS),
        (
            '<xacro:include filename="robot.xacro"/>',
            2,
            "the file includes itself; remove this <xacro:include>",
        ),
        ('<l n="${(lambda f: f(f))(lambda f: f(f))}"/>', 2, ENDLESS),
        (
            '<xacro:property name="a" value="${a}"/><l n="${a}"/>',
            2,
            "circular variable definition: a -> a",
        ),
        (f"{MACROS}<xacro:m8/>", 3, CALLS),
        (f'{BLOCKS}<xacro:insert_block name="b8"/>', 3, CALLS),
        (
            "<a/>" * (MAX_ELEMENTS + 1),
            2,
            f"it expands without end; at most {MAX_ELEMENTS} elements are expanded",
        ),
    ]
    for body, line, expected in rows:
        check(folder, body, line, expected)


@pytest.mark.usefixtures("forked")
@pytest.mark.parametrize(
    "declared",
    [
        '<!ENTITY x "lol">',
        '<!ENTITY x SYSTEM "file:///etc/passwd">',
        '<!ENTITY % x SYSTEM "file:///etc/passwd"> %x;',
    ],
)
def test_entities_are_refused(folder: Path, declared: str) -> None:
    reported = failure(folder, "<l>&x;</l>", f"<!DOCTYPE robot [\n{declared}]>{HEAD}")
    assert reported == "robot.xacro, line 2: the entity 'x' is declared; write out its text instead"


@pytest.mark.usefixtures("forked")
def test_a_file_of_100_mb_is_refused_unread(folder: Path) -> None:
    big = folder / "big.xacro"
    with big.open("wb") as file:
        file.truncate(100_000_000)
    with pytest.raises(
        RobotError, match=r"big\.xacro: the file contains 100\.0 MB of XML; .* at most 4 MB"
    ):
        expand_xacro(big)
    for body in (
        '<xacro:include filename="big.xacro"/>',
        "<l n=\"${xacro.load_yaml('big.xacro')}\"/>",
    ):
        reported = failure(folder, body)
        assert "big.xacro: the file contains 100.0 MB" in reported
        assert f"{folder}/robot.xacro, line 2)" in reported


def test_what_is_no_file_is_not_waited_for(folder: Path) -> None:
    os.mkfifo(folder / "pipe.xacro")
    with pytest.raises(RobotError, match=r"pipe\.xacro: is not a regular file"):
        expand_xacro(folder / "pipe.xacro")
    assert "pipe.xacro: is not a regular file" in failure(
        folder, '<xacro:include filename="pipe.xacro"/>'
    )
    assert "pipe.xacro: is not a regular file" in failure(
        folder, "<l n=\"${xacro.load_yaml('pipe.xacro')}\"/>"
    )


def test_an_expansion_that_waits_for_ever_is_ended(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(xacro, "BOOT", "import time; time.sleep(1000)")
    monkeypatch.setattr(xacro, "PATIENCE", 0.01)
    assert (
        failure(folder, "")
        == "robot.xacro: the file was ended after waiting more than 0.01 s or out of memory"
    )


def test_an_expansion_that_breaks_off_is_reported(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(xacro, "BOOT", "raise SystemExit('no luck')")
    assert failure(folder, "") == "robot.xacro: xacro failed at the file: no luck"


def test_an_honest_large_robot_is_expanded(folder: Path) -> None:
    macro = (
        '<xacro:macro name="l" params="i"><link name="l${i}"><a v="${i * '
        '2}"/><b/></link></xacro:macro>'
    )
    calls = "".join(f'<xacro:l i="{i}"/>' for i in range(1000))
    path = folder / "robot.xacro"
    path.write_text(f"{HEAD}{macro}{calls}</robot>")
    assert expand_xacro(path).count("<link") == 1000
