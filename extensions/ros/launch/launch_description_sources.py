"""launch.launch_description_sources: launch files, and how they are read."""

from pathlib import Path
from types import ModuleType

from holozen.ros.executables import missing
from holozen.ros.launch.launch_context import LaunchContext, LaunchError, Text, describe, here, text
from holozen.ros.launch.launch_description import LaunchDescription
from holozen.ros.launch.stand_ins import launch_file_of_ros

__all__ = [
    "AnyLaunchDescriptionSource",
    "FrontendLaunchDescriptionSource",
    "PythonLaunchDescriptionSource",
]


class PythonLaunchDescriptionSource:
    """A launch file in Python, read when it is included."""

    def __init__(self, launch_file_path: Text) -> None:
        self.path, self.place = launch_file_path, here()

    @property
    def location(self) -> str:
        """The path, as far as it is known."""
        return describe(self.path)

    def load(self, context: LaunchContext) -> tuple[Path, LaunchDescription]:
        """The path and the description. Raises LaunchError, and what the file raises."""
        path = Path(text(context, self.path))
        try:
            return path, launch_file_of_ros(path, self.place) or read(path)
        except LaunchError as error:
            raise LaunchError.of(error, self.place) from None


# Only launch files in Python are supported here.
AnyLaunchDescriptionSource = FrontendLaunchDescriptionSource = PythonLaunchDescriptionSource


def read(path: Path) -> LaunchDescription:
    """The description that a launch file generates. Raises LaunchError, and what the file
    raises.
    """
    if not path.is_file():
        raise LaunchError(missing(path, "*.launch.py", "launch files"))
    if path.suffix in (".xml", ".yaml", ".yml", ".launch"):
        fix = (
            f"write {path.name.partition('.')[0]}.launch.py, with a Node(package=..., "
            "executable=...) for each node"
        )
        raise LaunchError(
            f"{path}: launch files are in Python here; {fix}, or start its scripts by `holozen run`"
        )
    if path.suffix != ".py":
        raise LaunchError(f"{path}: not a launch file; the names of launch files end with .py here")
    try:
        source = path.read_bytes()
    except OSError as error:
        raise LaunchError(f"cannot read {path}: {error.strerror}") from None
    module = ModuleType("launch_file")
    module.__file__ = str(path)
    exec(compile(source, str(path), "exec", dont_inherit=True), module.__dict__)
    generate = getattr(module, "generate_launch_description", None)
    if not callable(generate):
        raise LaunchError(f"{path} has no function generate_launch_description()")
    found = generate()
    if not isinstance(found, LaunchDescription):
        raise LaunchError(
            f"{path}: generate_launch_description() returned {found!r:.80}, not a LaunchDescription"
        )
    return found
