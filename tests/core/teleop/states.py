"""States to show: one in which everything is wrong, and arbitrary ones."""

from hypothesis import strategies as st
from msgspec.structs import replace

from services.teleop.view import Source, State
from tests.core.teleop.picture import scene

BROKEN = replace(
    scene(),
    stopped="topic@77aa00",
    listeners=[],
    odom_age=3.2,
    stale=True,
    deadman=True,
    obeyed="teleop@2b3c4d",
    warning="not handed over: teleop@2b3c4d drives",
)
"""Every alarm there is at once."""

_floats = st.floats() | st.floats(-3, 3)
_words = st.text(max_size=12) | st.sampled_from(
    ["teleop@1a2b3c", "日本", "\x1b[2J", "a\nb", "e\u0301", "x" * 300]
)
_planar = st.tuples(_floats, _floats, _floats)


def states() -> st.SearchStrategy[State]:
    """Any state, including those that should never occur."""
    sources = st.builds(Source, _words, _words, _floats, st.booleans(), st.booleans())
    return st.builds(
        State,
        robot=_words,
        others=st.lists(_words, max_size=3),
        mode=st.sampled_from(["hold", "latch"]),
        why=_words,
        deadman=st.booleans(),
        deadman_held=st.booleans(),
        speed=_floats,
        turn=_floats,
        speed_limit=_floats,
        turn_limit=_floats,
        command=st.none() | _planar,
        measured=_planar,
        odom_age=_floats,
        stale=st.booleans(),
        round_trip=st.none() | _floats,
        real_time_factor=st.none() | _floats,
        listeners=st.lists(_words, max_size=3),
        sources=st.lists(sources, max_size=5),
        obeyed=_words,
        held=st.booleans(),
        source=_words,
        stopped=_words,
        paused=st.booleans(),
        pose=st.none() | _planar,
        trail=st.lists(st.tuples(_floats, _floats), max_size=9),
        warning=_words,
        key=_words,
        keys=st.lists(_words, max_size=14),
        help=st.booleans(),
        ascii=st.booleans(),
    )
