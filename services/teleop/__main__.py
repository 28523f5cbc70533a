"""The teleop: drives a robot from the keyboard of a terminal."""

import argparse
import asyncio
import sys
from typing import TYPE_CHECKING, Any

from holozen import connection, flags
from holozen.process import SIGNALS
from holozen.tell import say

if TYPE_CHECKING:
    from prompt_toolkit.application import Application
    from prompt_toolkit.formatted_text import StyleAndTextTuples

    from .cockpit import Cockpit

REDRAW = 0.05  # s between two pictures
TICK = 0.005  # s between two looks at what is due
WITHOUT = """holozen topic pub cmd_vel '{"linear": {"x": 0.3}}'"""


def parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="holozen teleop", description="Drive a robot from the keyboard, with the keys of teleop_twist_keyboard."
    )
    add = parser.add_argument
    add("robot", nargs="?", default="", type=flags.robot, help="its name; none: the one at the root")
    add("--speed", type=flags.number(0, 1000, "m/s"), default=0.5, help="m/s (default: 0.5)")
    add("--turn", type=flags.number(0, 1000, "rad/s"), default=1.0, help="rad/s (default: 1.0)")
    add("--speed-limit", type=flags.number(0, 1000, "m/s"), default=1000.0, help="m/s (default: 1000)")
    add("--turn-limit", type=flags.number(0, 1000, "rad/s"), default=1000.0, help="rad/s (default: 1000)")
    add("--repeat-rate", type=flags.number(0, 1000, "Hz"), default=20.0,
        help="Hz; 0: only when a key changes something (default: 20)")  # fmt: skip
    add("--key-timeout", type=flags.number(0, 3600, "s"), default=0.5,
        help="s without a key until the robot stops; 0: drive on until another key (default: 0.5)")  # fmt: skip
    add("--stamped", action="store_true", help="publish TwistStamped instead of Twist")
    add("--frame-id", default="", metavar="FRAME", help="frame_id of the TwistStamped")
    connection.add_arguments(parser)
    return parser


def main(argv: list[str] | None = None) -> int:
    args = parser().parse_args(argv)
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        say(f"teleop: needs a terminal for its keys; without one: {WITHOUT}")
        return 2
    # What needs a terminal loads only where there is one.
    from holozen.bus import Bus, BusError

    from .cockpit import Cockpit
    from .pilot import Pilot, Settings

    names = ("speed", "turn", "speed_limit", "turn_limit", "repeat_rate", "key_timeout")
    pilot = Pilot(Settings(**{name: getattr(args, name) for name in names}))
    try:
        with Bus("teleop", connection.from_arguments(args), lasting=True) as bus:
            return fly(Cockpit(bus, args.robot, pilot, args.frame_id if args.stamped else None))
    except BusError as error:
        say(f"teleop: {error}")
        return 1


def fly(cockpit: "Cockpit") -> int:
    """Run the screen until it is quit, a signal comes or something breaks; the robot is stopped in each case."""
    from .screen import application
    from .view import render

    def draw() -> "StyleAndTextTuples":
        try:
            return [*render(cockpit.state())]
        except Exception as error:
            _fail(app, error)
            return []

    def press(key: str) -> None:
        try:
            cockpit.press(key)
        except Exception as error:
            _fail(app, error)

    app = application(draw, press, cockpit.let_go)
    try:
        asyncio.run(_run(app, cockpit))
    except Exception as error:
        cockpit.halt()
        say(f"teleop: {type(error).__name__}: {error}; the robot was told to stop")
        return 1
    finally:
        cockpit.halt()
    return 0


async def _run(app: "Application[None]", cockpit: "Cockpit") -> None:
    loop = asyncio.get_running_loop()
    for number in SIGNALS:
        loop.add_signal_handler(number, _quit, app, cockpit)
    ticking = loop.create_task(_tick(app, cockpit))
    try:
        await app.run_async(handle_sigint=False, set_exception_handler=False)
    finally:
        ticking.cancel()


async def _tick(app: "Application[None]", cockpit: "Cockpit") -> None:
    try:
        drawn = 0.0
        while True:
            cockpit.tick()
            if (now := asyncio.get_running_loop().time()) - drawn >= REDRAW:
                drawn = now
                app.invalidate()
            await asyncio.sleep(TICK)
    except Exception as error:
        _fail(app, error)


def _fail(app: "Application[Any]", error: Exception) -> None:
    if app.is_running and not app.is_done:
        app.exit(exception=error)


def _quit(app: "Application[Any]", cockpit: "Cockpit") -> None:
    cockpit.let_go()  # before the terminal is tidied up: it may be gone
    if app.is_running and not app.is_done:
        app.exit()


if __name__ == "__main__":
    sys.exit(main())
