"""The files that travel with the code are found beside it."""

from pathlib import Path

import pytest

from holozen import data

REPO = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("folder", "name"),
    [
        ("urdf", "hb_bot.urdf.xacro"),
        ("worlds", "gazebo.world"),
        ("meshes", "base.dae"),
        ("urdf", ""),
    ],
)
def test_a_data_file_of_the_tree_is_found(folder: str, name: str) -> None:
    assert data.find(folder, name) == REPO / folder / name
    assert data.find(folder, name).exists()
