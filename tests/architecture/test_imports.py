"""The rules of imports: services meet on keys and never in imports, each heavy library has its one place, and no module
imports itself by way of others.
"""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

REPO = Path(__file__).parents[2]
LIBRARY = sorted(REPO.glob("holozen/**/*.py"))
SERVICES = sorted(REPO.glob("services/**/*.py"))
IN_THE_WHEEL = tuple({f"holozen.{path.relative_to(REPO).parts[1]}" for path in SERVICES})
OTHERS = [path for folder in ("examples", "meshes", "scripts") for path in REPO.glob(f"{folder}/**/*.py")]

# Library -> the only places of it in holozen/ and services/.
PLACES = {
    "zenoh": ["holozen/transport/"],
    "mujoco": ["services/sim/physics/mujoco.py"],
    "pybullet": ["services/camera/renderer.py", "services/sim/physics/bullet.py"],
    "prompt_toolkit": ["services/teleop/app.py", "services/teleop/screen.py"],
    "numpy": [
        "holozen/check/",
        "holozen/robot/",
        "holozen/ros/",
        "services/camera/",
        "services/sim/",
        "services/view/",
    ],
    "collada": [],
    "viser": ["services/view/"],
    "websockets": ["services/view/guard.py", "services/view/foxglove_server.py"],
    "foxglove": ["services/view/foxglove_server.py"],
    "xacro": ["holozen/robot/xacro_child.py"],
    "pytest": ["holozen/testing/"],
    "hypothesis": [],
    "trimesh": ["services/view/meshes.py"],
    "rclpy": [],
}


def name(path: Path) -> str:
    return path.relative_to(REPO).as_posix()


@cache  # each rule looks at all of them
def nodes(path: Path) -> list[ast.AST]:
    """What the rules look at."""
    looked_at = ast.Import | ast.ImportFrom | ast.Call
    return [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, looked_at)]


def imports(path: Path) -> Iterator[tuple[int, str]]:
    """(level, module) of each import in a file, also of those inside functions; level 0 is absolute."""
    for node in nodes(path):
        if isinstance(node, ast.Import):
            yield from ((0, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.level, node.module or ""


@cache
def absolute(path: Path) -> set[str]:
    """The top-level packages that a file imports."""
    return {module.partition(".")[0] for level, module in imports(path) if not level}


def made(path: Path) -> set[str]:
    """The names of what a file makes by a call: `Parser` of `Parser(...)` and of `flags.Parser(...)`."""
    calls = [node.func for node in nodes(path) if isinstance(node, ast.Call)]
    return {call.attr if isinstance(call, ast.Attribute) else getattr(call, "id", "") for call in calls}


def test_there_is_something_to_look_at() -> None:
    assert len(LIBRARY) > 30
    assert {path.relative_to(REPO).parts[1] for path in SERVICES} == {
        "camera",
        "sim",
        "teleop",
        "view",
        "controller",
        "pose_service",
    }


def test_a_library_is_imported_in_its_one_place() -> None:
    for library, places in PLACES.items():
        found = [name(path) for path in (*LIBRARY, *SERVICES) if library in absolute(path)]
        assert [place for place in found if not place.startswith(tuple(places))] == [], library
        assert bool(found) == bool(places), library


def test_only_tests_and_benchmarks_import_services() -> None:
    assert [name(path) for path in (*LIBRARY, *SERVICES, *OTHERS) if "services" in absolute(path)] == []


def test_every_verb_reports_a_usage_error_in_one_line() -> None:
    """Which holozen.flags.Parser does, and argparse's own does not."""
    assert [name(path) for path in (*LIBRARY, *SERVICES) if "ArgumentParser" in made(path)] == []


def test_inside_a_service_imports_are_relative_and_from_the_library_absolute() -> None:
    for path in SERVICES:
        for level, module in imports(path):
            assert level < len(path.relative_to(REPO).parts) - 1, f"{name(path)}: {module} is outside its service"
            assert level or not module.startswith(IN_THE_WHEEL), f"{name(path)}: {module}"


def test_the_library_imports_no_service_and_by_full_name() -> None:
    for path in LIBRARY:
        for level, module in imports(path):
            assert level == 0, f"{name(path)}: {module}"
            assert not module.startswith(IN_THE_WHEEL), f"{name(path)}: {module}"


def module_name(path: Path) -> str:
    parts = path.relative_to(REPO).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for path in (*LIBRARY, *SERVICES)}


def imported(module: str) -> set[str]:
    """The modules of ours that one imports, anywhere in its text; a package only if a name of its own is used."""
    path, found = MODULES[module], set()
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    for node in nodes(path):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package.split(".")[: len(package.split(".")) - node.level + 1]) if node.level else ""
            source = ".".join(filter(None, (base, node.module)))
            names = {f"{source}.{alias.name}" for alias in node.names}
            found |= {name if name in MODULES else source for name in names}
    return (found & MODULES.keys()) - {module}


def cycles(graph: dict[str, set[str]]) -> list[set[str]]:
    """The groups of modules that all reach one another."""
    reached: dict[str, set[str]] = {}
    for start in graph:
        seen, waiting = set[str](), [start]
        while waiting:
            for other in graph[waiting.pop()] - seen:
                seen.add(other)
                waiting.append(other)
        reached[start] = seen
    groups = {frozenset({b for b in reached[a] if a in reached[b]} | {a}) for a in graph if a in reached[a]}
    return [set(group) for group in sorted(groups, key=sorted)]


def test_a_cycle_is_seen() -> None:
    assert cycles({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"a"}}) == [{"b", "c"}]
    assert "holozen.ros.rclpy.handle" in imported("holozen.ros.rclpy.node")


def test_no_module_imports_itself_by_way_of_others() -> None:
    """Not even inside a function or under TYPE_CHECKING."""
    assert cycles({module: imported(module) for module in MODULES}) == []
