"""docs/teleop.md has the keys and the settings as they are."""

import re
from pathlib import Path

import pytest

from services.teleop.control.layout_file import MOTIONS, load
from services.teleop.control.layouts import ACTIONS, FIXED, LAYOUTS, Layout
from services.teleop.settings import NAMES, read

DOCS = Path(__file__).parents[3] / "docs" / "teleop.md"


def table(layout: Layout) -> str:
    """The meanings of all keys in Markdown."""
    lines = ["| keys | meaning |", "|---|---|"]
    for keys, meaning in layout.meanings():
        words = [*(f"`{key}`" for key in keys), *(["and all others"] if meaning == "stop" else [])]
        lines.append(f"| {' '.join(words)} | {meaning} |")
    return "\n".join(lines) + "\n"


TABLES = {
    name: table(layout)
    for name, layout in (LAYOUTS | {"fixed": Layout("fixed", {}, {}, FIXED)}).items()
}


def examples() -> list[str]:
    return re.findall(r"```toml\b[^\n]*\n(.*?)```", DOCS.read_text(), re.DOTALL)


@pytest.mark.parametrize("name", TABLES)
def test_each_table_of_keys_is_current(name: str) -> None:
    assert f"<!-- keys {name} -->\n{TABLES[name]}<!-- /keys -->\n" in DOCS.read_text()


def test_every_motion_action_and_setting_is_named() -> None:
    text = DOCS.read_text()
    assert [word for word in (*MOTIONS, *ACTIONS) if f"`{word}`" not in text] == []
    assert f"The names are {' '.join(f'`{name}`' for name in NAMES)}. " in " ".join(text.split())


def test_the_example_of_keys_is_a_layout(tmp_path: Path) -> None:
    (tmp_path / "keys.toml").write_text(examples()[0])
    layout = load(str(tmp_path / "keys.toml"))
    assert layout.moves["y"] == (1, 0, 0, 1)
    assert layout.actions["h"] == "resume"


def test_the_example_of_settings_can_be_read(tmp_path: Path) -> None:
    (tmp_path / "teleop.toml").write_text(examples()[1])
    assert read(str(tmp_path / "teleop.toml"))["speed"] == 0.3


def test_the_error_that_is_shown_is_the_one_that_comes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("my_keys.toml").write_text('[moves]\nw = "forwards"\n')
    with pytest.raises(ValueError, match="not a motion") as error:
        load("my_keys.toml")
    assert f"```text\n{error.value}\n```" in DOCS.read_text()
