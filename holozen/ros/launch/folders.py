"""Substitutions that are the folders and files of packages."""

from pathlib import Path

from holozen.robot.errors import RobotError
from holozen.ros import executables, packages
from holozen.ros.launch.context import LaunchContext
from holozen.ros.launch.text import LaunchError, Substitution, Text, here, shown, text


class FindPackageShare(Substitution):
    """The folder of a package, with its urdf, launch and worlds."""

    def __init__(self, package: Text) -> None:
        self.package, self.place = package, here()

    def perform(self, context: LaunchContext) -> str:
        """The folder. Raises LaunchError."""
        return str(self._folder(context))

    def find(self, package_name: str) -> str:
        """The folder of any package, at once. Raises LaunchError."""
        return type(self)(package_name).perform(LaunchContext())

    def _folder(self, context: LaunchContext) -> Path:
        try:
            return packages.find(text(context, self.package)).absolute()
        except RobotError as error:
            raise LaunchError(str(error), self.place) from None

    def describe(self) -> str:
        """The package."""
        return f"share of {shown(self.package)}"


class FindPackagePrefix(FindPackageShare):
    """Where a package is installed; the folder of its sources if it is not."""

    def perform(self, context: LaunchContext) -> str:
        """The folder. Raises LaunchError."""
        return str(packages.prefix(self._folder(context)))


FindPackage = FindPackagePrefix


class ExecutableInPackage(Substitution):
    """The path of a package's executable."""

    def __init__(self, executable: Text, package: Text) -> None:
        self.executable, self.package, self.place = executable, package, here()

    def perform(self, context: LaunchContext) -> str:
        """The path. Raises LaunchError."""
        try:
            package, executable = text(context, self.package), text(context, self.executable)
            return str(executables.find(package, executable, nameless=True).path)
        except executables.NotFound as error:
            raise LaunchError(str(error), self.place) from None
