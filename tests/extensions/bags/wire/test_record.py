"""`holozen record` and `holozen bag info`: all that came is in the file, whatever ends the
recorder.
"""

import json
import os
import random
import shlex
import signal
import subprocess
import sys
from collections import Counter
from functools import partial
from pathlib import Path
from typing import cast

import pytest
import zenoh

from holozen.bags.reader import Bag
from holozen.messages import Odometry, TFMessage, Twist, codec
from holozen.system import IS_LINUX
from holozen.testing import Process, Wire, wait_for
from holozen.testing.process import PATIENCE
from holozen.testing.wire import command
from tests.integration.conftest import Verb
from tests.integration.foreign_samples import PAYLOADS
from tests.integration.processes import assert_one_line, read
from tests.integration.robots import Robot

BLOCK = zenoh.CongestionControl.BLOCK  # by default a burst loses some, before anybody receives it


def info_of(call: Verb, path: Path, *flags: str) -> str:
    """What `holozen bag info` prints."""
    done = call("bag", "info", str(path), *flags)
    assert done.returncode == 0, done.stderr
    return done.stdout


def listening(wire: Wire, key: str) -> zenoh.Session:
    """A session on whose key a recorder listens."""
    bus = wire.bus("writer")
    publisher = bus.session.declare_publisher(key)
    wait_for(lambda: publisher.matching_status.matching, what="the recorder to listen")
    return cast(zenoh.Session, bus.session)


def test_foreign_payloads_are_recorded_byte_for_byte_with_their_encodings(
    wire: Wire, tmp_path: Path
) -> None:
    recorder = wire.start("record", "any/**", "-o", str(tmp_path / "a"))
    session = listening(wire, "any/thing")
    for i, (encoding, payload) in enumerate(PAYLOADS.items()):
        session.put(f"any/{i}", payload, encoding=encoding, congestion_control=BLOCK)
    session.put("other", b"not asked for")
    # it would be replayed as an empty message
    session.delete("any/0", congestion_control=BLOCK)
    session.put("any/last", b"", congestion_control=BLOCK)
    wait_for(
        lambda: len(read(tmp_path / "a.mcap")) == len(PAYLOADS) + 1,
        what="the messages to be flushed",
    )
    assert recorder.interrupt() == 0
    assert f"{tmp_path / 'a.mcap'}: " in recorder.out
    assert f"{len(PAYLOADS) + 1} messages" in recorder.out
    assert "none dropped, 1 deletions left out" in recorder.out
    found = {m.channel.key: (m.channel.encoding, m.payload) for m in read(tmp_path / "a.mcap")}
    assert list(found.values())[:-1] == list(PAYLOADS.items())


def test_a_live_robot_is_recorded_with_the_types_of_ros(
    call: Verb, town: Wire, robot: Robot, tmp_path: Path
) -> None:
    recorder = town.start("record", "-a", "-o", str(tmp_path / "a"), "--json")
    recorder.wait_for_line("recording ")

    def counts() -> Counter[str]:
        return Counter(message.channel.key for message in read(tmp_path / "a.mcap"))

    wait_for(lambda: min(counts()[key] for key in ("odom", "tf")) > 10, what="odom and tf")
    assert recorder.interrupt() == 0, recorder.err
    *_, last = map(json.loads, recorder.out.splitlines())
    assert last["files"] == [str(tmp_path / "a.mcap")]
    assert (last["dropped"], last["overran"], last["error"]) == (0, 0, "")
    info = json.loads(info_of(call, tmp_path / "a.mcap", "--json"))
    types = {topic["key"]: topic["type"] for topic in info["topics"]}
    assert types["odom"] == "nav_msgs/msg/Odometry"
    assert types["tf"] == "tf2_msgs/msg/TFMessage"
    assert info["messages"] == last["messages"]
    # what Zenoh dropped on its way here, on a busy machine
    assert sum(topic["missing"] for topic in info["topics"]) == last["lost"]


def test_a_killed_recorder_leaves_a_file_that_can_be_read(
    call: Verb, wire: Wire, tmp_path: Path
) -> None:
    recorder = wire.start("record", "a", "-o", str(tmp_path / "a"))
    session = listening(wire, "a")
    for i in range(500):
        session.put("a", b"%d" % i, congestion_control=BLOCK)
    path = tmp_path / "a.mcap"
    wait_for(lambda: len(read(path)) == 500, what="the messages to be flushed")
    for i in range(500, 600):
        session.put("a", b"%d" % i, congestion_control=BLOCK)
    assert recorder.kill() == -signal.SIGKILL
    found = read(path)
    assert [m.payload for m in found] == [b"%d" % i for i in range(len(found))]
    assert len(found) >= 500
    assert "the recording was cut off" in info_of(call, path)


def holds(path: Path, count: int) -> bool:
    """Whether a file has so many messages."""
    return len(read(path)) == count


def test_what_came_before_ctrl_c_is_recorded_by_a_recorder_that_was_held_up(
    wire: Wire, tmp_path: Path
) -> None:
    recorder = wire.start("record", "a", "-o", str(tmp_path / "a"))
    session = listening(wire, "a")
    sent = [b"%d" % i for i in range(500)]
    session.put("a", sent[0], congestion_control=BLOCK)
    wait_for(partial(holds, tmp_path / "a.mcap", 1), what="the first to be flushed")
    recorder.signal(signal.SIGSTOP)
    if IS_LINUX:  # on one core its main thread often runs before Zenoh's
        core = {min(os.sched_getaffinity(0))}
        for thread in os.listdir(f"/proc/{recorder.pid}/task"):
            os.sched_setaffinity(int(thread), core)
    for payload in sent[1:]:
        session.put("a", payload, congestion_control=BLOCK)
    session.close()  # type: ignore[no-untyped-call]  # it sends what is left
    recorder.signal(signal.SIGINT)
    recorder.signal(signal.SIGCONT)
    assert recorder.wait() == 0, recorder.err
    assert [message.payload for message in read(tmp_path / "a.mcap")] == sent


def test_it_begins_with_what_latched_keys_hold(wire: Wire, tmp_path: Path) -> None:
    """And takes what they hold that appear later, once each."""
    bus = wire.bus("writer")
    grid = bus.publisher_raw("map", "nav_msgs/msg/OccupancyGrid", "application/json")
    grid.put_bytes(b'{"info": {"width": 3}}')
    bus.publisher("odom", Odometry).put(Odometry())
    recorders = {
        tmp_path / f"{name}.mcap": wire.start("record", *keys, "-o", str(tmp_path / name))
        for name, keys in (("all", ("-a",)), ("named", ("map", "tf_static", "odom")))
    }
    for path, recorder in recorders.items():
        recorder.wait_for_line("recording ")
        wait_for(partial(holds, path, 1), what="the map")
    wire.bus("later").publisher("tf_static", TFMessage).put(TFMessage([]))
    for path, recorder in recorders.items():
        wait_for(partial(holds, path, 2), what="the transforms")
        assert recorder.interrupt() == 0
        found = [(m.channel.key, m.payload) for m in read(path)]
        assert found == [
            ("map", b'{"info": {"width": 3}}'),
            ("tf_static", codec.encode(TFMessage([]))),
        ]


def test_a_file_that_is_deleted_ends_the_recording_with_an_error(
    wire: Wire, tmp_path: Path
) -> None:
    recorders = {
        tmp_path / "a.mcap": wire.start("record", "odom", "-o", str(tmp_path / "a")),
        tmp_path / "b" / "b_0.mcap": wire.start(
            "record", "odom", "-o", str(tmp_path / "b"), "--ros2"
        ),
    }
    for recorder in recorders.values():
        recorder.wait_for_line("recording ")
    session = listening(wire, "odom")

    def all_record() -> bool:
        session.put("odom", codec.encode(Odometry()))
        return all(map(read, recorders))

    wait_for(all_record, what="a message to be flushed")
    for path in recorders:
        path.unlink()
    for path, recorder in recorders.items():
        assert recorder.wait() == 1
        assert (
            recorder.err.splitlines()[-1]
            == f"holozen record: stopped: {path} was deleted during the recording"
        )
        assert recorder.out == ""
    assert list((tmp_path / "b").iterdir()) == [], "metadata about a file that is not there"


def test_keys_on_which_nothing_arrived_are_named(wire: Wire, tmp_path: Path) -> None:
    """After some time, and at the end, with the key that may be meant."""
    _robot = wire.bus("sim").subscribe("cmd_vel", Twist)
    writer = wire.start("topic", "pub", "a/b", "std_msgs/msg/String", "{}", "-r", "50")
    writer.wait_for_line("no subscribers")
    recorder = wire.start("record", "a/*", "b/*", "cmdvel", "-o", str(tmp_path / "a"))
    recorder.wait_for_line("nothing has arrived on b/*, cmdvel (did you mean 'cmd_vel'?)")
    assert recorder.interrupt() == 0
    expected = "holozen record: nothing arrived on b/*, cmdvel (did you mean 'cmd_vel'?)"
    assert recorder.err.splitlines()[-1] == expected


FULL = """
set -e
mount -t tmpfs -o size=12M tmpfs "$1"
ip link set lo up
shift
exec "$@"
"""


@pytest.mark.needs("unshare", "ip")
def test_on_a_full_disk_it_ends_with_a_file_that_is_whole(tmp_path: Path) -> None:
    """The recorder's disk has 12 MB, of which it keeps 8 aside; it gets 20."""
    disk = tmp_path / "disk"
    disk.mkdir()
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    words = [
        "unshare",
        "-rmn",
        "bash",
        "-c",
        FULL,
        "-",
        str(disk),
        sys.executable,
        str(script),
        str(disk),
    ]
    with Process(words) as process:
        assert process.wait(60) == 0, process.err
    output = json.loads(process.out.splitlines()[-1])
    assert output["code"] == 1
    assert output["stderr"].count("holozen record: stopped: No space left on device") == 1
    assert 100 < output["readable"] == output["messages"]
    assert output["mcap"] == output["messages"], "the mcap library wants an end"


SCRIPT = """
import json, os, sys
from pathlib import Path
from typing import cast
from holozen.testing import Wire, wait_for
from holozen.bags.reader import Bag
from mcap.reader import make_reader

path = Path(sys.argv[1]) / "a.mcap"
with Wire() as wire:
    recorder = wire.start("record", "a", "-o", str(path), "--json")
    session = wire.bus("writer").session
    publisher = session.declare_publisher("a")
    wait_for(lambda: publisher.matching_status.matching)
    while recorder.returncode is None:
        publisher.put(os.urandom(10_000))
    code = recorder.wait(30)
    out, err = recorder.out, recorder.err
with Bag(path) as bag:
    readable = len(list(bag.messages()))
with path.open("rb") as stream:
    summary = make_reader(stream).get_summary()
last = json.loads(out.splitlines()[-1])
result = {"code": code, "stderr": err, "readable": readable, "messages": last["messages"]}
print(json.dumps(result | {"mcap": summary.statistics.message_count}))
"""


def test_an_error_is_reported_in_one_line(
    verb: Verb, wire: Wire, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for words, code, part in [
        (
            ("odom", "-o", "/nowhere/a"),
            1,
            "cannot write /nowhere/a.mcap: No such file or directory",
        ),
        (("odom", "--max-size", "0"), 2, "use a number from 0.1"),
        (("a//b", "-o", "a"), 1, "key 'a//b'"),
    ]:
        monkeypatch.chdir(tmp_path)
        assert_one_line(verb(wire, "record", *words), code, part)
        assert list(tmp_path.iterdir()) == []


def test_a_file_that_exists_is_not_written_over(verb: Verb, wire: Wire, tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_text("precious")
    done = verb(wire, "record", "a", "-o", str(tmp_path / "a"))
    assert done.returncode == 1
    assert done.stderr.endswith("a.mcap: File exists; choose another name with -o\n")
    assert (tmp_path / "a.mcap").read_text() == "precious"


def test_keys_that_include_each_other_are_recorded_once(wire: Wire, tmp_path: Path) -> None:
    recorder = wire.start("record", "a/b", "--topics", "a/*", "a/b", "-o", str(tmp_path / "a"))
    listening(wire, "a/b").put("a/b", b"once")
    wait_for(lambda: read(tmp_path / "a.mcap"))
    assert recorder.terminate() == 0
    assert [m.payload for m in read(tmp_path / "a.mcap")] == [b"once"]


def test_regular_expressions_choose_keys_and_leave_some_out(wire: Wire, tmp_path: Path) -> None:
    recorders = {
        tmp_path / f"{name}.mcap": wire.start("record", *flags, "-o", str(tmp_path / name))
        for name, flags in (
            ("a", ["-a", "-x", "^/a/|^c$", "-s", "mcap"]),
            ("e", ["-e", "a/.|/b/|^end$", "--exclude-topics", "*/b"]),
        )
    }
    for recorder in recorders.values():
        recorder.wait_for_line("recording ")
    session = listening(wire, "end")

    def have(path: Path, key: str) -> bool:
        return key in {m.channel.key for m in read(path)}

    def all_record() -> bool:
        session.put("end", b"1")
        return all(have(path, "end") for path in recorders)

    wait_for(all_record)
    for key in ("a/b", "b/c", "c", "b/d"):
        session.put(key, b"1")
    session.delete("a/b")
    for path, recorder in recorders.items():
        wait_for(partial(have, path, "b/d"))
        assert recorder.terminate() == 0
        assert {m.channel.key for m in read(path)} == {"b/c", "b/d", "end"}
        assert "deletions" not in recorder.out


def test_for_ros_the_robot_is_recorded_in_cdr_by_the_sims_own_clock(
    town: Wire, robot: Robot, tmp_path: Path
) -> None:
    path = tmp_path / "a.mcap"
    words = ("odom", "tf", "-o", str(path), "--wire", "cdr", "--use-sim-time")
    recorder = town.start("record", *words)
    recorder.wait_for_line("recording ")
    wait_for(lambda: len(read(path)) > 50, what="messages")
    assert recorder.interrupt() == 0, recorder.err
    stamps = []
    for message in read(path):
        assert message.channel.encoding == f"application/cdr;{message.channel.type}"
        if message.channel.key == "odom":
            odom = codec.decode(message.payload, message.channel.encoding, (Odometry,))
            stamps.append((odom.header.stamp.seconds(), message.at / 1e9))
    assert len(stamps) > 10
    # s; what waits in a held-up recorder is written late
    assert all(stamp == pytest.approx(at, abs=PATIENCE) for stamp, at in stamps)


def test_without_a_clock_there_is_no_time_of_the_sim(wire: Wire, tmp_path: Path) -> None:
    recorder = wire.start(
        "record", "a", "-o", str(tmp_path / "a"), "--use-sim-time", "--max-duration", "0.5"
    )
    session = wire.bus("writer").session
    wait_for(lambda: session.put("a", b"x") or recorder.returncode is not None)
    assert recorder.wait() == 1
    assert recorder.err.splitlines()[-1].endswith(
        "nothing arrived on clock, so the sim's time is unknown"
    )
    assert list(tmp_path.iterdir()) == []


def test_a_reader_that_has_seen_enough_ends_it_quietly(
    wire: Wire, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    wire.start("topic", "pub", "tf", "{}", "-r", "100").wait_for_line("no subscribers")
    for words in (
        ["record", "-a", "--json", "-o", "a", *wire.flags],
        ["bag", "info", "a.mcap"],
    ):
        piped = f"{shlex.join(command(*words))} | head -1; exit ${{PIPESTATUS[0]}}"
        done = subprocess.run(["bash", "-c", piped], capture_output=True, text=True)
        assert (done.returncode, len(done.stdout.splitlines())) == (0, 1), words
        assert [
            line for line in done.stderr.splitlines() if not line.startswith("recording ")
        ] == [], words
    with Bag(tmp_path / "a.mcap") as bag:
        assert list(bag.messages())
        assert not bag.cut_off


def test_a_long_recording_is_split(wire: Wire, tmp_path: Path) -> None:
    words = ("record", "a", "-o", str(tmp_path / "a"), "--max-size", "0.1", "--max-duration", "60")
    recorder = wire.terminal(*words)
    session = listening(wire, "a")
    for _ in range(200):
        session.put("a", random.randbytes(20_000), congestion_control=BLOCK)
    recorder.wait_for_text("200 messages")
    recorder.type("\x03")
    assert recorder.process.wait() == 0
    files = sorted(tmp_path.iterdir())
    assert [path.name for path in files] == [f"a_{i}.mcap" for i in range(len(files))]
    assert sum(len(read(path)) for path in files) == 200
    assert len(files) > 1
    assert all(str(path) in recorder.raw.replace("\r\n", "") for path in files)


def test_in_a_terminal_a_line_shows_the_progress(wire: Wire, tmp_path: Path) -> None:
    terminal = wire.terminal("record", "a", "-o", str(tmp_path / "a"))
    listening(wire, "a").put("a", b"x")
    terminal.wait_for_text("1 messages")
    terminal.type("\x03")
    assert terminal.process.wait() == 0
    assert "1 messages" in terminal.screen()
