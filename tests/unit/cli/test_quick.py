"""Plain command lines are read as argparse reads them, and whatever is not plain is left to it."""

import io
from collections.abc import Callable
from contextlib import redirect_stderr
from functools import partial
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holozen.cli import node, param, quick, service, topic
from holozen.flags import Parser, key, number

Fill = Callable[[Any], object]

VERBS: dict[str, Fill] = {
    **{
        f"{noun.name} {verb}": partial(noun._fill, name=verb)
        for noun in (topic.NOUN, service.NOUN, node.NOUN)
        for verb in noun.modules
    },
    **{f"param {verb}": partial(param._arguments, verb=verb) for verb in param.VERBS},
}
WORDS = (
    "odom", "/odom", "*/odom", "", "3", "0.5", "-1", "-", "--", "{}", "a b", "nan", "std_srvs/srv/Trigger", "--once",
    "--onc", "-w", "--timeout", "--timeout=3", "--json", "--wire", "cdr", "cdx", "--listen", "tcp/127.0.0.1:7", "--cfg",
    "a:1", "--mode", "client", "-l", "--field", "--rate", "-r", "-t", "-v", "--no-wait", "--help", "--param-prefixes",
    "--any", "-rt", "--stdin",
)  # fmt: skip


def by_argparse(fill: Fill, words: list[str]) -> dict[str, Any] | None:
    """What argparse makes of it; None where it ends the process."""
    parser = Parser(prog="verb", add_help=True)
    fill(parser)
    with redirect_stderr(io.StringIO()):
        try:
            return vars(parser.parse_args(words))
        except SystemExit:
            return None


@given(verb=st.sampled_from(sorted(VERBS)), words=st.lists(st.sampled_from(WORDS), max_size=6))
def test_what_is_read_is_what_argparse_reads(verb: str, words: list[str]) -> None:
    found = quick.parsed(VERBS[verb], words)
    assert found is None or vars(found) == by_argparse(VERBS[verb], words)


@pytest.mark.parametrize(
    ("verb", "words"),
    [
        ("topic echo", "odom --once --listen tcp/127.0.0.1:1 --connect tcp/127.0.0.1:1"),
        ("topic echo", "--json --timeout 2 odom nav_msgs/msg/Odometry"),
        ("topic pub", "cmd_vel {} --once"),
        ("topic pub", "--rate 10 cmd_vel geometry_msgs/msg/Twist {}"),
        ("topic list", ""),
        ("service call", "resume"),
        ("service call", "next_goal {} --wire msgpack --cfg a:1 --cfg b:2"),
        ("node info", "sim"),
        ("param get", "sim max_linear --timeout 1"),
        ("param set", "sim max_linear 0.5 max_turn 1"),
        ("param list", ""),
    ],
)
def test_what_people_write_is_read(verb: str, words: str) -> None:
    found = quick.parsed(VERBS[verb], words.split())
    assert found is not None
    assert vars(found) == by_argparse(VERBS[verb], words.split())


@pytest.mark.parametrize(
    "words", ["", "odom more again", "odom --no", "odom --timeout", "odom --timeout x", "--help", "odom -l 0"]
)
def test_what_is_wrong_is_left_to_argparse(words: str) -> None:
    assert quick.parsed(VERBS["topic echo"], words.split()) is None


@pytest.mark.parametrize(
    "options",
    [{"action": "count"}, {"required": True}, {"const": 1, "nargs": "?"}, {"default": "3", "type": int}],
)
def test_a_flag_of_another_kind_is_left_to_argparse(options: dict[str, Any]) -> None:
    assert quick.parsed(lambda parser: parser.add_argument("--flag", **options), []) is None


@given(st.lists(st.sampled_from(["a", "b", "-x", "--many", "--one", "1", "2"]), max_size=6), st.sampled_from("?*+"))
def test_words_find_their_places(words: list[str], nargs: str) -> None:
    def fill(parser: Any) -> None:
        parser.add_argument("first", type=key)
        parser.add_argument("rest", nargs=nargs)
        parser.add_argument("-x", action="store_true")
        group = parser.add_argument_group("more", "told")
        group.add_argument("--many", action="append", type=number(0, 5))
        group.add_argument("--one", choices=("a", "b"), default="b")

    found = quick.parsed(fill, words)
    assert found is None or vars(found) == by_argparse(fill, words)


def test_a_list_of_defaults_is_not_shared() -> None:
    def fill(parser: Any) -> None:
        parser.add_argument("--cfg", action="append", default=shared)

    shared: list[str] = []
    assert quick.parsed(fill, ["--cfg", "a"]).cfg == ["a"]
    assert quick.parsed(fill, []).cfg == shared == []
