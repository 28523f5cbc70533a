"""The location of data files: beside this package in the source tree, inside it when installed."""

from pathlib import Path

_HERE = Path(__file__).resolve().parent


def find(folder: str, name: str = "") -> Path:
    """The path of `name` in the data folder urdf, meshes or worlds."""
    inside = _HERE / folder / name
    return inside if inside.exists() else _HERE.parent / folder / name
