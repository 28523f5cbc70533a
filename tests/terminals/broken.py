"""A teleop with one part that breaks when `w` is pressed."""

from pathlib import Path

ROOT = Path(__file__).parents[2]

PARTS = {
    "a key's callback": "breaks()",
    "the tick": "session.Session.tick = breaks",
    "the draw loop": "app.TeleopApp.draw = breaks",
}
"""What breaks, and the statement that breaks it while the key is taken."""

SCRIPT = """
import sys
sys.path.insert(0, {root!r})
from services.teleop import __main__ as teleop, app, session
from services.teleop.input.kitty import Key

def breaks(*_):
    raise RuntimeError("broken on purpose")

take = session.Session.take

def take_and_break(self, event, *more):
    done = take(self, event, *more)
    if isinstance(event, Key) and event.name == "w":
        {statement}
    return done

session.Session.take = take_and_break
sys.exit(teleop.main(sys.argv[1:]))
"""


def broken_teleop(folder: Path, part: str) -> Path:
    """A script that runs the teleop with one part broken; its flags are the teleop's."""
    script = folder / f"{part.split()[-1]}.py"
    script.write_text(SCRIPT.format(root=str(ROOT), statement=PARTS[part]))
    return script
