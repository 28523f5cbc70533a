"""Bags as the mcap library reads them, in files of a limited size, and on a disk that is full."""

import errno
import json
import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest
from mcap.reader import make_reader

from holozen import cli
from holozen.bags import BagError
from holozen.bags.writer import BagWriter

from .bags import START, a_bag, put, read


def test_the_mcap_library_finds_schemas_times_and_the_very_bytes(tmp_path: Path) -> None:
    path = a_bag(tmp_path / "a.mcap")
    with path.open("rb") as stream:
        found = list(make_reader(stream, validate_crcs=True).iter_messages())
    assert len(found) == 20 + 10 + 1
    schema, channel, message = found[0]
    assert schema is not None
    assert (schema.name, schema.encoding, channel.topic) == (
        "nav_msgs/msg/Odometry",
        "jsonschema",
        "odom",
    )
    assert (channel.message_encoding, channel.metadata["zenoh_encoding"]) == (
        "json",
        "application/json",
    )
    assert message.log_time == START
    assert json.loads(message.data)["pose"]["pose"]["position"] == {"x": 0.0, "y": 0.0, "z": 0.0}
    schema, channel, message = found[-1]
    assert schema is None
    assert (channel.topic, channel.message_encoding, message.data) == (
        "note",
        "text/plain",
        "grüße".encode(),
    )


def test_our_reader_finds_the_same(tmp_path: Path) -> None:
    path = a_bag(tmp_path / "a.mcap")
    with path.open("rb") as stream:
        theirs = [
            (c.topic, m.log_time, m.data)
            for _, c, m in make_reader(stream).iter_messages(log_time_order=False)
        ]
    assert [(m.channel.key, m.at, m.payload) for m in read(path)] == theirs


def test_what_was_flushed_is_there_while_it_still_writes(tmp_path: Path) -> None:
    writer = BagWriter(str(tmp_path / "a"))
    put(writer, "a", b"{}", 1.0)
    assert read(tmp_path / "a.mcap") == []
    writer.flush()
    assert [m.payload for m in read(tmp_path / "a.mcap")] == [b"{}"]
    writer.abandon()


def test_a_new_file_begins_when_one_is_large_enough(tmp_path: Path) -> None:
    writer = BagWriter(str(tmp_path / "a"), limit=3000)
    payloads = [b"%d" % i * 50 for i in range(1000, 1100)]
    for i, payload in enumerate(payloads):
        put(writer, "a", payload, i, "text/plain")
        writer.flush()
    writer.close()
    assert [path.name for path in writer.files] == [f"a_{i}.mcap" for i in range(len(writer.files))]
    assert len(writer.files) > 3
    assert all(path.stat().st_size < 8000 for path in writer.files)
    assert sum(path.stat().st_size for path in writer.files) == writer.size
    assert [m.payload for path in writer.files for m in read(path)] == payloads


def test_a_file_that_exists_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_text("precious")
    with pytest.raises(FileExistsError):
        BagWriter(str(tmp_path / "a"))
    assert (tmp_path / "a.mcap").read_text() == "precious"


def test_a_recording_of_nothing_leaves_no_file(tmp_path: Path) -> None:
    writer = BagWriter(str(tmp_path / "a"))
    writer.close()
    assert list(tmp_path.iterdir()) == []


LIMITED = """
import os, sys
from tests.extensions.bags.bags import put
from holozen import cli
from holozen.bags import BagError
from holozen.bags.writer import BagWriter
writer = BagWriter(sys.argv[1])
try:
    for i in range(100):
        put(writer, "a", os.urandom(10_000), i, "zenoh/bytes")
        writer.flush()
        print(i + 1, flush=True)
except BagError as error:
    writer.abandon()
    print(writer.size)
    print(writer.full)
"""


def test_at_a_limit_of_file_size_all_that_was_written_before_can_be_read(tmp_path: Path) -> None:
    limit = 200_000
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, str(tmp_path / "a")],
        cwd=Path(__file__).parents[3],
        capture_output=True,
        text=True,
        timeout=60,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
    )
    *counts, size, full = done.stdout.split("\n")[:-1]
    assert full == "File too large", done.stderr
    assert len(read(tmp_path / "a.mcap")) == int(counts[-1]) > 10
    assert (tmp_path / "a.mcap").stat().st_size == int(size), "a record that is in it in part"


def test_where_the_next_file_cannot_be_made_the_last_one_is_whole(tmp_path: Path) -> None:
    writer = BagWriter(str(tmp_path / "a"), limit=3000)
    (tmp_path / "a_1.mcap").write_text("precious")
    with pytest.raises(BagError, match="File exists"):
        for i in range(1000):
            put(writer, "a", b"%d" % i * 50, i, "text/plain")
            writer.flush()
    writer.abandon()
    assert (tmp_path / "a_1.mcap").read_text() == "precious"
    assert len(read(tmp_path / "a_0.mcap")) == writer.messages
    with (tmp_path / "a_0.mcap").open("rb") as stream:
        assert make_reader(stream).get_summary() is not None


def test_without_space_for_the_end_of_a_file_the_space_that_is_needed_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*_arguments: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "posix_fallocate", full)
    assert cli.main(["record", "odom", "-o", str(tmp_path / "a")]) == 1
    fix = "free some space, or choose a folder on another disk with -o"
    assert capsys.readouterr().err == (
        f"holozen record: cannot write {tmp_path}/a.mcap: fewer than 8 MB of the disk are free; "
        f"{fix}\n"
    )
    assert list(tmp_path.iterdir()) == []
