"""The teleop: drives a robot from the keyboard of a terminal."""

import argparse
import os
import signal
import sys
from typing import TYPE_CHECKING

from holozen import connection, flags
from holozen.tell import say

if TYPE_CHECKING:
    from holozen.bus import Bus

    from .cockpit import Cockpit
    from .layouts import Layout

DRIVE_MODES, ZENOH_MODES = ("hold", "latch"), ("peer", "client", "router")
WITHOUT = """holozen topic pub {key} '{{"linear": {{"x": 0.3}}}}'"""


class Mode(argparse.Action):
    """`--mode` means two things, the keys' and Zenoh's; their words tell which."""

    def __call__(
        self, _parser: argparse.ArgumentParser, args: argparse.Namespace, word: object, _flag: str | None = None
    ) -> None:
        setattr(args, "mode" if word in DRIVE_MODES else "zenoh_mode", word)


def parser() -> argparse.ArgumentParser:
    parser = flags.Parser(
        prog="holozen teleop",
        description="Drive a robot from the keyboard, with the keys of teleop_twist_keyboard.",
        epilog="example: holozen teleop Fred --speed 0.3",
        conflict_handler="resolve",
    )
    add = parser.add_argument
    add("robots", nargs="*", metavar="ROBOT", type=flags.robot,
        help="names; Tab goes from one to the next (none: the one at the root)")  # fmt: skip
    add("--robot", action="append", default=[], type=flags.robot, metavar="ROBOT", help="the same as a flag")
    add("--speed", type=flags.number(0, 1000, "m/s"), default=0.5, help="m/s (default: 0.5)")
    add("--turn", type=flags.number(0, 1000, "rad/s"), default=1.0, help="rad/s (default: 1.0)")
    add("--speed-limit", type=flags.number(0, 1000, "m/s"), default=1000.0, help="m/s (default: 1000)")
    add("--turn-limit", type=flags.number(0, 1000, "rad/s"), default=1000.0, help="rad/s (default: 1000)")
    add("--repeat-rate", type=flags.number(0, 1000, "Hz"), default=20.0,
        help="Hz; 0: only when a key changes something (default: 20)")  # fmt: skip
    add("--key-timeout", type=flags.number(0, 3600, "s"),
        help="s that a key counts if the terminal tells no releases; 0: latch (default: while it repeats)")  # fmt: skip
    add("--deadman", action=argparse.BooleanOptionalAction, default=False, help="drive only while space is held too")
    add("--keys", default="ttk", metavar="LAYOUT", help="ttk, wasd, arrows or a TOML file (default: ttk)")
    add("--joystick", nargs="?", const="", metavar="DEVICE", help="drive by a gamepad too (default: the first one)")
    add(
        "--plain",
        action=argparse.BooleanOptionalAction,
        default=False,
        help="a line a second instead of a screen, for screen readers and logs",
    )
    add("--script", metavar="FILE", help="drive what a file says, without a terminal; - reads standard input")
    add("--stamped", action=argparse.BooleanOptionalAction, default=False, help="publish TwistStamped instead of Twist")
    add("--frame-id", default="", metavar="FRAME", help="frame_id of the TwistStamped")
    add("--cmd-vel", default="", metavar="KEY", type=flags.key,
        help="where the robot listens (default: [ROBOT/]cmd_vel)")  # fmt: skip
    add("--name", default="teleop", help="of this node (default: teleop)")
    connection.add_arguments(parser)
    add("--mode", action=Mode, choices=(*DRIVE_MODES, *ZENOH_MODES),
        help="hold: drive while a key is held; latch: until another (default: hold); or Zenoh's mode")  # fmt: skip
    parser.set_defaults(zenoh_mode="peer")
    return parser


def main(argv: list[str] | None = None) -> int:
    from .layouts import LayoutError, load
    from .ros_words import RosWordError
    from .settings import SettingsError, parse, path

    try:
        args = parse(parser(), sys.argv[1:] if argv is None else argv, path())
        layout = load(args.keys)
    except (LayoutError, SettingsError, RosWordError) as error:
        say(f"teleop: {error}")
        return 2
    args.robots = [*args.robot, *args.robots]
    if args.deadman and (args.script is not None or latches(args)):
        say("teleop: --deadman needs keys that are held, so neither --script nor --mode latch; or give --no-deadman")
        return 2
    if args.script is None and not (sys.stdin.isatty() and sys.stdout.isatty()):
        from holozen.wire import key_for

        key = args.cmd_vel or key_for("cmd_vel", args.robots[0] if args.robots else "")
        say(f"teleop: needs a terminal for its keys; without one: --script FILE, or {WITHOUT.format(key=key)}")
        return 2
    from holozen.errors import BusError

    try:
        return read_script(args, layout) if args.script is not None else fly(args, layout)
    except BusError as error:
        say(f"teleop: {error}")
        return 1


def latches(args: argparse.Namespace) -> bool:
    """Whether a key sets the motion until another one."""
    return args.mode == "latch" or (args.mode is None and args.key_timeout == 0)


def fly(args: argparse.Namespace, layout: "Layout") -> int:
    """Drive from the terminal until it is quit, a signal comes or something breaks; the robot is stopped each time."""
    from .dials import Dials
    from .flight import ENDS, Flight, TeleopError
    from .joystick import Joystick, JoystickError
    from .screen import Screen
    from .terminal import Terminal

    try:
        joystick = None if args.joystick is None else Joystick.open(args.joystick)
    except JoystickError as error:
        say(f"teleop: {error}")
        return 1
    term = os.environ.get("TERM", "dumb")
    plain, ascii = args.plain or term == "dumb", term == "linux"  # whose font lacks what the picture is drawn with
    with open_bus(args) as bus:
        cockpit = open_cockpit(args, bus, layout)
        dials = Dials(cockpit)
        for number in ENDS:
            signal.signal(number, _quit)  # until the flight minds them: the terminal is to be left as it was
        try:
            with Terminal(full=not plain) as terminal:
                screen = Screen(terminal, dials, plain, ascii, not os.environ.get("NO_COLOR"))
                try:
                    Flight(cockpit, terminal, screen, joystick).run()
                finally:
                    cockpit.halt()  # before the terminal is tidied up: it may be gone
        except TeleopError as error:
            say(f"teleop: {error}")
            return 2
        except OSError as error:
            say(f"teleop: the terminal is gone ({error}); the robot was told to stop")
        except Exception as error:
            say(f"teleop: {type(error).__name__}: {error}; the robot was told to stop")
            return 1
        finally:
            dials.close()
    return 0


def _quit(_number: int, _frame: object) -> None:
    raise SystemExit(0)


def read_script(args: argparse.Namespace, layout: "Layout") -> int:
    """Drive what a script says."""
    from holozen.process import stop_event

    from . import script

    try:
        steps = script.load(args.script, layout)
    except script.ScriptError as error:
        say(f"teleop: {error}")
        return 2
    stop = stop_event()
    args.mode = "hold"  # its keys are held for as long as it says, whatever keys of a terminal are
    with open_bus(args) as bus:
        cockpit = open_cockpit(args, bus, layout)
        try:
            failed = script.run(steps, cockpit, stop)
        finally:
            cockpit.halt()
    if failed:
        say(f"teleop: {failed}")
    return 1 if failed else 0


def open_bus(args: argparse.Namespace) -> "Bus":
    """The teleop's node."""
    from holozen.bus import Bus

    where = connection.from_arguments(argparse.Namespace(**{**vars(args), "mode": args.zenoh_mode}))
    return Bus(args.name, where, lasting=True)


def open_cockpit(args: argparse.Namespace, bus: "Bus", layout: "Layout") -> "Cockpit":
    """The cockpit that the flags describe."""
    from .cockpit import Cockpit
    from .pilot import Pilot, Settings

    names = ("speed", "turn", "speed_limit", "turn_limit", "repeat_rate", "deadman")
    settings = Settings(
        mode="latch" if latches(args) else "hold",
        key_timeout=args.key_timeout or None,
        **{name: getattr(args, name) for name in names},
    )
    return Cockpit(bus, args.robots, Pilot(settings, layout), args.frame_id if args.stamped else None, args.cmd_vel)


if __name__ == "__main__":
    sys.exit(main())
