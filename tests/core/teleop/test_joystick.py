"""A gamepad as Linux gives it: events of 24 bytes through a real pipe, and answers in the kernel's
structs.
"""

import contextlib
import os
import select
import struct
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from services.teleop.input import gamepad
from services.teleop.input.gamepad import (
    ABS_HAT0Y,
    ABS_RX,
    ABS_X,
    ABS_Y,
    BTN_SOUTH,
    BTN_START,
    BTN_TL,
    EV_ABS,
    EV_KEY,
    EV_SYN,
    GET_AXES,
    GET_AXIS,
    GET_KEYS,
    GET_KEYS_DOWN,
    GET_NAME,
    REST,
    SYN_DROPPED,
    Device,
    Joystick,
    JoystickError,
)

REPORT = (EV_SYN, gamepad.SYN_REPORT, 0)
AHEAD = pytest.approx((1, 0, 0), abs=1e-4)  # a pad of whole numbers has no exact middle
STICKS = (ABS_X, ABS_Y, ABS_RX)


def bits(codes: Iterable[int], size: int) -> bytes:
    return sum(1 << code for code in codes).to_bytes(size, "little")


def absinfo(value: int, low: int, high: int) -> bytes:
    return struct.pack("6i", value, low, high, 16, 128, 0)


class Recorded(Device):
    """A device whose events are written by the test, and whose answers to ioctl stand in a
    table.
    """

    def __init__(self, low: int = -32768, high: int = 32767, **more: bytes) -> None:
        self._descriptor, self.pen = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        self._rest = b""
        middle = absinfo((low + high + 1) // 2, low, high)
        self.answers = {
            GET_NAME: b"Pad of a test\0\0\0",
            GET_AXES: bits([*STICKS, 4, ABS_HAT0Y], 8),
            GET_KEYS: bits([BTN_SOUTH, BTN_TL, BTN_START], 96),
            GET_KEYS_DOWN: bytes(96),
            **{GET_AXIS + axis: middle for axis in STICKS},
            GET_AXIS + ABS_HAT0Y: absinfo(0, -1, 1),
        }

    def _ask(self, number: int, size: int) -> bytes:
        return self.answers[number]

    def play(self, *events: tuple[int, int, int]) -> None:
        os.write(
            self.pen, b"".join(struct.pack("llHHi", 1700000000, 5, *event) for event in events)
        )


@pytest.fixture
def device() -> Iterator[Recorded]:
    made = Recorded()
    yield made
    made.close()
    if made.pen >= 0:
        os.close(made.pen)


def test_the_requests_are_those_of_the_kernels_headers() -> None:
    """As a C program prints them: EVIOCGNAME(256), EVIOCGBIT(EV_KEY, 96), EVIOCGBIT(EV_ABS, 8),
    ...
    """
    assert (GET_NAME, GET_KEYS, GET_AXES) == (0x81004506, 0x80604521, 0x80084523)
    assert (GET_KEYS_DOWN, GET_AXIS + ABS_RX) == (0x80604518, 0x80184543)
    assert gamepad.EVENT.size == 24 or struct.calcsize("l") == 4


def test_a_pad_drives_while_the_dead_man_is_held(device: Recorded) -> None:
    with Joystick(device, "/dev/input/event7") as joystick:
        device.play(
            (EV_KEY, BTN_TL, 1), REPORT, (EV_ABS, ABS_X, -32768), (EV_ABS, ABS_Y, 32767), REPORT
        )
        assert select.select([joystick], [], [], 0)[0]
        assert joystick.direction == REST
        assert joystick.read() == []
        assert joystick.direction == pytest.approx((-(0.5**0.5), 0.5**0.5, 0), abs=1e-4)
        assert not select.select([joystick], [], [], 0)[0]
        device.play((EV_KEY, BTN_TL, 0), REPORT)
        joystick.read()
        assert joystick.direction == REST


def test_a_stick_that_points_away_from_the_start_counts(device: Recorded) -> None:
    device.answers[GET_AXIS + ABS_Y] = absinfo(-32768, -32768, 32767)
    with Joystick(device, "") as joystick:
        device.play((EV_KEY, BTN_TL, 1), REPORT)
        joystick.read()
        assert joystick.direction == AHEAD


def test_a_dead_man_that_is_held_at_the_start_does_not_count(device: Recorded) -> None:
    device.answers[GET_KEYS_DOWN] = bits([BTN_TL], 96)
    with Joystick(device, "") as joystick:
        device.play((EV_ABS, ABS_Y, -32768), (EV_KEY, BTN_TL, 1), REPORT)
        joystick.read()
        assert joystick.direction == REST
        device.play((EV_KEY, BTN_TL, 0), REPORT, (EV_KEY, BTN_TL, 1), REPORT)
        joystick.read()
        assert joystick.direction == AHEAD


def test_presses_are_reported_in_their_order(device: Recorded) -> None:
    with Joystick(device, "") as joystick:
        device.play(
            (EV_KEY, BTN_START, 1), REPORT, (EV_KEY, BTN_START, 0), (EV_ABS, ABS_HAT0Y, -1), REPORT
        )
        device.play((EV_ABS, ABS_HAT0Y, 1), REPORT)
        assert joystick.read() == ["resume", "faster", "slower"]
        assert joystick.read() == []


def test_an_event_that_comes_in_two_parts_is_put_together(device: Recorded) -> None:
    with Joystick(device, "") as joystick:
        event = struct.pack("llHHi", 1, 2, EV_KEY, BTN_START, 1)
        os.write(device.pen, event[:7])
        assert joystick.read() == []
        os.write(device.pen, event[7:])
        assert joystick.read() == ["resume"]


def test_after_lost_events_the_state_is_read_again_and_the_dead_man_must_be_released(
    device: Recorded,
) -> None:
    with Joystick(device, "") as joystick:
        device.play((EV_KEY, BTN_TL, 1), (EV_ABS, ABS_Y, -32768), REPORT)
        joystick.read()
        assert joystick.direction == AHEAD
        device.answers[GET_KEYS_DOWN] = bits([BTN_TL], 96)
        device.answers[GET_AXIS + ABS_Y] = absinfo(32767, -32768, 32767)
        device.play((EV_SYN, SYN_DROPPED, 0), (EV_KEY, BTN_TL, 1), REPORT)
        joystick.read()
        assert joystick.direction == REST
        device.play((EV_KEY, BTN_TL, 0), REPORT, (EV_KEY, BTN_TL, 1), REPORT)
        joystick.read()
        assert joystick.direction == pytest.approx((-1, 0, 0), abs=1e-4)


def test_after_letting_go_only_a_new_press_drives(device: Recorded) -> None:
    with Joystick(device, "") as joystick:
        device.play((EV_KEY, BTN_TL, 1), (EV_ABS, ABS_Y, -32768), REPORT)
        joystick.read()
        device.answers[GET_AXIS + ABS_Y] = absinfo(-32768, -32768, 32767)
        device.answers[GET_KEYS_DOWN] = bits([BTN_TL], 96)
        device.play(
            (EV_KEY, BTN_TL, 0), REPORT, (EV_KEY, BTN_TL, 1), (EV_KEY, BTN_START, 1), REPORT
        )
        joystick.let_go()
        assert joystick.direction == REST
        assert joystick.read() == []
        assert joystick.direction == REST
        device.play((EV_KEY, BTN_TL, 0), REPORT, (EV_KEY, BTN_TL, 1), REPORT)
        joystick.read()
        assert joystick.direction == AHEAD


def test_letting_go_of_a_pad_that_is_gone_does_no_harm(device: Recorded) -> None:
    with Joystick(device, "") as joystick:
        device.play((EV_KEY, BTN_TL, 1), (EV_ABS, ABS_Y, -32768), REPORT)
        joystick.read()
        joystick.close()
        joystick.let_go()
        assert joystick.direction == REST


def test_letting_go_as_a_pad_is_unplugged_rests(device: Recorded) -> None:
    with Joystick(device, "") as joystick:
        device.play((EV_KEY, BTN_TL, 1), (EV_ABS, ABS_Y, -32768), REPORT)
        joystick.read()
        os.close(device.pen)
        device.pen = -1
        joystick.let_go()
        assert joystick.direction == REST


def test_a_press_right_after_letting_go_drives_if_the_dead_man_was_up(device: Recorded) -> None:
    device.answers[GET_AXIS + ABS_Y] = absinfo(-32768, -32768, 32767)
    with Joystick(device, "") as joystick:
        joystick.let_go()
        device.play((EV_KEY, BTN_TL, 1), REPORT)
        joystick.read()
        assert joystick.direction == AHEAD


def test_a_flood_does_not_hold_the_mapper_and_nothing_of_it_is_lost(device: Recorded) -> None:
    with Joystick(device, "") as joystick:
        for _ in range(12):
            device.play(*[(EV_ABS, ABS_X, 5)] * 100)
        device.play((EV_KEY, BTN_START, 1))
        assert joystick.read() == []
        assert joystick.read() + joystick.read() == ["resume"]


def test_an_unplugged_pad_rests_and_is_reported(device: Recorded) -> None:
    with Joystick(device, "/dev/input/event7") as joystick:
        device.play((EV_KEY, BTN_TL, 1), (EV_ABS, ABS_Y, -32768), REPORT)
        joystick.read()
        os.close(device.pen)
        device.pen = -1
        with pytest.raises(JoystickError) as error:
            joystick.read()
        assert str(error.value) == "joystick /dev/input/event7: 'Pad of a test' is gone"
        assert joystick.direction == REST


def test_a_pad_that_is_closed_rests(device: Recorded) -> None:
    joystick = Joystick(device, "")
    device.play((EV_KEY, BTN_TL, 1), (EV_ABS, ABS_Y, -32768), REPORT)
    joystick.read()
    for _ in range(2):
        joystick.close()
    assert joystick.direction == REST
    with pytest.raises(JoystickError):
        joystick.read()


@pytest.mark.parametrize(
    ("answers", "words"),
    [
        ({GET_AXES: bits([ABS_X, ABS_Y], 8)}, "is not a gamepad: it has no ABS_RX"),
        ({GET_AXES: bytes(8)}, "is not a gamepad: it has no ABS_X, ABS_Y, ABS_RX"),
        # a pad's motion sensors
        ({GET_KEYS: bytes(96)}, "is not a gamepad: it has no BTN_SOUTH, BTN_TL"),
        ({GET_AXIS + ABS_RX: absinfo(0, 0, 0)}, "has no range for ABS_RX: 0 to 0"),
        ({GET_AXIS + ABS_X: absinfo(0, 255, 0)}, "has no range for ABS_X: 255 to 0"),
    ],
)
def test_what_is_no_gamepad_is_refused(
    device: Recorded, answers: dict[int, bytes], words: str
) -> None:
    device.answers.update(answers)
    with pytest.raises(JoystickError) as error:
        Joystick(device, "/dev/input/event3")
    assert str(error.value) == f"joystick /dev/input/event3: 'Pad of a test' {words}"


def test_a_name_that_moves_the_cursor_is_made_harmless(device: Recorded) -> None:
    device.answers[GET_NAME] = b"Pad\x1b[2J\xff\0"
    assert Joystick(device, "").name == "Pad?[2J\ufffd"


def test_what_is_no_input_device_is_refused_and_never_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    with pytest.raises(ValueError) as embedded_null:  # its text depends on Python's version
        os.open("a\0b", os.O_RDONLY)
    no_device = "is not an input device; use one of /dev/input/event*"
    for path, words in (
        (f"{tmp_path}/none", "No such file or directory"),
        (str(tmp_path), no_device),
        (f"{tmp_path}/fifo", no_device),
        ("/dev/null", no_device),
        ("a\0b", str(embedded_null.value)),
    ):
        with pytest.raises(JoystickError) as error:
            Joystick.open(path)
        assert str(error.value) == f"joystick {path}: {words}".replace("\0", "?")


def test_a_folder_without_gamepads_is_reported_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder in (f"{tmp_path}/none", str(tmp_path)):
        monkeypatch.setattr(gamepad, "FOLDER", folder)
        with pytest.raises(JoystickError) as error:
            Joystick.open("")
        assert str(error.value) == f"joystick: no gamepad: there are no input devices in {folder}"
    for name in ("event0", "event12", "js0", "mice", "eventually"):
        (tmp_path / name).touch()
    with pytest.raises(JoystickError) as error:
        Joystick.open("")
    assert str(error.value) == f"joystick: none of the 2 devices in {tmp_path} is a gamepad"


@contextlib.contextmanager
def unprivileged() -> Iterator[None]:
    """Without root's permission to read everything."""
    before = os.geteuid()
    os.seteuid(before or 65534)
    try:
        yield
    finally:
        os.seteuid(before)


def test_devices_that_may_not_be_read_are_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    with tempfile.TemporaryDirectory() as folder:
        os.chmod(folder, 0o755)
        Path(folder, "event0").touch(0)
        monkeypatch.setattr(gamepad, "FOLDER", folder)
        with (
            unprivileged(),
            pytest.raises(JoystickError, match=r"event0: no permission; join the group .* input "),
        ):
            Joystick.open(f"{folder}/event0")
        with (
            unprivileged(),
            pytest.raises(JoystickError, match=r"1 of 1 devices in .* may not be read"),
        ):
            Joystick.open("")
