"""The teleop: drives a robot from the keyboard of a terminal."""

import argparse
import os
import signal
import sys
from typing import TYPE_CHECKING

from holozen import flags
from holozen.console import report
from holozen.suggest import listed
from holozen.transport import connection
from holozen.transport.errors import BusError

if TYPE_CHECKING:
    from holozen.bus import Bus

    from .control.layouts import Layout
    from .session import Session

DRIVE_MODES = ("hold", "latch")
WITHOUT = """holozen topic pub {key} '{{"linear": {{"x": 0.3}}}}'"""


class Mode(argparse.Action):
    """`--mode` sets the mode of the keys or of Zenoh, depending on its value."""

    def __call__(
        self,
        _parser: argparse.ArgumentParser,
        args: argparse.Namespace,
        word: object,
        _flag: str | None = None,
    ) -> None:
        setattr(args, "mode" if word in DRIVE_MODES else "zenoh_mode", word)


def parser() -> argparse.ArgumentParser:
    parser = flags.Parser(
        prog="holozen teleop",
        description="drive a robot from the keyboard, with the keys of teleop_twist_keyboard",
        epilog="example: holozen teleop Fred --speed 0.3",
        conflict_handler="resolve",
    )
    add = parser.add_argument
    add(
        "robots",
        nargs="*",
        metavar="ROBOT",
        type=flags.robot,
        help="names; Tab switches to the next one (none: the robot at the root)",
    )
    add(
        "--robot",
        action="append",
        default=[],
        type=flags.robot,
        metavar="ROBOT",
        help="same as the ROBOT argument",
    )
    add("--speed", type=flags.number(0, 1000, "m/s"), default=0.5, help="m/s (default: 0.5)")
    add("--turn", type=flags.number(0, 1000, "rad/s"), default=1.0, help="rad/s (default: 1.0)")
    add(
        "--speed-limit",
        type=flags.number(0, 1000, "m/s"),
        default=1000.0,
        help="m/s (default: 1000)",
    )
    add(
        "--turn-limit",
        type=flags.number(0, 1000, "rad/s"),
        default=1000.0,
        help="rad/s (default: 1000)",
    )
    add(
        "--repeat-rate",
        type=flags.number(0, 1000, "Hz"),
        default=20.0,
        help="Hz; 0: publish only on changes (default: 20)",
    )
    add(
        "--key-timeout",
        type=flags.number(0, 3600, "s"),
        help="s that a key counts if no release is reported; 0: latch (default: while it repeats)",
    )
    add(
        "--deadman",
        action=argparse.BooleanOptionalAction,
        default=False,
        help="drive only while space is also held",
    )
    add(
        "--keys",
        default="ttk",
        metavar="LAYOUT",
        help="ttk, wasd, arrows or a TOML file (default: ttk)",
    )
    add(
        "--joystick",
        nargs="?",
        const="",
        metavar="DEVICE",
        help="also drive with a gamepad (default: the first one)",
    )
    add(
        "--plain",
        action=argparse.BooleanOptionalAction,
        default=False,
        help="one line per second instead of a screen, for screen readers and logs",
    )
    add(
        "--script",
        metavar="FILE",
        help="drive by a script, without a terminal; - reads standard input",
    )
    add(
        "--stamped",
        action=argparse.BooleanOptionalAction,
        default=False,
        help="publish TwistStamped instead of Twist",
    )
    add("--frame-id", default="", metavar="FRAME", help="frame_id of the TwistStamped")
    add(
        "--cmd-vel",
        default="",
        metavar="KEY",
        type=flags.key,
        help="where the robot listens (default: [ROBOT/]cmd_vel)",
    )
    add("--name", default="teleop", help="name of this node (default: teleop)")
    connection.add_arguments(parser, role="operator")
    add(
        "--mode",
        action=Mode,
        choices=(*DRIVE_MODES, *connection.MODES),
        help="hold: drive while a key is held; latch: until another (default: hold); or Zenoh's "
        "mode",
    )
    parser.set_defaults(zenoh_mode=None)
    return parser


def main(argv: list[str] | None = None) -> int:
    from .control.layout_file import load
    from .settings import parse, path
    from .toml_file import InputError

    try:
        args = parse(parser(), sys.argv[1:] if argv is None else argv, path())
        layout = load(args.keys)
        args.robots = [*args.robot, *args.robots]
        if problem := _unusable(args):
            raise InputError(problem)
        return read_script(args, layout) if args.script is not None else drive(args, layout)
    except (InputError, BusError) as error:
        report(f"teleop: {error}")
        return 2 if isinstance(error, InputError) else 1


def _unusable(args: argparse.Namespace) -> str:
    """Why the flags do not go together, or not with where it runs; empty if they do."""
    if args.deadman and (args.script is not None or latches(args)):
        return (
            "--deadman needs keys that are held, so neither --script nor --mode latch; or give "
            "--no-deadman"
        )
    if args.script is not None and len(set(args.robots)) > 1:
        return f"a script drives one robot, so name one of {listed(args.robots)}"
    if args.script is None and not (sys.stdin.isatty() and sys.stdout.isatty()):
        from holozen.wire import key_for

        key = args.cmd_vel or key_for("cmd_vel", args.robots[0] if args.robots else "")
        return (
            "needs a terminal for its keys; without one: --script FILE, or "
            f"{WITHOUT.format(key=key)}"
        )
    return ""


def latches(args: argparse.Namespace) -> bool:
    """Whether a key sets the motion until another key is pressed."""
    return args.mode == "latch" or (args.mode is None and args.key_timeout == 0)


def drive(args: argparse.Namespace, layout: "Layout") -> int:
    """Drive from the terminal until quit, a signal or an error; the robot is stopped in each
    case.
    """
    from .app import ENDS, TeleopApp, TeleopError
    from .input.gamepad import Joystick, JoystickError
    from .input.terminal import Terminal
    from .telemetry import Telemetry

    try:
        joystick = None if args.joystick is None else Joystick.open(args.joystick)
    except JoystickError as error:
        report(f"teleop: {error}")
        return 1
    term = os.environ.get("TERM", "dumb")
    # its font lacks the drawing characters
    plain, ascii = (args.plain or term == "dumb", term == "linux")
    with open_bus(args) as bus:
        session = open_session(args, bus, layout)
        telemetry = Telemetry(session)
        try:
            for number in ENDS:
                # until the app handles them: the terminal must be restored
                signal.signal(number, _quit)
            with Terminal(full=not plain) as terminal:
                colour = not os.environ.get("NO_COLOR")
                try:
                    TeleopApp(session, terminal, telemetry, joystick, plain, ascii, colour).run()
                finally:
                    session.halt()  # before the terminal is restored, which may be gone
        except KeyboardInterrupt:
            return 0
        except TeleopError as error:
            report(f"teleop: {error}")
            return 2
        except OSError as error:
            report(f"teleop: the terminal is gone ({error}); a stop was sent to the robot")
        except Exception as error:
            report(f"teleop: {type(error).__name__}: {error}; a stop was sent to the robot")
            return 1
    return 0


def _quit(_number: int, _frame: object) -> None:
    """Raise what `interrupt_again` raises again where a callback of the interpreter swallows it."""
    raise KeyboardInterrupt


def read_script(args: argparse.Namespace, layout: "Layout") -> int:
    """Drive according to a script."""
    from holozen.process import stop_event

    from . import script

    steps = script.load(args.script, layout)
    stop = stop_event()
    args.mode = "hold"  # a script states how long keys are held
    with open_bus(args) as bus:
        session = open_session(args, bus, layout)
        try:
            failed = script.run(steps, session, stop)
        finally:
            session.halt()
    if failed:
        report(f"teleop: {failed}")
    return 1 if failed else 0


def open_bus(args: argparse.Namespace) -> "Bus":
    """The teleop's node."""
    from holozen.bus import Bus

    where = connection.from_arguments(argparse.Namespace(**{**vars(args), "mode": args.zenoh_mode}))
    return Bus(args.name, where, lasting=True)


def only_robot(bus: "Bus") -> list[str]:
    """The robot to drive where none was named: the only one there, if it has a name; else the one
    at the root.
    """
    from .session import robots_among

    there = robots_among(bus.endpoints())
    return list(there) if len(there) == 1 and there != {""} else []


def open_session(args: argparse.Namespace, bus: "Bus", layout: "Layout") -> "Session":
    """A session configured by the flags."""
    from .control.twist_mapper import Settings, TwistMapper
    from .session import Session

    names = ("speed", "turn", "speed_limit", "turn_limit", "repeat_rate", "deadman")
    settings = Settings(
        mode="latch" if latches(args) else "hold",
        key_timeout=args.key_timeout or None,
        **{name: getattr(args, name) for name in names},
    )
    return Session(
        bus,
        args.robots or ([] if args.cmd_vel else only_robot(bus)),
        TwistMapper(settings, layout),
        args.frame_id if args.stamped else None,
        args.cmd_vel,
    )


if __name__ == "__main__":
    sys.exit(main())
