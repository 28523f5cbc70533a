"""The picture of the teleop in the docs is what the teleop looks like."""

import xml.etree.ElementTree as ET
from pathlib import Path

from tests.core.teleop.picture import COLUMNS, ROWS, scene, svg, terminal

PICTURE = Path(__file__).parents[3] / "docs" / "teleop.svg"


def test_the_picture_in_the_docs_is_what_the_script_makes_now() -> None:
    assert PICTURE.read_text() == svg(terminal(scene())), "scripts/teleop-picture redraws it"


def test_the_picture_is_small_and_holds_every_letter() -> None:
    """Blocks and dots are shapes; what is left are the words of the screen, in its order."""
    drawn = "".join(ET.fromstring(PICTURE.read_text()).itertext())
    shown = "".join(terminal(scene()).display)
    words = [word for word in shown.split() if word.isascii()]
    assert len(words) > 60
    assert all(word in drawn for word in words)
    assert PICTURE.stat().st_size < 20_000
    assert (COLUMNS, ROWS) == (80, 24)
