"""Who may import what: services meet on keys and never in imports, and each heavy library has its one place."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

REPO = Path(__file__).parents[2]
LIBRARY = sorted(REPO.glob("holozen/**/*.py"))
SERVICES = sorted(REPO.glob("services/**/*.py"))
OTHERS = [path for folder in ("examples", "meshes", "scripts") for path in REPO.glob(f"{folder}/**/*.py")]

# Library -> the only places of it in holozen/ and services/.
PLACES = {
    "zenoh": ["holozen/bus.py", "holozen/session.py"],
    "pybullet": ["services/sim/engine.py"],
    "numpy": ["holozen/robot/", "holozen/ros/", "services/sim/"],
    "collada": [],
    "xacro": ["holozen/robot/xacro/child.py"],
    "pytest": ["holozen/testing/"],
    "hypothesis": [],
    "trimesh": [],
    "rclpy": [],
}


def name(path: Path) -> str:
    return path.relative_to(REPO).as_posix()


def imports(path: Path) -> Iterator[tuple[int, str]]:
    """(level, module) of each import in a file, also of those inside functions; level 0 is absolute."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from ((0, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.level, node.module or ""


@cache  # every library is looked for in all of them
def absolute(path: Path) -> set[str]:
    """The top-level packages that a file imports."""
    return {module.partition(".")[0] for level, module in imports(path) if not level}


def made(path: Path) -> set[str]:
    """The names of what a file makes by a call: `Parser` of `Parser(...)` and of `flags.Parser(...)`."""
    calls = [node.func for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)]
    return {call.attr if isinstance(call, ast.Attribute) else getattr(call, "id", "") for call in calls}


def test_there_is_something_to_look_at() -> None:
    assert len(LIBRARY) > 30
    assert {path.parent.name for path in SERVICES} == {"sim", "teleop", "controller", "pose_service"}


@pytest.mark.parametrize("library", PLACES)
def test_a_library_is_imported_in_its_one_place(library: str) -> None:
    found = [name(path) for path in (*LIBRARY, *SERVICES) if library in absolute(path)]
    assert [place for place in found if not place.startswith(tuple(PLACES[library]))] == []
    assert bool(found) == bool(PLACES[library])


@pytest.mark.parametrize("path", [*LIBRARY, *SERVICES, *OTHERS], ids=name)
def test_nobody_imports_services_but_tests_and_benchmarks(path: Path) -> None:
    assert "services" not in absolute(path)


@pytest.mark.parametrize("path", [*LIBRARY, *SERVICES], ids=name)
def test_every_verb_tells_a_mistake_in_one_line(path: Path) -> None:
    """Which holozen.flags.Parser does, and argparse's own does not."""
    assert "ArgumentParser" not in made(path)


@pytest.mark.parametrize("path", SERVICES, ids=name)
def test_inside_a_service_imports_are_relative_and_from_the_library_absolute(path: Path) -> None:
    for level, module in imports(path):
        assert level in (0, 1), f"{module}: a service imports nothing from beside it"
        own = {p.parent.name for p in SERVICES}
        assert not (level == 0 and module.startswith(tuple(f"holozen.{service}" for service in own)))


@pytest.mark.parametrize("path", LIBRARY, ids=name)
def test_the_library_knows_no_service_and_imports_by_full_name(path: Path) -> None:
    services = {f"holozen.{service.parent.name}" for service in SERVICES}
    for level, module in imports(path):
        assert level == 0
        assert not module.startswith(tuple(services))
