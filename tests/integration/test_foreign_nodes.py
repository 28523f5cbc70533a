"""The verbs that look, on foreign keys: plain zenoh that publishes JSON, text, any bytes, and CDR
by rosbags.
"""

import json
import os
import re
import subprocess
import threading
from collections.abc import Iterator

import pytest
import zenoh

from holozen.messages import TriggerReply, TriggerRequest
from holozen.testing import Wire, wait_for
from holozen.testing.wire import command

from .conftest import Verb, comes_to, foreign_config
from .foreign_samples import CDR, PUTS
from .processes import assert_one_line

WAITS = re.compile(r"waiting for .* no messages yet")
SHOWN = "linear:\n  x: 1.5\n  y: 0.0\n  z: -2.0\nangular:\n  x: 0.0\n  y: 0.0\n  z: 0.25\n---\n"


@pytest.fixture(scope="module")
def town() -> Iterator[Wire]:
    """A place where a foreign node puts all of PUTS at 25 Hz; of ours only one that holds a
    meeting point.
    """
    with Wire() as wire:
        wire.bus("door")
        done = threading.Event()
        with zenoh.open(foreign_config(wire)) as session:
            talker = threading.Thread(target=_talk, args=(session, done))
            talker.start()
            yield wire
            done.set()
            talker.join()


def _talk(session: zenoh.Session, done: threading.Event) -> None:
    while not done.wait(0.04):
        for key, (payload, encoding) in PUTS.items():
            session.put(key, payload, encoding=encoding)


def test_what_a_foreign_node_puts_is_shown(verb: Verb, town: Wire) -> None:
    for words, shown in [
        ("a/json", "speed: 1.5\nname: x\n---\n"),
        ("a/json --json", '{"speed": 1.5, "name": "x"}\n'),
        ("a/json --csv", "1.5,x\n"),
        ("a/json --field speed", "1.5\n---\n"),
        ("a/text", '"red \\u001b[31malert\\u0007"\n---\n'),
        ("a/schema", SHOWN),
        ("a/cdr --type geometry_msgs/msg/Twist", SHOWN),
        ("a/schema --filter m.linear.x==1.5 --field angular.z --csv", "0.25\n"),
        ("a/json --json --field speed", '{"value": 1.5}\n'),
        ("a/js$* --json", '{"key": "a/json", "value": {"speed": 1.5, "name": "x"}}\n'),
    ]:
        done = verb(town, "topic", "echo", *words.split(), "--once")
        assert (done.returncode, done.stdout) == (0, shown)
        assert without_waiting(done.stderr) == ""


NEITHER = "neither text, JSON nor CDR"
NO_TYPE = "for CDR give the type: --type T"
ODOMETRY = "not a nav_msgs/msg/Odometry: cut off after 52 bytes; --type is wrong, or the bytes are"


UNDECODED = [
    ("a/bytes", "56 bytes of zenoh/bytes: c8 c9 ca ", NEITHER),
    ("a/cdr", f"{len(CDR)} bytes of application/cdr: 00 01 00 00 ", NO_TYPE),
    ("a/plain", f"{len(CDR)} bytes of zenoh/bytes: 00 01 00 00 ", NO_TYPE),
    (
        "a/cut",
        "20 bytes of application/cdr;geometry_msgs/msg/Twist: 00 01 ",
        "not a geometry_msgs/msg/Twist: cut off after 20 bytes",
    ),
    ("a/cdr nav_msgs/msg/Odometry", f"{len(CDR)} bytes of application/cdr: ", ODOMETRY),
    (
        "a/schema --type nav_msgs/msg/Odometry",
        f"{len(CDR)} bytes of application/cdr;geometry_msgs/msg/Twist: ",
        f"{ODOMETRY}, its encoding is geometry_msgs/msg/Twist",
    ),
    ("a/bytes --json", '{"hex": "c8c9ca', NEITHER),
]


def test_what_cannot_be_decoded_is_a_hex_dump_and_counted(verb: Verb, town: Wire) -> None:
    for words, start, why in UNDECODED:
        done = verb(town, "topic", "echo", *words.split(), "--once")
        assert done.returncode == 0
        assert done.stdout.startswith(start)
        expected = f"holozen topic echo: 1 of 1 samples could not be decoded; {why}\n"
        assert without_waiting(done.stderr) == expected


def without_waiting(errors: str) -> str:
    """What a verb reports, without that a busy machine let it wait for a second."""
    return "".join(line for line in errors.splitlines(True) if not WAITS.match(line))


def test_raw_gives_the_bytes_as_they_came(town: Wire) -> None:
    words = command("topic", "echo", "a/bytes", "--raw", "--once", *town.flags)
    assert subprocess.run(words, capture_output=True, timeout=30).stdout == PUTS["a/bytes"][0]


def test_foreign_control_characters_never_reach_a_terminal(town: Wire) -> None:
    for words in ("a/text --raw --once", "** --filter m=='x' --timeout 2"):
        with town.terminal("topic", "echo", *words.split()) as terminal:
            terminal.process.wait()
            assert "\x1b[31m" not in terminal.raw
            assert "\x07" not in terminal.raw


def test_every_key_of_an_expression_is_shown_with_its_name(town: Wire) -> None:
    echo = town.start("topic", "echo", "**", "--json")
    wait_for(lambda: {json.loads(line)["key"] for line in echo.out.splitlines()[:-1]} == set(PUTS))
    assert echo.interrupt() == 130
    assert "samples could not be decoded" in echo.err


def test_a_type_is_known_from_the_publishers_token(verb: Verb, town: Wire) -> None:
    """A publisher of ours declares its type; the bytes alone do not show it."""
    bus = town.bus("ours", wire="cdr")
    token = bus.announce("pub", "geometry_msgs/msg/Twist", "a/cdr")
    comes_to(SHOWN, lambda: verb(town, "topic", "echo", "a/cdr", "--once").stdout)
    token.undeclare()


def test_a_filter_that_nothing_passes_ends_with_the_timeout(verb: Verb, town: Wire) -> None:
    done = verb(town, "topic", "echo", "a/json", "--filter", "speed > 2", "--timeout", "1")
    assert_one_line(done, 1, "no message that passes the filter on a/json within 1 s")


def test_an_expression_shows_the_field_of_those_that_have_it(verb: Verb, town: Wire) -> None:
    done = verb(town, "topic", "echo", "**", "--field", "speed", "--json", "--once")
    assert json.loads(done.stdout) == {"key": "a/json", "value": 1.5}


def test_an_unknown_field_of_a_key_is_an_error_with_the_closest(verb: Verb, town: Wire) -> None:
    expected = (
        "holozen topic echo: a/json: no field 'sped' (did you mean 'speed'?); there are speed, name"
    )
    assert_one_line(verb(town, "topic", "echo", "a/json", "--field", "sped"), 1, expected)


def test_rates_and_sizes_of_foreign_samples_are_reported_without_losses(
    verb: Verb, town: Wire
) -> None:
    done = verb(town, "topic", "hz", "a/json", "--once")
    assert done.returncode == 0, done.stderr
    assert "lost" not in done.stdout
    for measure in ("hz", "bw"):
        output = json.loads(verb(town, "topic", measure, "a/js$*", "--once", "--json").stdout)
        assert (output["key"], output["lost"]) == ("a/json", None)
        assert {"p50", "p95", "p99", "jitter", "window"} <= set(output)


def test_delay_reports_that_there_is_no_stamp(verb: Verb, town: Wire) -> None:
    done = verb(town, "topic", "delay", "a/json", "--once")
    assert_one_line(
        done, 1, "holozen topic delay: ", " messages have no header.stamp, and so no age"
    )
    delay = town.start("topic", "delay", "a/json")
    delay.wait_for_line("messages have no header.stamp, and so no age")
    assert "no new messages" not in delay.err


def test_delay_reports_that_there_is_no_clock(verb: Verb, town: Wire) -> None:
    done = verb(town, "topic", "delay", "a/stamped", "--timeout", "1")
    assert_one_line(
        done,
        1,
        " messages have stamps by another clock than this machine's, and nothing comes on clock",
    )


def test_list_sees_foreign_nodes_if_it_listens(verb: Verb, town: Wire) -> None:
    assert verb(town, "topic", "list").stdout == ""
    wait_for(lambda: verb(town, "topic", "list", "--heard", "0.3").stdout.split() == sorted(PUTS))


def test_info_shows_what_a_foreign_node_sends(verb: Verb, town: Wire) -> None:
    assert verb(town, "topic", "info", "a/json", "-v").stdout.splitlines()[1:] == [
        "Publisher count: 1",
        "  anonymous  DATA  application/json  DROP when full",
        "Subscription count: 0",
    ]
    assert verb(town, "topic", "info", "a/schema").stdout.startswith(
        "Type: geometry_msgs/msg/Twist\nPublisher count: 1\n"
    )
    assert_one_line(
        verb(town, "topic", "info", "a/nothing"), 1, "unknown key 'a/nothing': no nodes found at "
    )


def test_type_shows_what_a_foreign_node_sends(verb: Verb, town: Wire) -> None:
    assert verb(town, "topic", "type", "a/schema").stdout == "geometry_msgs/msg/Twist\n"
    expected = "holozen topic type: 'a/json' has no known type; its samples are application/json"
    assert_one_line(verb(town, "topic", "type", "a/json"), 1, expected)


def test_a_foreign_node_that_only_answers_is_reported_too(verb: Verb, town: Wire) -> None:
    with zenoh.open(foreign_config(town)) as session:
        queryable = session.declare_queryable(
            "b/asked", lambda query: query.reply("b/asked", b"{}", encoding="application/json")
        )
        expected = "'b/asked' has no known type; its samples are application/json"
        assert_one_line(verb(town, "topic", "type", "b/asked"), 1, expected)
        lines = verb(town, "topic", "info", "b/asked").stdout.splitlines()
        assert lines[:2] == ["Type: unknown", "Publisher count: 1"]
        assert lines[2].startswith("  anonymous, which answers queries  DATA  application/json  ")
        del queryable


def test_a_search_for_a_foreign_node_calls_no_service(verb: Verb, town: Wire) -> None:
    asked: list[TriggerRequest] = []

    def answer(request: TriggerRequest) -> TriggerReply:
        asked.append(request)
        return TriggerReply(True, "")

    town.bus("sim").serve("stop", TriggerRequest, TriggerReply, answer).start()
    assert_one_line(verb(town, "topic", "info", "stop"), 1, "unknown key 'stop'")
    assert asked == []


def test_a_reader_that_is_gone_ends_it_quietly(town: Wire) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    with open(writing, "wb") as gone:
        for words in ("echo ** --csv", "echo a/bytes --raw", "list --heard 1"):
            done = town.start("topic", *words.split(), stdout=gone)
            assert done.wait() == 0, words
            assert all(
                "could not be decoded" in line for line in without_waiting(done.err).splitlines()
            ), done.err
