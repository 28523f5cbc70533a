"""What is tried in a fresh clone on other Pythons and systems: what a person does in the first
minutes.
"""

from pathlib import Path

REPO = Path(__file__).parents[1]
CHOSEN = (
    "integration/test_up.py::"
    "test_without_a_terminal_the_controller_drives_the_square_and_the_page_of_a_view_ends_with_it",
    "integration/test_up.py::test_in_a_terminal_it_shows_the_teleop_and_ctrl_c_ends_all",
    "integration/test_camera.py::test_a_red_cube_is_where_geometry_puts_it",
    "*/camera/test_pictures.py",
    "*/sim/test_world.py",
    "*/test_engines.py",
)
"""Tests, below tests/: `up` to the first odom and the view's page, the teleop in a terminal, a
camera, the engine.
"""


def chosen() -> list[str]:
    """CHOSEN as arguments of pytest."""
    found = []
    for pattern in CHOSEN:
        file, colons, test = pattern.partition("::")
        (path,) = (REPO / "tests").glob(file)
        found.append(f"{path.relative_to(REPO)}{colons}{test}")
    return found


if __name__ == "__main__":
    print(*chosen(), sep="\n")
