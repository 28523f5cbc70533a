"""The rules of imports: services meet on keys and never in imports, each heavy library has its one
place, and no module imports itself by way of others.
"""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

REPO = Path(__file__).parents[2]
LIBRARY = sorted(REPO.glob("holozen/**/*.py"))
SERVICES = sorted(REPO.glob("services/**/*.py"))
EXTENSIONS = sorted(REPO.glob("extensions/**/*.py"))
IN_THE_WHEEL = tuple({f"holozen.{path.relative_to(REPO).parts[1]}" for path in SERVICES})
EVERYTHING = (*LIBRARY, *SERVICES, *EXTENSIONS)
OTHERS = [
    path for folder in ("examples", "meshes", "scripts") for path in REPO.glob(f"{folder}/**/*.py")
]

# Library -> the only places of it in holozen/, services/ and extensions/; those in an extension may
# be gone with it.
PLACES = {
    "zenoh": ["holozen/transport/", "extensions/ros/gateway/"],
    "mujoco": ["services/sim/physics/mujoco.py"],
    "pybullet": ["services/camera/renderer.py", "services/sim/physics/bullet.py"],
    "prompt_toolkit": ["services/teleop/app.py", "services/teleop/screen.py"],
    "numpy": [
        "extensions/check/",
        "holozen/robot/",
        "extensions/ros/",
        "services/camera/",
        "services/sim/",
        "extensions/view/",
    ],
    "collada": [],
    "viser": ["extensions/view/"],
    "websockets": ["extensions/view/"],
    "xacro": ["holozen/robot/files/xacro_child.py"],
    "pytest": ["holozen/testing/"],
    "hypothesis": [],
    "trimesh": ["extensions/view/meshes.py"],
    "rclpy": [],
}


DECLARATIONS = {
    f"declare_{what}"
    for what in ("publisher", "subscriber", "queryable", "querier", "token", "keyexpr")
}


def name(path: Path) -> str:
    return path.relative_to(REPO).as_posix()


class Source(NamedTuple):
    """What the rules look at in a file. Nothing else is kept: a whole tree takes longer to keep
    than to make.

    Attributes:
        imports: Also those inside functions.
        made: The names of what it makes by a call: `Parser` of `Parser(...)` and `flags.Parser()`.
        attributes: The names of all attributes that it uses.
        of_sessions: Those of what is called `session` itself, as an attribute.
    """

    imports: list[ast.Import | ast.ImportFrom]
    made: set[str]
    attributes: set[str]
    of_sessions: set[str]


@cache  # each rule looks at all of them
def source(path: Path) -> Source:
    """What a file holds."""
    found = Source([], set(), set(), set())
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import | ast.ImportFrom):
            found.imports.append(node)
        elif isinstance(node, ast.Call):
            call = node.func
            found.made.add(
                call.attr if isinstance(call, ast.Attribute) else getattr(call, "id", "")
            )
        elif isinstance(node, ast.Attribute):
            found.attributes.add(node.attr)
            if isinstance(node.value, ast.Attribute) and node.value.attr == "session":
                found.of_sessions.add(node.attr)
    return found


def imports(path: Path) -> Iterator[tuple[int, str]]:
    """(level, module) of each import in a file, also of those inside functions; level 0 is
    absolute.
    """
    for node in source(path).imports:
        if isinstance(node, ast.Import):
            yield from ((0, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.level, node.module or ""


@cache
def absolute(path: Path) -> set[str]:
    """The top-level packages that a file imports."""
    return {module.partition(".")[0] for level, module in imports(path) if not level}


def test_there_is_something_to_look_at() -> None:
    assert len(LIBRARY) > 30
    assert {path.relative_to(REPO).parts[1] for path in SERVICES} == {
        "camera",
        "sim",
        "teleop",
        "controller",
        "pose_service",
    }


def test_a_library_is_imported_in_its_one_place() -> None:
    for library, places in PLACES.items():
        found = [name(path) for path in EVERYTHING if library in absolute(path)]
        assert [place for place in found if not place.startswith(tuple(places))] == [], library
        assert bool(found) == any((REPO / place).exists() for place in places), library


def test_publishing_goes_through_the_bus() -> None:
    """Which stamps and signs commands, lists the publisher and answers gets; and so does all else
    on the wire: nobody else reaches past it to Zenoh's session.
    """
    for path in EVERYTHING:
        if not name(path).startswith(("holozen/transport/", "extensions/ros/gateway/")):
            past = source(path).of_sessions & {"put", "get", "delete", "liveliness"}
            found = source(path).attributes & DECLARATIONS | past
            assert not found, f"{name(path)}: {found}"


def test_only_tests_and_benchmarks_import_services() -> None:
    assert [
        name(path)
        for path in (*EVERYTHING, *OTHERS)
        if "services" in absolute(path) and not path.name.startswith("test_")
    ] == []


def test_every_verb_reports_a_usage_error_in_one_line() -> None:
    """Which holozen.flags.Parser does, and argparse's own does not."""
    assert [name(path) for path in EVERYTHING if "ArgumentParser" in source(path).made] == []


def test_inside_a_service_imports_are_relative_and_from_the_library_absolute() -> None:
    for path in SERVICES:
        for level, module in imports(path):
            assert level < len(path.relative_to(REPO).parts) - 1, (
                f"{name(path)}: {module} is outside its service"
            )
            assert level or not module.startswith(IN_THE_WHEEL), f"{name(path)}: {module}"


def test_the_library_imports_no_service_and_by_full_name() -> None:
    for path in LIBRARY:
        for level, module in imports(path):
            assert level == 0, f"{name(path)}: {module}"
            assert not module.startswith(IN_THE_WHEEL), f"{name(path)}: {module}"


def module_name(path: Path) -> str:
    parts = path.relative_to(REPO).with_suffix("").parts
    if parts[0] == "extensions":
        parts = ("holozen", *parts[1:])
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for path in EVERYTHING}


def imported(module: str) -> set[str]:
    """The modules of ours that one imports, anywhere in its text; a package only if a name of its
    own is used.
    """
    path, found = MODULES[module], set()
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    for node in source(path).imports:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = (
                ".".join(package.split(".")[: len(package.split(".")) - node.level + 1])
                if node.level
                else ""
            )
            origin = ".".join(filter(None, (base, node.module)))
            names = {f"{origin}.{alias.name}" for alias in node.names}
            found |= {name if name in MODULES else origin for name in names}
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
    groups = {
        frozenset({b for b in reached[a] if a in reached[b]} | {a})
        for a in graph
        if a in reached[a]
    }
    return [set(group) for group in sorted(groups, key=sorted)]


def test_a_cycle_is_seen() -> None:
    assert cycles({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"a"}}) == [{"b", "c"}]
    assert "holozen.transport.node" in imported("holozen.transport.bus")


def test_no_module_imports_itself_by_way_of_others() -> None:
    """Not even inside a function or under TYPE_CHECKING."""
    assert cycles({module: imported(module) for module in MODULES}) == []
