"""What a package installs and builds, read from its CMakeLists.txt without running CMake."""

import re
from collections.abc import Iterator
from pathlib import Path

LARGEST = 1_000_000  # characters

_COMMENT = re.compile(r"#\[\[.*?\]\]|#[^\n]*", re.DOTALL)
_COMMAND = re.compile(r"(\w+)\s*\(((?:[^()]|\([^()]*\))*)\)")
_WORD = re.compile(r'"([^"]*)"|([^\s;"()]+)')
_VARIABLE = re.compile(r"\$\{(\w+)\}")
_ENDS = (
    "DESTINATION",
    "PERMISSIONS",
    "RENAME",
    "COMPONENT",
    "CONFIGURATIONS",
    "OPTIONAL",
    "TYPE",
    "FILES_MATCHING",
)
_FOLDERS = {"CMAKE_CURRENT_SOURCE_DIR": ".", "CMAKE_SOURCE_DIR": ".", "PROJECT_SOURCE_DIR": "."}


def programs(folder: Path) -> dict[str, Path]:
    """Name -> file of the scripts that a package installs as programs, wherever they lie in it."""
    found: dict[str, Path] = {}
    for command, words in _commands(folder):
        kind = words[0] if words else ""
        if command == "catkin_install_python" or (command == "install" and kind == "PROGRAMS"):
            files = _until(words[1:], _ENDS)
            renamed = words[words.index("RENAME") + 1 :][:1] if "RENAME" in words else []
            names = renamed if len(files) == 1 and renamed else [Path(file).name for file in files]
            found |= {name: folder / file for name, file in zip(names, files, strict=True)}
        elif command == "install" and kind == "DIRECTORY" and _destination(words).startswith("lib"):
            for place in _until(words[1:], _ENDS):
                found |= {
                    file.name: file for file in sorted((folder / place).glob("*")) if file.is_file()
                }
    return {name: path for name, path in found.items() if path.is_file()}


def binaries(folder: Path) -> dict[str, list[Path]]:
    """Name -> sources of the programs that a package builds of C or C++, and of its components with
    a program each.
    """
    found: dict[str, list[Path]] = {}
    sources: dict[str, list[Path]] = {}
    for command, words in _commands(folder):
        if command in ("add_executable", "add_library") and words:
            files = [folder / word for word in words[1:] if "." in word]
            (found if command == "add_executable" else sources)[words[0]] = [
                file for file in files if file.is_file()
            ]
        elif command == "rclcpp_components_register_node" and "EXECUTABLE" in words[1:-1]:
            found[words[words.index("EXECUTABLE") + 1]] = sources.get(words[0], [])
    return found


def _commands(folder: Path) -> Iterator[tuple[str, list[str]]]:
    """Each command of the file with its words, variables replaced as far as they are known."""
    try:
        text = (folder / "CMakeLists.txt").read_text(errors="replace")[:LARGEST]
    except OSError:
        return
    values = {name: [place] for name, place in _FOLDERS.items()}
    for command in _COMMAND.finditer(_COMMENT.sub("", text)):
        name, words = command[1].lower(), _words(command[2], values)
        if name == "project" and words:
            values["PROJECT_NAME"] = [words[0]]
        elif name == "set" and words:
            values[words[0]] = words[1:]
        elif name == "file" and words[:1] in (["GLOB"], ["GLOB_RECURSE"]) and len(words) > 2:
            values[words[1]] = [file for pattern in words[2:] for file in _matches(folder, pattern)]
        yield name, words


def _words(text: str, values: dict[str, list[str]]) -> list[str]:
    found: list[str] = []
    for word in _WORD.finditer(text):
        plain = word[1] if word[1] is not None else word[2]
        alone = _VARIABLE.fullmatch(plain)
        if alone and alone[1] in values:
            found += values[alone[1]]
        else:
            found.append(
                _VARIABLE.sub(lambda match: ";".join(values.get(match[1], [match[0]])), plain)
            )
    return found


def _matches(folder: Path, pattern: str) -> list[str]:
    pattern = pattern.removeprefix("./")
    if pattern.startswith(("/", "..")) or pattern == "RELATIVE":
        return []
    return [str(file.relative_to(folder)) for file in sorted(folder.glob(pattern))]


def _until(words: list[str], ends: tuple[str, ...]) -> list[str]:
    end = next((number for number, word in enumerate(words) if word in ends), len(words))
    return words[:end]


def _destination(words: list[str]) -> str:
    return "".join(words[words.index("DESTINATION") + 1 :][:1]) if "DESTINATION" in words else ""
