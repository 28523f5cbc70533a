"""No module imports itself by way of others, not even inside a function or under TYPE_CHECKING."""

import ast
from pathlib import Path

REPO = Path(__file__).parents[2]


def module_name(path: Path) -> str:
    parts = path.relative_to(REPO).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for folder in ("holozen", "services") for path in REPO.glob(f"{folder}/**/*.py")}


def imported(module: str) -> set[str]:
    """The modules of ours that one imports, anywhere in its text; a package only if a name of its own is used."""
    path, found = MODULES[module], set()
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    for node in ast.walk(ast.parse(path.read_text())):
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
    assert cycles({module: imported(module) for module in MODULES}) == []
