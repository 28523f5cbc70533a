"""A bag may be cut off, damaged or hostile; what is in it is summed up."""

import io
import struct
import tracemalloc
import zlib
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st
from mcap.writer import MCAP0_MAGIC as MAGIC
from mcap.writer import CompressionType, Writer

from holozen.bags import BagError, Channel, Message
from holozen.bags.formats import format_of
from holozen.bags.mcap_file import LARGEST
from holozen.bags.reader import Bag, Stream, Summary, summarize
from holozen.bags.writer import BagWriter

from .bags import SECOND, START, a_bag, read


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return a_bag(tmp_path_factory.mktemp("good") / "a.mcap").read_bytes()


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("bad") / "a.mcap"


def record(kind: int, body: bytes) -> bytes:
    return struct.pack("<BQ", kind, len(body)) + body


def text(word: str) -> bytes:
    return struct.pack("<I", len(word)) + word.encode()


def chunk(
    data: bytes, compression: str, packed: bytes, size: int | None = None, checksum: int = 0
) -> bytes:
    head = struct.pack("<QQQI", 0, 0, len(data) if size is None else size, checksum)
    return record(0x06, head + text(compression) + struct.pack("<Q", len(packed)) + packed)


CHANNEL = record(0x04, struct.pack("<HH", 1, 0) + text("a") + text("json") + struct.pack("<I", 0))
MESSAGE = record(0x05, struct.pack("<HIQQ", 1, 0, 7, 7) + b"{}")


def error_of(file: Path, content: bytes) -> str:
    """The one line for a file with this content, which it may not read to its end."""
    file.write_bytes(content)
    with pytest.raises(BagError) as caught:
        read(file)
    (line,) = str(caught.value).splitlines()
    assert line.startswith(str(file))
    return line


def test_a_file_cut_off_anywhere_gives_all_that_was_whole(good: bytes, file: Path) -> None:
    file.write_bytes(good)
    whole = read(file)
    counts = set()
    for length in range(len(MAGIC), len(good), 7):
        file.write_bytes(good[:length])
        with Bag(file) as bag:
            found = list(bag.messages())
        assert found == whole[: len(found)]
        assert bag.cut_off or len(found) == len(whole)
        counts.add(len(found))
    assert counts == {0, len(whole)}


def test_a_whole_file_is_not_cut_off(good: bytes, file: Path) -> None:
    file.write_bytes(good)
    with Bag(file) as bag:
        assert len(list(bag.messages())) == 31
        assert not bag.cut_off


@given(st.data())
def test_a_file_with_a_wrong_byte_is_read_or_is_one_error_line(
    good: bytes, file: Path, data: st.DataObject
) -> None:
    broken = bytearray(good)
    for _ in range(data.draw(st.integers(1, 3))):
        broken[data.draw(st.integers(len(MAGIC), len(good) - 1))] = data.draw(st.integers(0, 255))
    file.write_bytes(broken)
    try:
        assert all(isinstance(message, Message) for message in read(file))
    except BagError as error:
        assert len(str(error).splitlines()) == 1


def test_every_compression_of_the_mcap_library_is_read(file: Path) -> None:
    for compression in list(CompressionType):
        stream = io.BytesIO()
        writer = Writer(stream, compression=compression)
        writer.start("ros2")
        channel = writer.register_channel(
            "/odom", "cdr", writer.register_schema("nav_msgs/msg/Odometry", "ros2msg", b"x")
        )
        for i in range(1000):
            writer.add_message(channel, log_time=i, data=b"%d" % i * 20, publish_time=i)
        writer.finish()  # type: ignore[no-untyped-call]
        file.write_bytes(stream.getvalue())
        found = read(file)
        assert [(m.at, m.payload) for m in found] == [(i, b"%d" % i * 20) for i in range(1000)]
        assert found[0].channel == (
            "odom",
            "application/cdr;nav_msgs/msg/Odometry",
            "cdr",
            "nav_msgs/msg/Odometry",
        )


def test_a_file_without_chunks_is_read(file: Path) -> None:
    file.write_bytes(
        MAGIC + CHANNEL + record(0x99, b"of a later version") + MESSAGE + record(0x0F, b"1234")
    )
    assert [(m.channel.key, m.at, m.payload) for m in read(file)] == [("a", 7, b"{}")]


def test_a_wrong_file_is_one_error_line(file: Path) -> None:
    for content, part in [
        (b"", "is not an MCAP file: it is empty"),
        (b"hello, I am a text", "is not an MCAP file"),
        (MAGIC + MESSAGE, "damaged before byte 41: a message without a channel"),
        (MAGIC + record(0x05, b"x") + MAGIC, "a record is longer than the file"),
        (
            MAGIC + record(0x04, b"\x01\x00\x00\x00\xff\xff\xff\xff") + MAGIC,
            "a record is longer than the file",
        ),
        (MAGIC + chunk(b"abc", "rot13", b"nop"), "unknown compression 'rot13'; known: zstd, lz4"),
        (MAGIC + chunk(CHANNEL, "", CHANNEL, checksum=1), "the checksum is wrong"),
        (MAGIC + chunk(b"", "zstd", b"no zstd at all", 10), "damaged"),
        (MAGIC + chunk(b"", "lz4", b"no lz4 at all", 10), "damaged"),
        (MAGIC + chunk(b"", "", b"", LARGEST + 1), f"at most {LARGEST} are read"),
        (
            MAGIC + chunk(b"", "", record(0x05, b"x" * 9)[:-1], 17),
            "a record is longer than its chunk",
        ),
    ]:
        assert part in error_of(file, content)


def test_a_few_bytes_do_not_become_all_of_memory(file: Path) -> None:
    """A chunk that unpacks to 64 MB and claims to have 100 bytes is not unpacked."""
    for compression in ["zstd", "lz4"]:
        pack = {"zstd": zstandard.compress, "lz4": lz4.frame.compress}[compression]
        bomb = pack(bytes(64 << 20))
        assert len(bomb) < 1 << 20
        tracemalloc.start()
        try:
            line = error_of(file, MAGIC + chunk(b"", compression, bomb, 100))
            assert tracemalloc.get_traced_memory()[1] < 16 << 20
        finally:
            tracemalloc.stop()
        assert "does not have the size it claims" in line


def test_a_record_that_claims_to_be_huge_is_not_read(file: Path) -> None:
    with file.open("wb") as stream:
        stream.write(MAGIC + struct.pack("<BQ", 0x06, LARGEST + 1))
        stream.truncate(LARGEST + 100)  # a hole: it takes no room on the disk
    with Bag(file) as bag, pytest.raises(BagError, match=f"exceeds limit {LARGEST}"):
        list(bag.messages())


def test_zeros_are_an_end_that_was_not_written(file: Path) -> None:
    with file.open("wb") as stream:
        stream.write(MAGIC + CHANNEL + MESSAGE)
        stream.truncate(5 << 30)  # a hole: it takes no room on the disk
    with Bag(file) as bag:
        assert [message.payload for message in bag.messages()] == [b"{}"]
        assert bag.cut_off


def test_a_checksum_that_is_right_is_no_trouble(file: Path) -> None:
    data = CHANNEL + MESSAGE
    file.write_bytes(
        MAGIC + chunk(data, "zstd", zstandard.compress(data), checksum=zlib.crc32(data))
    )
    assert [m.payload for m in read(file)] == [b"{}"]


def test_a_missing_file_or_a_folder_is_reported(tmp_path: Path) -> None:
    for path, why in (
        (tmp_path / "none.mcap", "No such file"),
        (tmp_path, "is a folder without .mcap or .db3 files"),
    ):
        with pytest.raises(BagError, match=why):
            Bag(path)


def stream(*rows: tuple[float, int]) -> Stream:
    """Messages at these seconds, with these numbers."""
    made = Stream(Channel("a", "", "", ""))
    for at, number in rows:
        made.see(Message(made.channel, START + round(at * SECOND), b"0123456789", number))
    return made


def test_a_bag_is_summed_up_by_channel(tmp_path: Path) -> None:
    with Bag(a_bag(tmp_path / "a.mcap")) as bag:
        figures = summarize(bag).figures()
    assert (figures["messages"], figures["duration"], figures["cut_off"]) == (31, 2.0, False)
    topics = {topic["key"]: topic for topic in figures["topics"]}  # type: ignore[attr-defined]
    assert list(topics) == ["cmd_vel", "note", "odom"]
    assert (topics["odom"]["messages"], topics["odom"]["rate"], topics["odom"]["missing"]) == (
        20,
        10.0,
        0,
    )
    assert (topics["cmd_vel"]["type"], topics["cmd_vel"]["rate"]) == (
        "geometry_msgs/msg/Twist",
        5.0,
    )
    assert (topics["note"]["type"], topics["note"]["rate"], topics["note"]["bytes"]) == ("", 0.0, 7)


def test_missing_messages_are_counted_by_their_numbers() -> None:
    found = stream((0, 0), (0.1, 1), (0.2, 4), (2.5, 5))
    assert (found.missing, found.figures()["longest_gap"]) == (2, 2.3)
    assert stream((0, 3), (1, 2), (2, 3)).missing == 3, "the first three never arrived"


def test_two_messages_at_one_time_or_one_back_in_time_have_no_rate() -> None:
    assert stream((1, 0)).rate == stream((1, 0), (1, 1)).rate == stream((2, 0), (1, 1)).rate == 0


def test_a_recording_counts_what_was_lost_before_a_message(tmp_path: Path) -> None:
    writer = BagWriter(str(tmp_path / "a"))
    for missed in (0, 0, 3, 0):
        writer.write("odom", format_of(b"{}", "", ())[0], b"{}", START, missed)
    writer.close()
    with Bag(tmp_path / "a.mcap") as bag:
        assert [stream.missing for stream in summarize(bag).streams.values()] == [3]


def test_the_lines_for_people_name_key_type_and_rate(tmp_path: Path) -> None:
    with Bag(a_bag(tmp_path / "a.mcap")) as bag:
        head, _, first, *_ = summarize(bag).lines()
    assert "31 messages in 2.00 s" in head
    assert first.split()[:5] == [
        "cmd_vel",
        "geometry_msgs/msg/Twist",
        "application/json",
        "10",
        "0",
    ]


def test_an_empty_bag_and_a_time_no_calendar_has_are_described_too() -> None:
    assert Summary("a", 10).lines() == ["a: 10 bytes, 0 messages in 0.00 s"]
    late = Stream(Channel("a", "", "", ""))
    late.see(Message(late.channel, 2**64 - 1, b"x"))
    assert len(Summary("a", 10, {late.channel: late}).lines()) == 3
