"""`holozen run`: a script runs as by `python3`, with ROS's packages, and ends as it would there."""

import gzip
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from holozen.testing import Process, Wire
from holozen.testing.process import run as run_program
from holozen.testing.wire import command

from .conftest import Write

Run = Callable[..., subprocess.CompletedProcess[str]]
REPO = Path(__file__).parents[3]


@pytest.fixture
def run(home: Path, wire: Wire) -> Run:
    """`run("controller.py", "--x")`: run it to its end, in the working folder. `is_new`: in a new
    Python, where variables are given or its end matters.
    """

    def run(
        *words: str, flags: tuple[str, ...] = (), is_new: bool = False, **env: str
    ) -> subprocess.CompletedProcess[str]:
        line = command("run", *wire.flags, *flags, *words)
        is_new |= bool(env)
        return run_program(line, 60.0, is_new=is_new, env=environment(**env) if is_new else None)

    return run


@pytest.fixture
def refuse(home: Path, wire: Wire, call: Run) -> Run:
    """As `run`, in this process: for what is refused before any script runs."""
    return partial(call, "run", *wire.flags)


def environment(**more: str) -> dict[str, str]:
    """That of the test, with this tree importable from any folder."""
    return {**os.environ, "PYTHONPATH": str(REPO), **more}


def test_a_script_is_main_with_its_own_words_and_folder_first(run: Run, write: Write) -> None:
    write("scripts/helper.py", "word = 'helped'")
    message = (
        "print(__name__, sys.argv, __file__, sys.modules['__main__'].__dict__ is globals(), "
        "helper.word)"
    )
    path = write("scripts/a.py", f"import sys, helper\n{message}")
    done = run("scripts/a.py", "x", "--connect", "-h", "--ros-args", "-r", "a:=b", is_new=True)
    words = [str(path), "x", "--connect", "-h", "--ros-args", "-r", "a:=b"]
    assert done.stdout == f"__main__ {words} {path} True helped\n"
    assert (done.returncode, done.stderr) == (0, "")


def test_it_has_what_python_gives_every_script(run: Run, write: Write) -> None:
    """The names that a script of its own finds in its module."""
    path = write("a.py", "print(sorted(globals()), __doc__, __package__, __spec__)")
    plain = subprocess.run([sys.executable, str(path)], capture_output=True, text=True, timeout=60)
    assert run("a.py").stdout == plain.stdout


ROS_OWN = [
    (
        "tf2_ros tf2_echo odom base_link 2",
        "tf2_ros tf2_echo is not run here: use `holozen tf echo odom base_link`",
    ),
    ("tf2_ros tf2_echo odom --ros-args -r a:=b", "use `holozen tf echo odom`"),
    ("xacro xacro my_bot.xacro name:=x", "use `holozen xacro my_bot.xacro name:=x`"),
    ("teleop_twist_keyboard teleop_twist_keyboard", "use `holozen teleop`"),
    ("rviz2 rviz2 -d a.rviz", "use `holozen view` or `holozen map`"),
    ("rviz2", "rviz2 is not run here: use `holozen view` or `holozen map`"),
    (
        "gazebo_ros spawn_model -urdf -model Fred -file a.urdf",
        "use `holozen spawn -urdf -model Fred -file a.urdf`",
    ),
    ("gazebo_ros gzserver", "use `holozen sim --empty`"),
    ("gazebo_ros gzclient", "use `holozen view` or `holozen map`"),
    (
        "tf2_tools view_frames",
        "tf2_tools view_frames is not run here: use `holozen view` or `holozen tf echo`",
    ),
    (
        "demo_nodes_cpp talker",
        "use `holozen topic pub chatter std_msgs/msg/String '{data: Hello}'`",
    ),
    ("robot_state_publisher robot_state_publisher", "the sim itself publishes joint_states and tf"),
]


def test_of_what_is_ros_own_it_names_the_verb(refuse: Run) -> None:
    for words, expected in ROS_OWN:
        done = refuse(*words.split())
        assert (done.returncode, done.stdout) == (1, "")
        assert done.stderr.startswith("holozen run: ") and done.stderr.endswith(f"{expected}\n")
        assert done.stderr.count("\n") == 1


def test_the_static_transform_publisher_is_run_by_its_name(run: Run) -> None:
    done = run(
        "tf2_ros", "static_transform_publisher", "0", "0", "far", "0", "0", "0", "world", "lid"
    )
    assert done.returncode == 2
    assert "static_transform_publisher: argument --z: 'far'" in done.stderr


def test_a_package_with_the_name_of_one_of_ros_own_is_run(run: Run, write: Write) -> None:
    write("src/xacro/package.xml", "<package><name>xacro</name></package>")
    write("src/xacro/scripts/xacro.py", "print('my own')")
    assert run("xacro", "xacro").stdout == "my own\n"


def test_an_executable_of_a_package_is_found(run: Run, write: Write, my_bot: Path) -> None:
    write("src/my_bot/scripts/a.py", "print('a script')")
    write(
        "src/my_bot/setup.py",
        "setup(entry_points={'console_scripts': ['b = my_bot.b:Main.start']})",
    )
    write("src/my_bot/my_bot/__init__.py")
    write(
        "src/my_bot/my_bot/b.py",
        "class Main:\n  def start():\n    print('a function', __name__)\n    return 7",
    )
    assert run("my_bot", "a").stdout == "a script\n"
    done = run("my_bot", "b")
    assert (done.stdout, done.returncode) == ("a function my_bot.b\n", 7)
    write(
        "src/my_bot/setup.py",
        "setup(entry_points={'console_scripts': ['b = my_bot.b:Main.strat']})",
    )
    done = run("my_bot", "b")
    expected = (
        "my_bot.b:Main.strat in the package's setup file is not a function (did you mean "
        "'start'?)\n"
    )
    assert (done.returncode, done.stderr) == (1, f"TypeError: {expected}")


def test_the_exit_code_is_the_scripts(run: Run, write: Write) -> None:
    for end, code, message in [
        ("", 0, ""),
        ("sys.exit(3)", 3, ""),
        ("sys.exit('no robot')", 1, "no robot\n"),
        ("sys.exit(-1)", 255, ""),
        (
            "import rclpy; rclpy.init(); node = rclpy.create_node('a'); sys.exit('no robot')",
            1,
            "no robot\n",
        ),
        ("os.kill(os.getpid(), 2); time.sleep(60)", 130, ""),
    ]:
        write("a.py", f"import os, sys, time\n{end}")
        done = run("a.py")
        assert (done.returncode, done.stderr) == (code, message)


def test_what_a_script_wrote_to_a_file_that_it_left_open_is_there(
    run: Run, write: Write, home: Path
) -> None:
    write("a.py", "import rclpy\nfile = open('measured.csv', 'w')\nfile.write('1,2')")
    assert run("a.py", is_new=True).returncode == 0
    assert Path("measured.csv").read_text() == "1,2"


def test_a_traceback_is_the_users_and_shows_none_of_ours(run: Run, write: Write) -> None:
    path = write(
        "a.py",
        "def f():\n    return 1 / 0\n\n\ntry:\n    f()\nexcept Exception as e:\n    raise "
        "OSError('b') from e",
    )
    done = run("a.py")
    plain = subprocess.run([sys.executable, str(path)], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (plain.returncode, plain.stderr)


def test_ours_is_left_out_of_what_an_error_came_from(run: Run, write: Write) -> None:
    failing = (
        "try:\n    rclpy.create_node('a')\nexcept Exception as e:\n    raise OSError('b') from e"
    )
    write("a.py", f"import rclpy\n{failing}")
    message = run("a.py").stderr
    assert "direct cause" in message
    assert "holozen/" not in message


def test_what_is_no_python_is_reported_as_python_does(run: Run, write: Write) -> None:
    for text in ["def f(:\n  pass", "x = '\0'"]:
        write("a.py", text)
        done = run("a.py")
        assert done.returncode == 1
        assert "holozen" not in done.stderr
        assert "Error: " in done.stderr.splitlines()[-1]


def test_frames_of_ours_between_those_of_the_user_are_left_out(run: Run, write: Write) -> None:
    write(
        "a.py",
        """
import rclpy
rclpy.init()
node = rclpy.create_node("a")
node.create_timer(0.001, lambda: {}["lost"])
rclpy.spin(node)
""",
    )
    done = run("a.py")
    assert done.returncode == 1
    assert "holozen" not in done.stderr
    assert done.stderr.splitlines()[-1] == "KeyError: 'lost'"
    assert done.stderr.count("  File ") == 2


def test_frames_of_pythons_own_import_and_contexts_are_left_out(
    run: Run, write: Write, my_bot: Path
) -> None:
    write("src/my_bot/setup.py", "setup(entry_points={'console_scripts': ['b = my_bot.b:main']})")
    write("src/my_bot/my_bot/__init__.py")
    write("src/my_bot/my_bot/b.py", "import rclpy\nrclpy.init()\nrclpy.spin(rclpy.node.Node)")
    done = run("my_bot", "b")
    assert done.stderr.endswith("TypeError: pass a node, such as Node(), not the class\n")
    assert done.stderr.count("  File ") == 1


def test_a_name_that_is_not_there_is_reported_in_the_users_traceback(
    run: Run, write: Write
) -> None:
    write("a.py", "from geometry_msgs.msg import Twost\n")
    done = run("a.py")
    assert "extensions/ros" not in done.stderr
    assert "Twist" in done.stderr.splitlines()[-1]


def test_what_is_not_there_is_one_line(refuse: Run, write: Write, my_bot: Path) -> None:
    for words, message in [
        (["controller"], "controller does not exist (did you mean 'controller.py'?)"),
        (["controller.pyy"], "controller.pyy does not exist (did you mean 'controller.py'?)"),
        (["q.py"], "q.py does not exist; Python files in that folder: controller.py"),
        (
            ["scripts/b.py"],
            "scripts/b.py does not exist, and there are no Python files in that folder",
        ),
        (["my_boot", "a.py"], "no package 'my_boot' around "),
        (["my_bot", "c.py"], "package 'my_bot' has no executable 'c.py'"),
        (["my_bot"], "give an executable; executables in "),
    ]:
        write("controller.py")
        done = refuse(*words)
        assert (done.returncode, done.stdout, done.stderr.count("\n")) == (1, "", 1)
        assert message in done.stderr
        assert done.stderr.startswith("holozen run: ")


def test_a_flag_of_ours_behind_the_script_is_checked_unless_the_script_has_it(
    run: Run, refuse: Run, write: Write
) -> None:
    write("a.py", "import sys; print(sys.argv[1:])")
    for value in ("hb", "hb=/nope"):
        done = refuse("a.py", "--package", value)
        assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
        assert done.stderr.startswith(f"holozen run: argument --package: '{value}'")
    write("b.py", "import sys; print(sys.argv[1:])  # --package")
    assert run("b.py", "--package", "hb").stdout == "['--package', 'hb']\n"


def test_a_parameter_among_the_scripts_own_words_is_reported(run: Run, write: Write) -> None:
    write("a.py", "import sys; print(sys.argv[1:])")
    write("b.py", "import sys; print(':=')")
    done = run("a.py", "-p", "kp:=2.0")
    assert done.stdout == "['-p', 'kp:=2.0']\n"
    assert done.stderr.startswith(
        "holozen run: 'kp:=2.0' is an argument of the script; for ROS write --ros-args -p kp:="
    )
    for words in (["a.py", "--ros-args", "-p", "kp:=2.0"], ["b.py", "kp:=2.0"], ["a.py", "kp=2"]):
        assert run(*words).stderr == ""


def test_a_module_that_is_not_here_is_reported_with_what_to_do(run: Run, write: Write) -> None:
    for name, hint in [
        ("nav2_common.launch", "there is no Nav2 here"),
        ("somebodys", "of a package of yours give the folder: --package somebodys=DIR"),
    ]:
        write("a.py", f"import {name}")
        assert hint in run("a.py").stderr.splitlines()[-1]


def test_where_ros_is_sourced_it_refuses_unless_forced(run: Run, write: Write) -> None:
    write("a.py", "import rclpy; print(rclpy.init.__module__)")
    done = run("a.py", ROS_DISTRO="humble")
    message = "ROS is sourced in this terminal (ROS_DISTRO=humble)"
    assert (
        done.stderr
        == f"holozen run: {message}: start the script with ROS's own `ros2 run`, or over Zenoh "
        "with --force\n"
    )
    assert done.returncode == 1
    assert run("a.py", flags=("--force",), ROS_DISTRO="humble").stdout.startswith("holozen.")


def test_where_ros_can_be_imported_it_refuses_unless_forced(
    run: Run, write: Write, home: Path
) -> None:
    write("a.py", "import rclpy; print(rclpy.init.__module__)")
    write("ros/rclpy/__init__.py", "init = 7")
    path = f"{REPO}{os.pathsep}{home / 'ros'}"
    done = run("a.py", PYTHONPATH=path)
    assert "ROS's own rclpy can be imported here (" in done.stderr
    assert done.returncode == 1
    assert run("a.py", flags=("--force",), PYTHONPATH=path).stdout.startswith("holozen.")


def test_under_python_alone_it_fails_as_ever(write: Write) -> None:
    path = write("a.py", "import rclpy")
    done = subprocess.run([sys.executable, str(path)], capture_output=True, text=True, timeout=60)
    assert done.stderr.splitlines()[-1] == "ModuleNotFoundError: No module named 'rclpy'"


def test_the_connection_is_that_of_the_flags(run: Run, write: Write, wire: Wire) -> None:
    write(
        "a.py",
        "from holozen.ros.rclpy import context; print(context.connection.connect, "
        "context.connection.wire)",
    )
    assert run("a.py", flags=("--wire", "cdr")).stdout == f"('{wire.endpoint}',) cdr\n"


def test_our_flags_behind_the_script_are_ours_unless_the_script_has_them(
    run: Run, write: Write, home: Path
) -> None:
    write("far/elsewhere/msg/Shape.msg", "string name\n")
    package = f"elsewhere={home}/far/elsewhere"
    imports = "import sys\nfrom holozen.ros.rclpy import context\nfrom elsewhere.msg import Shape\n"
    write("a.py", f"{imports}print(sys.argv[1:], context.connection.mode, context.connection.wire)")
    done = run(
        "a.py",
        "x",
        "--package",
        package,
        "--wire=cdr",
        "--mode",
        "fast",
        "--ros-args",
        "--wire",
        "json",
    )
    assert (done.stdout, done.stderr) == (
        "['x', '--mode', 'fast', '--ros-args', '--wire', 'json'] peer cdr\n",
        "",
    )
    write("b.py", f"{imports}print(sys.argv[1:], 'has --wire', context.connection.wire)")
    assert (
        run("b.py", "--wire", "cdr", "--package", package).stdout
        == "['--wire', 'cdr'] has --wire json\n"
    )


def test_a_package_three_folders_below_the_working_one_is_found(run: Run, write: Write) -> None:
    write("examples/lesson/deep_bot/package.xml", "<package><name>deep_bot</name></package>")
    write("examples/lesson/deep_bot/scripts/a.py", "print('found')")
    write("build/lesson/deep_bot/package.xml", "<package><name>deep_bot</name></package>")
    assert run("deep_bot", "a").stdout == "found\n"
    write("examples/lesson/COLCON_IGNORE")
    assert "no package 'deep_bot'" in run("deep_bot", "a").stderr


def test_a_srv_of_the_script_s_own_package_is_there(run: Run, write: Write, my_bot: Path) -> None:
    write("src/my_bot/srv/NextGoal.srv", "int32 request_goal\n---\nfloat64 x_goal\n")
    path = write(
        "src/my_bot/scripts/a.py",
        "from my_bot.srv import NextGoal; print(NextGoal.Response(x_goal=1.5))",
    )
    assert run(str(path)).stdout == "my_bot.srv.NextGoal_Response(x_goal=1.5)\n"


@pytest.mark.parametrize("init", ["", "import rclpy; rclpy.init(); node = rclpy.create_node('a')"])
def test_what_was_written_is_there_at_the_end(
    run: Run, write: Write, home: Path, init: str
) -> None:
    write(
        "a.py",
        f"""
import atexit, gzip, sys, threading
{init}
log, zipped, raw = open("log.csv", "w"), gzip.open("log.gz", "wt"), open("log.bin", "wb")
log.write("1, 2"); zipped.write("3, 4"); raw.write(b"5")
threading.Timer(0.05, print, ["a thread"], dict(end=" ")).start()
atexit.register(lambda: log.write(", 9") and print("what was due", end=""))
""",
    )
    done = run("a.py", is_new=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "a thread what was due", "")
    assert (home / "log.csv").read_text() == "1, 2, 9"
    assert gzip.decompress((home / "log.gz").read_bytes()) == b"3, 4"
    assert (home / "log.bin").read_bytes() == b"5"


THREAD = """
import rclpy, threading, time
rclpy.init()
node = rclpy.create_node("a")
thread = threading.Thread(target=rclpy.spin, args=(node,), daemon=True)
thread.start()
try:
    print("spins")
    thread.join()
except KeyboardInterrupt:
    node.destroy_node()
    rclpy.shutdown()
"""


def test_a_thread_that_spins_ends_without_a_word(wire: Wire, write: Write) -> None:
    line = [sys.executable, "-u", "-m", "holozen", "run", *wire.flags, str(write("a.py", THREAD))]
    with Process(line, env=environment()) as process:
        process.wait_for_line("spins")
        process.signal(signal.SIGINT)
        assert (process.wait(), process.err) == (0, "")


def test_an_error_in_a_thread_is_reported_with_the_users_frames(run: Run, write: Write) -> None:
    write(
        "a.py",
        """
import rclpy, threading
rclpy.init()
node = rclpy.create_node("a")
node.create_timer(0.001, lambda: {}["lost"])
thread = threading.Thread(target=lambda: rclpy.spin(node))
thread.start()
""",
    )
    done = run("a.py")
    assert done.stderr.startswith("Exception in thread Thread-")
    assert done.stderr.splitlines()[-1] == "KeyError: 'lost'"
    assert "holozen/" not in done.stderr
    assert done.stderr.count("a.py") == 2


def test_an_error_of_ours_is_called_as_in_ros(run: Run, write: Write) -> None:
    for line, message in [
        (
            "rclpy.get_default_context().interrupt(); rclpy.spin_once(node)",
            "rclpy.executors.ExternalShutdownException: ",
        ),
        ("rclpy.shutdown(); rclpy.create_node('b')", "rclpy.exceptions.NotInitializedException: "),
        ("import tf2_ros; raise tf2_ros.LookupException('no')", "tf2_ros.LookupException: no"),
        ("from holozen.messages.codec import CodecError; raise CodecError('no')", "CodecError: no"),
    ]:
        write("a.py", f"import rclpy\nrclpy.init()\nnode = rclpy.create_node('a')\n{line}\n")
        done = run("a.py")
        assert done.returncode == 1
        assert done.stderr.splitlines()[-1].startswith(message)
