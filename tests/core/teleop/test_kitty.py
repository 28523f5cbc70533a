"""Bytes of real terminals become keys; bytes that are no key move nothing."""

from hypothesis import given
from hypothesis import strategies as st

from services.teleop.input.kitty import (
    ESCAPE_WAIT,
    LATE,
    LONG_PASTE,
    MAX_SEQUENCE,
    Answer,
    Event,
    Focus,
    Key,
    Keyboard,
    Unknown,
)

PASTED = b"\x1b[200~i J\n\x1b[A\x1b[201~"


def read(*parts: bytes, releases: bool = False) -> list[Event]:
    """The events of bytes that arrive all at once, or in pieces."""
    keyboard = Keyboard()
    keyboard.releases = releases
    return [event for part in parts for event in keyboard.feed(part, 0.0)]


def names(*parts: bytes) -> list[str]:
    return [event.name if isinstance(event, Key) else repr(event) for event in read(*parts)]


def test_what_terminals_send_is_named() -> None:
    rows = [
        (b"i", "i"),
        (b"I", "I"),
        (b"<", "<"),
        (b" ", "space"),
        (b"\t", "tab"),
        (b"\r", "enter"),
        (b"\n", "enter"),
        (b"\x7f", "backspace"),
        (b"\x08", "backspace"),
        (b"\x03", "ctrl+c"),
        (b"\x1a", "ctrl+z"),
        (b"\x1c", "ctrl+\\"),
        (b"\x00", "ctrl+space"),
        ("é".encode(), "é"),
        ("ш".encode(), "ш"),
        ("\U0001f916".encode(), "\U0001f916"),
        (b"\x1b[A", "up"),
        (b"\x1b[B", "down"),
        (b"\x1b[C", "right"),
        (b"\x1b[D", "left"),
        (b"\x1bOA", "up"),
        (b"\x1b[1;2D", "shift+left"),
        (b"\x1b[1;2C", "shift+right"),
        (b"\x1b[Z", "shift+tab"),
        (b"\x1b[d", "shift+left"),
        (b"\x1b[1;5A", "ctrl+up"),
        (b"\x1b[1;3A", "alt+up"),
        (b"\x1bOP", "f1"),
        (b"\x1b[[A", "f1"),
        (b"\x1b[15~", "f5"),
        (b"\x1b[3~", "delete"),
        (b"\x1b[5;5~", "ctrl+pageup"),
        (b"\x1bi", "alt+i"),
        (b"\x1b\x03", "alt+ctrl+c"),
    ]
    for sent, name in rows:
        (event,) = read(sent)
        assert isinstance(event, Key)
        assert (event.name, event.kind) == (name, "typed")


def test_the_kitty_protocol_reports_presses_and_releases() -> None:
    rows = [
        ("105u", Key("i", "i", "press", "105")),
        ("105;1:3u", Key("i", "i", "release", "105")),
        ("105;1:2u", Key("i", "i", "repeat", "105")),
        ("106:74;2u", Key("J", "J", "press", "106")),
        ("106;2u", Key("J", "J", "press", "106")),
        ("106;1:3u", Key("j", "j", "release", "106")),
        ("44:60;2u", Key("<", "<", "press", "44")),
        ("44;2u", Key("<", "<", "press", "44")),
        ("32u", Key("space", "space", "press", "32")),
        ("9u", Key("tab", "tab", "press", "9")),
        ("99;5u", Key("ctrl+c", "ctrl+c", "press", "99")),
        ("105;3u", Key("alt+i", "alt+i", "press", "105")),
        ("A", Key("up", "up", "press", "up")),
        ("1;1:3A", Key("up", "up", "release", "up")),
        ("1;2D", Key("shift+left", "shift+left", "press", "left")),
        ("1;1:3D", Key("left", "left", "release", "left")),
        ("57419;1:1u", Key("up", "up", "press", "57419")),
        ("57407u", Key("8", "8", "press", "57407")),
    ]
    for sent, event in rows:
        assert read(b"\x1b[" + sent.encode(), releases=True) == [event]


def test_a_key_is_the_same_when_its_release_comes_after_a_change_of_layout() -> None:
    pressed, released = read(b"\x1b[105u\x1b[1096::105;1:3u", releases=True)
    assert isinstance(pressed, Key)
    assert isinstance(released, Key)
    assert pressed.code == released.code


def test_a_foreign_keyboard_reports_letter_and_place() -> None:
    rows = [
        ("122::121u", "z", "y"),
        ("44:59;2u", ";", "<"),
        ("252::91u", "ü", "["),
        ("97::113u", "a", "q"),
        ("1096::105u", "ш", "i"),
        ("1083:1051:107;2u", "Л", "K"),
        ("1089::99;5u", "ctrl+\u0441", "ctrl+c"),
        ("106::99;5u", "ctrl+j", "ctrl+j"),
    ]
    for sent, name, base in rows:
        (key,) = read(b"\x1b[" + sent.encode(), releases=True)
        assert isinstance(key, Key)
        assert (key.name, key.base) == (name, base)


def test_caps_lock_shifts_letters_and_num_lock_nothing() -> None:
    for modifiers, name in {65: "I", 66: "i", 129: "i", 130: "I"}.items():
        assert names(f"\x1b[105;{modifiers}u".encode()) == [name]


def test_shift_and_its_like_mean_nothing_alone() -> None:
    for code in [57441, 57447, 57442, 57443, 57358, 57360, 57454]:
        assert read(f"\x1b[{code};2u\x1b[{code};2:3u".encode(), releases=True) == []


def test_answers_and_focus_are_reported_apart_from_keys() -> None:
    sent = b"\x1b[?15u\x1b[?62;c\x1b[0n\x1b[I\x1b[O"
    alive = [
        Answer("keyboard", 15),
        Answer("terminal", 0),
        Answer("alive"),
        Focus(True),
        Focus(False),
    ]
    assert read(sent) == alive


def test_reports_and_pastes_are_no_keys() -> None:
    rows = [
        PASTED,
        b"\x1b[<0;3;4M",
        b"\x1b[<0;3;4m",
        b"\x1b[3;7R",
        b"\x1b[?2026;2$y",
        b"\x1b[8;24;80t",
        b"\x1b]11;rgb:1/2/3\x07",
        b"\x1bP>|kitty(0.26.5)\x1b\\",
        b"\x1b[>1;4000;26c",
    ]
    for sent in rows:
        assert names(sent + b"k") == ["k"]


def test_no_letter_of_an_unknown_sequence_is_a_key() -> None:
    rows = [
        b"\x1b[1;9Q\x1b[99i",
        b"\x1b[105;1:1x",
        b"\x1b[;;u",
        b"\x1b[57500u",
        b"\x1bOi",
        b"\x1b[?9;9h",
        b"\x1b[1<u",
        b"\x1b[1?A",
        b"\x1b[" + b"9" * 5000 + b"u",
        b"\x1b[?" + b"9" * 5000 + b"u",
    ]
    for sent in rows:
        assert all(len(name) > 1 for name in names(sent))


@given(
    st.lists(
        st.sampled_from(
            [
                b"i",
                b"\x1b[A",
                b"\x1b[105;1:3u",
                PASTED,
                "ш".encode(),
                b"\x1b[?15u",
                b"\x03",
                b"\x1bOD",
            ]
        )
    ),
    st.data(),
)
def test_a_slow_line_changes_nothing(sent: list[bytes], data: st.DataObject) -> None:
    """However the bytes are cut into pieces, the same events come."""
    stream = b"".join(sent)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=8)))
    parts = [stream[a:b] for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True)]
    assert read(*parts) == read(stream)


@given(st.lists(st.binary(max_size=40), max_size=10))
def test_rubbish_never_fails_and_never_grows(parts: list[bytes]) -> None:
    keyboard = Keyboard()
    for number, part in enumerate(parts):
        keyboard.feed(part, number * 0.3)
        keyboard.wait(number * 0.3 + 0.2)
    keyboard.feed(b"\x1b]" + b"x" * 3 * MAX_SEQUENCE, 100.0)
    assert len(keyboard.rest) <= 2 * MAX_SEQUENCE


def test_a_lone_escape_is_a_key_once_nothing_followed() -> None:
    keyboard = Keyboard()
    assert keyboard.feed(b"\x1b", 1.0) == []
    assert keyboard.wait(1.0 + ESCAPE_WAIT / 2) == []
    assert keyboard.wait(1.0 + ESCAPE_WAIT) == [Key("escape")]
    assert keyboard.wait(9.0) == []


def test_the_rest_of_a_sequence_that_was_cut_after_its_escape_is_no_letter() -> None:
    for rest in (b"[105;1:1u", b"[A", b"OA", b"[1;2D"):
        keyboard = Keyboard()
        keyboard.feed(b"\x1b", 1.0)
        assert keyboard.wait(1.2) == [Key("escape")]
        assert all(
            isinstance(event, Key) and len(event.code or event.name) > 1
            for event in keyboard.feed(rest, 1.3)
        )
        assert [event.name for event in keyboard.feed(b"i", 1.4) if isinstance(event, Key)] == ["i"]


def test_an_unfinished_sequence_is_a_stop_and_its_rest_no_key() -> None:
    for start in [b"\x1b[", b"\x1b[105;1:", b"\x1bO", b"\x1b]0;", b"\x1bP", b"\x1b[200~iii"]:
        keyboard = Keyboard()
        assert keyboard.feed(start, 1.0) == []
        assert keyboard.wait(1.0 + LATE / 2) == []
        (message,) = keyboard.wait(1.0 + LATE)
        assert isinstance(message, Unknown)
        assert keyboard.wait(2.0) == [], "it is reported once"


def test_the_end_of_a_paste_may_be_long_in_coming() -> None:
    keyboard = Keyboard()
    for now in range(5):
        assert not [
            e
            for e in keyboard.feed(b"\x1b[200~iii" if not now else b"iii", float(now))
            if isinstance(e, Key)
        ]
        keyboard.wait(now + 0.9)
    assert keyboard.feed(b"\x1b[201~k", 5.0) == [Key("k", "k")]
    keyboard.feed(b"\x1b[200~iii", 6.0)
    keyboard.wait(6.0 + LATE)
    keyboard.wait(6.0 + LATE + LONG_PASTE)
    assert keyboard.feed(b"k", 30.0) == [Key("k", "k")], (
        "a paste without an end does not lock the keyboard"
    )
