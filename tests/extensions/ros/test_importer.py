"""Imports of a script are found, generated on first use, and answered in one line where they do not
exist.
"""

import importlib
import linecache
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from holozen.messages.definitions import InterfaceError
from holozen.ros import generated, importer, tracebacks
from holozen.ros.catalog import MODULES

GOAL = "int64 request_goal\n---\nfloat64 x_goal\nint64 end_of_list\n"
EMPTY = "<package><name>{}</name></package>"


@pytest.fixture(autouse=True)
def _alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A folder of its own with nothing below it, no ROS around, and everything as before
    afterwards.
    """
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path / "empty")
    for variable in ("AMENT_PREFIX_PATH", "ROS_PACKAGE_PATH"):
        monkeypatch.delenv(variable, raising=False)
    before = set(sys.modules)
    yield
    importer.remove()
    importlib.invalidate_caches()
    for name in set(sys.modules) - before:
        if "my_pkg" in name or "pretend" in name:
            del sys.modules[name]


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A lesson's package with one service and one message."""
    return written(tmp_path / "ws" / "my_pkg")


def written(folder: Path) -> Path:
    for kind, name, text in (("srv", "NextGoal.srv", GOAL), ("msg", "Shape.msg", "string name\n")):
        (folder / kind).mkdir(parents=True)
        (folder / kind / name).write_text(text)
    (folder / "package.xml").write_text(EMPTY.format(folder.name))
    return folder


def ran(line: str) -> dict[str, Any]:
    """The names after a line of a script."""
    names: dict[str, Any] = {}
    exec(line, names)
    return names


def refused(line: str, kind: type[Exception] = ImportError) -> str:
    with pytest.raises(kind) as error:
        ran(line)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_our_tables_are_packages_whose_classes_are_made_when_they_are_used() -> None:
    importer.install()
    made = set(generated.MADE)
    names = ran("import sensor_msgs.msg, std_srvs.srv\nfrom geometry_msgs import msg")
    assert set(generated.MADE) == made
    assert "LaserScan" in dir(names["sensor_msgs"].msg)
    names = ran(
        "from geometry_msgs.msg import Twist, Vector3 as V\nfrom std_srvs.srv import Trigger\nt = "
        "Twist()"
    )
    assert names["Twist"] is generated.find("geometry_msgs/msg/Twist")
    assert type(names["t"].linear) is names["V"]
    assert names["Trigger"].Response().message == ""
    assert {"Bool", "String", "Empty"} <= set(ran("from std_msgs.msg import *"))
    assert ran("import nav_msgs\nx = nav_msgs.msg.Odometry()")["x"].child_frame_id == ""
    assert ran("from holozen.srv import NextGoal")["NextGoal"].ROS == "holozen/srv/NextGoal"


def test_nothing_is_importable_before_and_after(package: Path) -> None:
    for _ in range(2):
        assert refused("import geometry_msgs.msg") == "No module named 'geometry_msgs'"
        importer.install({"my_pkg": package})
        ran("from geometry_msgs.msg import Twist\nfrom my_pkg.srv import NextGoal")
        importer.remove()
    with pytest.raises(InterfaceError):
        generated.find("my_pkg/srv/NextGoal")
    assert not any(name.startswith("geometry_msgs") for name in sys.modules)


def test_a_second_call_takes_the_place_of_the_first(package: Path) -> None:
    count = len(sys.meta_path)
    importer.install()
    refused("import my_pkg.srv")
    importer.install({"my_pkg": package})
    ran("import my_pkg.srv")
    assert len(sys.meta_path) == count + 2


@pytest.mark.parametrize(
    "how", ["given", "near the script", "beside the folder", "in the environment"]
)
def test_a_lessons_package_is_found(
    how: str, package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = package / "scripts" / "controller.py"
    if how == "beside the folder":
        monkeypatch.chdir(package.parent)
    if how == "in the environment":
        monkeypatch.setenv("ROS_PACKAGE_PATH", str(package.parent))
    importer.install(
        {"my_pkg": package} if how == "given" else {}, [script] if how == "near the script" else []
    )
    names = ran("from my_pkg.srv import NextGoal\nfrom my_pkg.msg import Shape\nimport my_pkg")
    assert names["NextGoal"].Request(request_goal=3).request_goal == 3
    assert names["Shape"](name="star").name == "star"


@pytest.mark.parametrize(
    ("where", "first"),
    [
        ("on sys.path", "from my_pkg.srv import NextGoal"),
        ("on sys.path", "from my_pkg.tools import TWO"),
        ("in the package", "from my_pkg.srv import NextGoal"),
        ("in src", "from my_pkg.tools import TWO"),
    ],
)
def test_a_package_with_python_modules_has_both(
    where: str, first: str, package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = package / ("src" if where == "in src" else "") / "my_pkg"
    folder.mkdir(parents=True)
    (folder / "__init__.py").write_text("ONE = 1\n")
    (folder / "tools.py").write_text("TWO = 2\n")
    if where == "on sys.path":
        monkeypatch.syspath_prepend(package)
    importer.install({}, [package / "scripts" / "x.py"])
    names = ran(
        f"{first}\nfrom my_pkg import ONE, tools\nfrom my_pkg.srv import NextGoal\nfrom my_pkg "
        "import msg"
    )
    assert (names["ONE"], names["tools"].TWO, names["msg"].Shape().name) == (1, 2, "")
    assert names["NextGoal"].ROS == "my_pkg/srv/NextGoal"


def test_a_folder_of_the_same_name_on_the_path_is_not_in_the_way(
    package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the workspace on sys.path, my_pkg and my_pkg/srv pass for packages without files."""
    monkeypatch.syspath_prepend(package.parent)
    importer.install({}, [package / "x.py"])
    assert ran("from my_pkg.srv import NextGoal")["NextGoal"].Response().end_of_list == 0


def test_modules_called_msg_that_are_pythons_stay_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "my_pkg_mail").mkdir()
    (tmp_path / "my_pkg_mail" / "__init__.py").touch()
    (tmp_path / "my_pkg_mail" / "msg.py").write_text("HERE = 1\n")
    monkeypatch.syspath_prepend(tmp_path)
    importer.install()
    assert ran("from my_pkg_mail.msg import HERE")["HERE"] == 1
    assert ran("import email.message")
    assert refused("import my_pkg_mail.srv") == "No module named 'my_pkg_mail.srv'"
    assert refused("import my_pkg_other") == "No module named 'my_pkg_other'"
    assert importlib.util.find_spec("my_pkg_other") is None


def test_our_own_modules_are_imported_as_ever() -> None:
    load = (
        "from holozen.ros import generated, importer; importer.install(); import "
        "holozen.plotting, holozen.srv"
    )
    code = f"{load}; print(len(generated.MADE))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "0\n"


def test_interfaces_made_by_a_real_ros_are_not_taken(
    package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    theirs = package.parent / "site" / "my_pkg"
    (theirs / "srv").mkdir(parents=True)
    (theirs / "__init__.py").touch()
    (theirs / "srv" / "__init__.py").write_text("raise RuntimeError\n")
    monkeypatch.syspath_prepend(theirs.parent)
    importer.install({"my_pkg": package})
    assert ran("from my_pkg.srv import NextGoal")["NextGoal"].Request().request_goal == 0


def test_an_unknown_package_is_reported_with_the_nearest_and_the_folders_searched(
    package: Path,
) -> None:
    script = package / "x.py"
    importer.install({}, [script])

    def line(source: str) -> str:
        script.write_text(source)
        with pytest.raises(ModuleNotFoundError) as error:
            exec(compile(source, str(script), "exec"))
        linecache.checkcache()
        return tracebacks.import_error_line(error.value)

    assert line("from my_pgk.srv import NextGoal") == (
        f"{script}:1: no package 'my_pgk' with .msg, .srv or .action files (did you mean "
        "'my_pkg'?); searched "
        f"AMENT_PREFIX_PATH, ROS_PACKAGE_PATH and the package.xml files around {package}, "
        f"{Path.cwd()}; "
        "to give its folder: --package my_pgk=DIR"
    )
    assert "did you mean 'std_msgs'?" in line("import std_mgs.msg")
    assert "did you mean 'geometry_msgs'?" in line("import geometri_msgs")
    assert "--package zebra=DIR" in line("from zebra.msg import X")
    yours = "; of a package of yours give the folder: --package {0}=DIR"
    assert line("import rclp").endswith(
        f": No module named 'rclp' (did you mean 'rclpy'?){yours.format('rclp')}"
    )
    assert line("import turtlebot9").endswith(
        f": No module named 'turtlebot9'{yours.format('turtlebot9')}"
    )
    assert line("import stable_baselines3").endswith("; install it: pip install stable-baselines3")
    hint = "of a package of yours give the folder: --package zebra=DIR"
    assert line("import zebra") == f"{script}:1: No module named 'zebra'; {hint}"


def test_a_package_without_its_nodes_is_told_once(capsys: pytest.CaptureFixture[str]) -> None:
    importer.install()
    names = ran(
        "from turtlesim.msg import Pose\nfrom turtlesim.srv import Spawn\nfrom gazebo_msgs.msg "
        "import ModelStates"
    )
    assert (
        names["Pose"](x=1.0).x,
        names["Spawn"].Response().name,
        names["ModelStates"]().name,
    ) == (1.0, "", [])
    message = "holozen run: turtlesim itself is not here: nobody reads turtle1/cmd_vel"
    assert capsys.readouterr().err.count(message) == 1


def test_a_given_folder_that_is_none_is_reported(tmp_path: Path) -> None:
    importer.install({"my_pkg": tmp_path / "none"})
    expected = refused("import my_pkg.srv", ModuleNotFoundError)
    assert expected == f"--package my_pkg={tmp_path / 'none'}: there is no such folder"


def test_an_unknown_type_is_reported_with_the_nearest(package: Path) -> None:
    importer.install({"my_pkg": package})
    assert refused("from geometry_msgs.msg import Twsit") == (
        "no type 'geometry_msgs/msg/Twsit' (did you mean 'geometry_msgs/msg/Twist'?)"
    )
    assert "did you mean 'my_pkg/srv/NextGoal'?" in refused("from my_pkg.srv import NextGaol")
    assert "did you mean 'geometry_msgs/msg/Twist'?" in refused(
        "import geometry_msgs.msg\ngeometry_msgs.msg.Twits", AttributeError
    )
    assert refused("import std_msgs.foo").startswith("no type 'std_msgs/foo'")


def test_a_definition_that_is_broken_is_reported_with_its_line(package: Path) -> None:
    file = package / "srv" / "Broken.srv"
    file.write_text("int64 a\n---\nint65 b\n")
    importer.install({"my_pkg": package})
    for line in (
        "from my_pkg.srv import Broken",
        "import my_pkg.srv\nmy_pkg.srv.Broken",
        "from my_pkg.srv import *",
    ):
        assert refused(line).startswith(f"{file}:3: ")
    file.write_text("int64 a\n")
    importer.install({"my_pkg": package})
    assert refused("from my_pkg.srv import Broken") == f"{file}: '---' makes 1 part; a .srv has 2"


def test_what_a_package_does_not_have_is_reported(package: Path) -> None:
    (package / "msg" / "Shape.msg").unlink()
    importer.install({"my_pkg": package})
    expected = f"package 'my_pkg' has no .msg files in {package / 'msg'}"
    assert refused("from my_pkg.msg import Shape", ModuleNotFoundError) == expected
    assert refused("import my_pkg\nmy_pkg.msg", AttributeError) == expected
    assert (
        refused("import my_pkg\nmy_pkg.other", AttributeError)
        == "my_pkg has no 'other'; it has msg, srv and action"
    )
    assert (
        refused("import geometry_msgs.srv", ModuleNotFoundError)
        == "package 'geometry_msgs' has no .srv files"
    )


class PretendError(Exception):
    """As those of rclpy.exceptions."""


@pytest.fixture
def pretend(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Two modules of ROS with two of ours behind them."""
    ours, other = ModuleType("holozen.ros.pretend"), ModuleType("holozen.ros.pretend_other")
    PretendError.__module__ = ours.__name__
    ours.__dict__.update(
        {
            "__all__": ["Thing", "PretendError"],
            "Thing": 1,
            "hidden": 2,
            "PretendError": PretendError,
        }
    )
    other.__dict__.update({"__all__": ["Other"], "Other": 3})
    for name in [name for name in MODULES if name.startswith("rclpy")]:
        monkeypatch.delitem(MODULES, name)
    for name, module in (("rclpy", other), ("rclpy.pretend", ours), ("rclpy.pretend_other", other)):
        monkeypatch.setitem(sys.modules, module.__name__, module)
        monkeypatch.setitem(MODULES, name, module.__name__)
    return ours


def test_a_module_of_ros_has_what_ours_exports(pretend: ModuleType) -> None:
    importer.install()
    names = ran(
        "from rclpy.pretend import Thing, PretendError\nimport rclpy\nx = rclpy.pretend_other.Other"
    )
    assert (names["Thing"], names["x"], names["PretendError"].__module__) == (1, 3, "rclpy.pretend")
    assert set(ran("from rclpy.pretend import *")) == {"__builtins__", "Thing", "PretendError"}


def test_an_import_of_a_type_from_its_package_is_answered_with_its_module() -> None:
    importer.install()
    assert (
        refused("from geometry_msgs.msgs import Twist")
        == "geometry_msgs has no 'msgs'; write geometry_msgs.msg"
    )
    expected = "geometry_msgs has no Twist; write: from geometry_msgs.msg import Twist"
    assert refused("from geometry_msgs import Twist", ImportError) == expected


def test_what_a_module_of_ros_lacks_is_reported(pretend: ModuleType) -> None:
    importer.install()
    page = "; see docs/coming-from-ros.md"
    expected = f"rclpy.pretend has no 'Thign' here (did you mean 'Thing'?){page}"
    assert refused("from rclpy.pretend import Thign") == expected
    assert refused("import rclpy.pretend\nrclpy.pretend.Thign", AttributeError) == expected
    assert (
        refused("from rclpy.pretend import hidden") == f"rclpy.pretend has no 'hidden' here{page}"
    )
    assert (
        refused("from rclpy.pretend import Other")
        == f"rclpy.pretend has no 'Other' here; it is in rclpy{page}"
    )
    expected = f"launch.actions has no 'Node' here; it is in launch_ros.actions{page}"
    assert refused("from launch.actions import Node") == expected
    assert refused("import rclpy\nrclpy.__file__", AttributeError) == "rclpy has no '__file__'"
    assert "did you mean 'rclpy.pretend'?" in refused("import rclpy.pretens", ModuleNotFoundError)
    assert "this belongs to ROS 1; use ROS 2's rclpy" in refused(
        "import rospy", ModuleNotFoundError
    )
    assert "; use rclpy, or holozen.bus" in refused("import gz.transport13", ModuleNotFoundError)
    assert "keep the last message of each topic" in refused(
        "import message_filters", ModuleNotFoundError
    )


def test_actions_of_a_package_are_made_from_its_files(package: Path) -> None:
    importer.install({"my_pkg": package})
    assert f"no .action files in {package}" in refused(
        "from my_pkg.action import Turn", ModuleNotFoundError
    )
    (package / "action").mkdir()
    (package / "action" / "Turn.action").write_text(
        "float64 angle\n---\nbool done\n---\nfloat64 left\n"
    )
    importer.install({"my_pkg": package})
    turn = ran("from my_pkg.action import Turn")["Turn"]
    assert (turn.Goal(angle=1.0).angle, turn.Result().done, turn.Feedback().left) == (
        1.0,
        False,
        0.0,
    )
    assert turn.Impl.SendGoalService.Request().get_fields_and_field_types() == {
        "goal_id": "unique_identifier_msgs/UUID",
        "goal": "my_pkg/Turn_Goal",
    }


def test_lifecycle_nodes_and_components_are_refused_in_one_line() -> None:
    importer.install()
    for line in ("from rclpy.lifecycle import Node", "import rclpy.lifecycle"):
        assert "there are no lifecycle nodes here; use rclpy.node.Node" in refused(
            line, ModuleNotFoundError
        )
    assert "components are C++ and do not run here" in refused(
        "import rclpy_components", ModuleNotFoundError
    )


def test_the_module_of_one_type_has_the_same_class(package: Path) -> None:
    for module, names in [
        ("geometry_msgs.msg._twist", ["Twist"]),
        ("geometry_msgs.msg._pose_with_covariance_stamped", ["PoseWithCovarianceStamped"]),
        ("sensor_msgs.msg._point_cloud2", ["PointCloud2"]),
        ("std_msgs.msg._u_int8_multi_array", ["UInt8MultiArray"]),
        ("std_srvs.srv._set_bool", ["SetBool", "SetBool_Request", "SetBool_Response"]),
        ("my_pkg.srv._next_goal", ["NextGoal", "NextGoal_Request", "NextGoal_Response"]),
    ]:
        importer.install({"my_pkg": package})
        made = importlib.import_module(module)
        assert made.__all__ == names
        kind = importlib.import_module(module.rpartition(".")[0])
        assert getattr(made, names[0]) is getattr(kind, names[0])


def test_the_module_of_no_type_is_not_there(package: Path) -> None:
    importer.install({"my_pkg": package})
    for module in ("geometry_msgs.msg._twost", "my_pkg.msg._next_goal", "geometry_msgs.msg._Twist"):
        with pytest.raises(ImportError):
            importlib.import_module(module)
    with pytest.raises(ImportError, match="_twist"):
        exec("from geometry_msgs.msg._twist import Twost")
