"""Counts, rates and gaps."""

from pathlib import Path

from holozen.bag.reader import Bag, Channel
from holozen.bag.summary import Stream, Summary, summarize

from .bags import SECOND, START, a_bag


def stream(*times: float) -> Stream:
    """Messages at these seconds."""
    made = Stream(Channel("a", "", "", ""))
    for at in times:
        made.see(START + round(at * SECOND), 10)
    return made


def test_a_bag_is_summed_up_by_channel(tmp_path: Path) -> None:
    with Bag(a_bag(tmp_path / "a.mcap")) as bag:
        figures = summarize(bag).figures()
    assert (figures["messages"], figures["duration"], figures["cut_off"]) == (31, 2.0, False)
    topics = {topic["key"]: topic for topic in figures["topics"]}  # type: ignore[attr-defined]
    assert list(topics) == ["cmd_vel", "note", "odom"]
    assert (topics["odom"]["messages"], topics["odom"]["rate"], topics["odom"]["gaps"]) == (20, 10.0, 0)
    assert (topics["cmd_vel"]["type"], topics["cmd_vel"]["rate"]) == ("geometry_msgs/msg/Twist", 5.0)
    assert (topics["note"]["type"], topics["note"]["rate"], topics["note"]["bytes"]) == ("", 0.0, 7)


def test_a_gap_is_three_usual_intervals_without_a_message() -> None:
    steady = [i * 0.1 for i in range(20)]
    assert stream(*steady).gaps == 0
    assert stream(*steady, 2.15).gaps == 0
    broken = stream(*steady, 2.5, 2.6, 2.7, 5.0)
    assert broken.gaps == 2
    assert broken.figures()["longest_gap"] == 2.3
    assert stream(0, 1, 2, 20).gaps == 0, "nobody knows what is usual yet"


def test_two_messages_at_one_time_or_one_back_in_time_have_no_rate() -> None:
    assert stream(1).rate == stream(1, 1).rate == stream(2, 1).rate == 0


def test_the_lines_for_people_name_key_type_and_rate(tmp_path: Path) -> None:
    with Bag(a_bag(tmp_path / "a.mcap")) as bag:
        head, _, first, *_ = summarize(bag).lines()
    assert "31 messages in 2.00 s" in head
    assert first.split()[:5] == ["cmd_vel", "geometry_msgs/msg/Twist", "application/json", "10", "5.00"]


def test_an_empty_bag_and_a_time_no_calendar_has_are_told_too() -> None:
    assert Summary("a", 10).lines() == ["a: 10 bytes, 0 messages in 0.00 s"]
    late = Stream(Channel("a", "", "", ""))
    late.see(2**64 - 1, 1)
    assert len(Summary("a", 10, {late.channel: late}).lines()) == 3
