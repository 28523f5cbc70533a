"""ament_index_python: the folders of packages, from their sources or where they are installed."""

from pathlib import Path

from holozen.robot.errors import RobotError
from holozen.ros import packages

__all__ = [
    "PackageNotFoundError",
    "get_package_prefix",
    "get_package_share_directory",
    "get_package_share_path",
    "get_packages_with_prefixes",
]


class PackageNotFoundError(KeyError):
    """There is no such package. The message lists where it was searched."""

    def __str__(self) -> str:
        return str(self.args[0])


def get_package_share_directory(package_name: str, print_warning: bool = True) -> str:
    """The folder that holds a package's urdf, launch and worlds: its sources, unless it is
    installed.

    Raises PackageNotFoundError, and ValueError for anything but a name.
    """
    return str(get_package_share_path(package_name))


def get_package_share_path(package_name: str, print_warning: bool = True) -> Path:
    """As get_package_share_directory, as a path."""
    if not isinstance(package_name, str) or not package_name:
        raise ValueError(f"{package_name!r} is not a package name")
    try:
        return packages.find(package_name).absolute()
    except RobotError as error:
        raise PackageNotFoundError(str(error)) from None


def get_package_prefix(package_name: str) -> str:
    """Where a package is installed; the folder of its sources if it is not. Raises
    PackageNotFoundError.
    """
    return str(packages.prefix(get_package_share_path(package_name)))


def get_packages_with_prefixes() -> dict[str, str]:
    """Every package that is found by its sources, and its prefix."""
    return {name: str(packages.prefix(folder)) for name, folder in packages.around().items()}
