"""A wrong word is one line with the closest right one, and exit code 2."""

from collections.abc import Callable

import pytest

from holozen import cli
from holozen.cli import main
from tests.present import VERBS

Run = Callable[..., tuple[int, str, str]]


def test_a_wrong_word_is_reported_with_the_closest(run: Run) -> None:
    for words, expected in [
        ("topci list", "holozen: no verb 'topci' (did you mean 'topic'?); `holozen --help`"),
        (
            "topic ehco",
            "holozen topic: argument VERB: 'ehco' (did you mean 'echo'?); there are list, info, "
            "type, ",
        ),
        (
            "topic list --shwo",
            "holozen topic list: no flag '--shwo' (did you mean '--show-types'?); see `holozen "
            "topic list ",
        ),
        (
            "sim my.urdf",
            "holozen sim: unexpected argument 'my.urdf'; a robot's file goes after --robot; ",
        ),
        (
            "sim my.world",
            "holozen sim: unexpected argument 'my.world'; a world's file goes after --world; ",
        ),
        (
            "sim --robot a.urdf --name Fred",
            "holozen sim: no flag '--name'; --robot FILE=NAME gives a robot's name; ",
        ),
        (
            "up --name Fred",
            "holozen up: no flag '--name'; --robot FILE=NAME gives a robot's name; ",
        ),
        (
            "sim --gui",
            "holozen sim: no flag '--gui'; no sim has a window; `holozen view` shows it in a "
            "browser; ",
        ),
        (
            "tf echo odom base_link Fred",
            "holozen tf echo: unexpected argument 'Fred'; see `holozen tf echo --help`",
        ),
        ("spawn a.urdf -m Fred", "holozen spawn: no flag '-m' (did you mean '-model'?); "),
        (
            "spawn a.urdf --namespace 1",
            "holozen spawn: argument --namespace/-robot_namespace: robot name '1': use a ",
        ),
        (
            "param set max_linear 2",
            "holozen param set: '2' has no value; write NODE NAME VALUE, or more such pairs; ",
        ),
        ("topic list odom", "holozen topic list: unexpected argument 'odom'; "),
        (
            "topic list --mode pere",
            "holozen topic list: argument --mode: 'pere' (did you mean 'peer'?); there are peer, ",
        ),
        (
            "topic list --connect nonsense",
            "holozen topic list: argument --connect: 'nonsense' is not an endpoint: write ",
        ),
        (
            "topic list --listen tcp/h",
            "holozen topic list: argument --listen: 'tcp/h' has no port from 0 to 65535: ",
        ),
        ("topic echo odom --filter (", "holozen topic echo: filter '(': "),
        (
            "topic echo odom --field a..b",
            "holozen topic echo: 'a..b' is not a field; write names with dots",
        ),
        (
            "topic echo odom --type nav_msgs/msg/Odmetry",
            "holozen topic echo: no type 'nav_msgs/msg/Odmetry' (did you",
        ),
        (
            "service cal x",
            "holozen service: argument VERB: 'cal' (did you mean 'call'?); there are list, type, ",
        ),
        (
            "node lits",
            "holozen node: argument VERB: 'lits' (did you mean 'list'?); there are list, info",
        ),
        (
            "stop --tiemout 3",
            "holozen stop: no flag '--tiemout' (did you mean '--timeout'?); see `holozen stop "
            "--help`",
        ),
        ("spawn a.urdf radius=0.1", "holozen spawn: 'radius=0.1': write radius:=0.1; "),
        (
            "xacro a.xacro radius=0.1",
            "holozen xacro: argument name:=value: 'radius=0.1': write radius:=0.1; ",
        ),
        (
            "check a.urdf b.urdf",
            "holozen check: argument name:=value: 'b.urdf': write name:=value after the one FILE; ",
        ),
        ("launch a.launch.py robot=Rosie", "holozen launch: 'robot=Rosie': write robot:=Rosie; "),
        ("spawn a.urdf --nmae Fred", "holozen spawn: no flag '--nmae' (did you mean '--name'?); "),
        (
            "check --package hb=/nope a.urdf",
            "holozen check: argument --package: 'hb=/nope': there is no folder '/nope'; ",
        ),
        ("sim --wrold x", "holozen sim: no flag '--wrold' (did you mean '--world'?); "),
        ("sim --list", "holozen sim: no flag '--list' (did you mean '--listen'?); "),
        ("topic echo odom --onc", "holozen topic echo: no flag '--onc' (did you mean '--once'?); "),
        (
            "topic pub x {} --rate -3",
            "holozen topic pub: argument -r/--rate: '-3': use a number from 0.01 to 10000 Hz; ",
        ),
        (
            "controller --lapse 3",
            "holozen controller: no flag '--lapse' (did you mean '--laps'?); ",
        ),
        (
            "pose-service --shape sqare",
            "holozen pose-service: argument --shape: 'sqare' (did you mean 'square'?); ",
        ),
        (
            "teleop --mode hlod",
            "holozen teleop: argument --mode: 'hlod' (did you mean 'hold'?); there are hold, "
            "latch, ",
        ),
        (
            "bag plya",
            "holozen bag: argument VERB: 'plya' (did you mean 'play'?); there are info, plot, "
            "record, play",
        ),
        (
            "param get sim --timout 3",
            "holozen param get: no flag '--timout' (did you mean '--timeout'?); ",
        ),
        (
            "interface show x --jsn",
            "holozen interface show: no flag '--jsn' (did you mean '--json'?); ",
        ),
        ("param get sim x y", "holozen param get: unexpected argument 'y'; "),
        ("topic list odom -x", "holozen topic list: no flag '-x'; "),
        (
            "topic echo x --qos-reliability best-effort",
            "holozen topic echo: argument --qos-reliability: 'best-effort' (did",
        ),
        (
            "topic echo x --qos-profile nonsense",
            "holozen topic echo: argument --qos-profile: 'nonsense'; there are ",
        ),
        (
            "topic pub x {} --qos-depth abc",
            "holozen topic pub: argument --qos-depth: 'abc': use a whole number from 0",
        ),
        (
            "topic pub x {} --qos-durability none",
            "holozen topic pub: argument --qos-durability: 'none'; there are ",
        ),
        (
            "topic list --spin-time soon",
            "holozen topic list: argument --spin-time: 'soon': use a number from 0 to ",
        ),
        ("topic echo x --json --csv", "holozen topic echo: give --json or --csv, not both; "),
        ("topic echo x --raw --field a", "holozen topic echo: give --field or --raw, not both; "),
        (
            "topic echo x -f -l 3",
            "holozen topic echo: give --full-length or --truncate-length, not both; ",
        ),
        (
            "bag play x -m a:=b a:=c",
            "holozen bag play: --remap: 'a' is given twice; it is played on one key; ",
        ),
        (
            "replay x --remap a:=b a:=c",
            "holozen replay: --remap: 'a' is given twice; it is played on one key; ",
        ),
        (
            "topic echo x --flow-style",
            "holozen topic echo: no flag '--flow-style'; --json prints each message on one ",
        ),
        (
            "topic echo -n 1 /odom",
            "holozen topic echo: no flag '-n'; --once ends after the first message; ",
        ),
        (
            "ros2 topic list",
            "holozen ros2: this joins ROS 2 nodes; write `holozen topic`; see `holozen ros2 "
            "--help`",
        ),
        ("ros2 pkg create x", "holozen: no verb 'pkg'; `holozen new package` writes one"),
        (
            "sim stop",
            "holozen sim: no verb 'stop'; `holozen sim pause` pauses it, `holozen stop` stops "
            "robots, ",
        ),
        (
            "topic pub cmd_vel [0.2,0,0] [0,0,0]",
            "holozen topic pub: cmd_vel: '[0,0,0]' is one argument too many; ",
        ),
        ("reset", "holozen: no verb 'reset'; write `holozen sim reset`; "),
        (
            "tf_echo odom base_link",
            "holozen: no verb 'tf_echo'; write `holozen tf echo SOURCE TARGET`; ",
        ),
        ("echo odom", "holozen: no verb 'echo'; write `holozen topic echo`; "),
        (
            "bag play x --clock 20",
            "holozen bag play: no flag '--clock'; a bag that has the key clock plays it: ",
        ),
        (
            "bag play x -p",
            "holozen bag play: --start-paused needs a terminal, in which space goes on; ",
        ),
        (
            "bag record -a --topics odom",
            "holozen bag record: give keys, -a or -e, only one of them; ",
        ),
        ("bag record -s sqlite3 -a", "holozen bag record: argument -s: 'sqlite3'; there is mcap; "),
        (
            "record -b 1000 -a",
            "holozen record: no flag '-b'; --max-size MB starts a new file at that size, ",
        ),
        (
            "record -e *odom",
            "holozen record: argument -e/--regex: '*odom' is not a regular expression: nothing to "
            "repeat",
        ),
        ("record -a odom", "holozen record: give keys, -a or -e, only one of them; "),
        (
            "tf view_frames",
            "holozen tf: no verb 'view_frames'; `holozen view` draws the frames; see `holo",
        ),
        (
            "interface package std_msgs",
            "holozen interface: no verb 'package'; write `holozen interface list`; ",
        ),
        ("spawn", "holozen spawn: give the FILE of a robot or object; "),
        (
            "spawn -param robot_description",
            "holozen spawn: no flag '-param'; give the robot's file: holozen spawn ",
        ),
        (
            "completion tcsh",
            "holozen completion: argument shell: 'tcsh'; there are bash, zsh, fish; ",
        ),
    ]:
        if (verb := words.split()[0]) in cli.VERBS and verb not in VERBS:
            continue  # its extension was left out
        code, out, err = run(*words.split())
        assert (code, out) == (2, "")
        assert err.startswith(expected)
        assert err.count("\n") == 1


def test_no_verb_is_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["topic"])
    expected = (
        "holozen topic: the following arguments are required: VERB; see `holozen topic --help`\n"
    )
    assert capsys.readouterr().err == expected
