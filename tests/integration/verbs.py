"""What every verb of the command line is called with, for test_every_verb.py. A new verb needs a
row.
"""

from typing import NamedTuple

TWIST, ODOM_X = "geometry_msgs/msg/Twist", "odom.pose.pose.position.x"


class Endless(NamedTuple):
    """Words with which a verb runs until Ctrl-C, what (a regular expression) it writes then, and
    its exit code.
    """

    words: str
    begun: str
    code: int = 0


class Row(NamedTuple):
    """How a verb is tried. In words, {n} is a text of each kind of try and {id} of each, {tmp} a
    folder, and {bot}, {ball}, {odd}, {bag} and {yaml} are files.
    """

    # words with which it does its work beside a sim, and ends; None for one that lasts
    live: str | None = None
    code: int = 0  # that it ends with then
    bus: bool = True  # whether it goes on the wire
    # words for the keys of a plain Zenoh session, and a part of what it prints
    foreign: tuple[str, str] | None = None
    # words where no nodes are; the exit code, and a part of the one line
    silent: tuple[str, int, str] | None = None
    # words that are wrong, and the same; without, only flags can be
    wrong: tuple[str, int, str] | None = None
    endless: Endless | None = None


def row(live: str | None, wrong: tuple[str, int, str] | None = None, **more: object) -> Row:
    return Row(live, wrong=wrong)._replace(**more)  # type: ignore[arg-type]


NO_NODE = (
    1,
    "there is no node 'sim' with parameters; no node has any; `holozen up` starts a robot",
)
NO_SIM = (1, "no sim answered within 3 s: no nodes found at ")
NO_KEY = (1, "unknown key 'odom': no nodes found at ")
NO_SUCH_KEY = ("odmo", 1, "unknown key 'odmo' (did you mean 'odom'?)")
NO_FILE = (1, "No such file or directory")
NOTHING = (1, "no messages on odom within 0.2 s; no nodes found at ")
TYPO = (1, "did you mean 'geometry_msgs/msg/Twist'?")
STOPPED = ("--timeout 0.2", 1, "; `holozen list` shows what a sim has, --connect where to look")
NOT_THERE = ("Nobody --timeout 30", 1, "there is no robot 'Nobody'; there are: ")
PUB = """a/heard std_msgs/msg/String '{{"data": "x"}}' --once"""
PLOT = row(
    f"{ODOM_X} --once -w 2",
    ("odom", 2, "'odom': write KEY.FIELD"),
    foreign=("a/json.speed --once -w 2", "a/json.speed: 1.5"),
    silent=("odom.x --once -w 0.2", 1, "no messages on odom; no nodes found at "),
    endless=Endless(ODOM_X, r"x: -?\d"),
)
RECORD = row(
    "odom -o {tmp}/{id} --max-duration 2",
    ("-o {tmp}/{id}", 2, "name the keys to record, or use -a for all"),
    foreign=("a/json a/bytes a/cdr -o {tmp}/{id} --max-duration 2", "messages, "),
    silent=("odom -o {tmp}/{id} --max-duration 0.2", 1, "no messages arrived, so no file is kept"),
    endless=Endless("odom -o {tmp}/{id}", "messages,"),
)
REPLAY = row(
    "{bag} --remap odom:=old/{id}",
    ("{tmp}/none.mcap", *NO_FILE),
    endless=Endless("{bag} --remap odom:=old/{id} --loop", "space pauses"),
)

VERBS = {
    # test_up.py ends it
    "up": row(None, ("--laps", 2, "--laps: expected one argument")),
    "stop": row("Spare", NOT_THERE, silent=STOPPED),
    "release": row("Free", NOT_THERE, silent=STOPPED),
    "sim": row(
        None,
        ("puase", 2, "no verb 'puase' (did you mean 'pause'?)"),
        endless=Endless("", "listens on"),
    ),
    "sim pause": row(None, ("now", 2, "unexpected argument 'now'"), silent=("", *NO_SIM)),
    "sim play": row("", ("--sped 2", 2, "no flag '--sped'"), silent=("", *NO_SIM)),
    "sim step": row(
        None,
        ("10", 1, "the sim is playing; pause it to step: `holozen sim pause`"),
        silent=("", *NO_SIM),
    ),
    "sim reset": row(
        "--scope time", ("--scope tim", 2, "'tim' (did you mean 'time'?)"), silent=("", *NO_SIM)
    ),
    "teleop": row(None, ("--keys nonsense", 2, "nonsense"), endless=Endless("", "listening")),
    "controller": row(
        None, ("--laps x", 2, "'x': use a whole"), endless=Endless("", "waiting for goal 0")
    ),
    "camera": row(
        None,
        ("--exposures", 2, "--exposures: expected one argument"),
        endless=Endless("", "renders what comes on"),
    ),
    "view": row(
        None, ("--port x", 2, "'x': use a whole"), endless=Endless("--port 0", "http://127.0.0.1:")
    ),
    "pose-service": row(
        None, ("--goals {tmp}/none", *NO_FILE), endless=Endless("", "4 goals from square")
    ),
    "router": row(None, endless=Endless("", "listens at")),
    "ros2": row(
        None,
        ("--ros-domain-id 300", 2, "use a number from 0 to 232"),
        endless=Endless("", "joins ROS 2"),
    ),
    "secure init": row(
        "--secure {tmp}/{id}", ("--days 0", 2, "use a whole number from 1 to 3650"), bus=False
    ),
    "secure add": row(None, ("viewer Bob --secure {tmp}/none", *NO_FILE), bus=False),
    "secure renew": row(None, ("--secure {tmp}/none", *NO_FILE), bus=False),
    "secure revoke": row(None, ("Bob --secure {tmp}/none", *NO_FILE), bus=False),
    "secure page": row(None, ("--secure {tmp}/none", *NO_FILE), bus=False),
    "secure show": row(None, ("--secure {tmp}/none", *NO_FILE), bus=False),
    # what else it does is in tests/extensions/ros
    "run": row(None, ("{tmp}/none.py", 1, "none.py does not exist")),
    "launch": row(None, ("{tmp}/none.launch.py", 1, "does not exist")),
    "spawn": row(
        "{ball} --name New{n} -x {free}", ("{tmp}/none.urdf", *NO_FILE), silent=("{ball}", *NO_SIM)
    ),
    "delete": row(
        "Doomed{n}", ("Nobody", 1, "there is no entity 'Nobody'"), silent=("Fred", *NO_SIM)
    ),
    "list": row("", silent=("", *NO_SIM)),
    "xacro": row(
        "{bot}",
        ("{tmp}/none.xacro", *NO_FILE),
        bus=False,
    ),
    "new robot": row(None, ("Rosie", 2, "'Rosie': use lower-case letters"), bus=False),
    "new controller": row(None, ("2fast", 2, "'2fast': use lower-case letters"), bus=False),
    "new package": row(
        None, ("our-package", 2, "'our-package': use lower-case letters"), bus=False
    ),
    "check": row("{odd}", code=1, bus=False),
    "topic list": row("", silent=("", 0, "no topics: no nodes found at ")),
    "topic info": row("cmd_vel", NO_SUCH_KEY, silent=("odom", *NO_KEY)),
    "topic type": row("odom", NO_SUCH_KEY, silent=("odom", *NO_KEY)),
    "topic find": row(
        "Odometry", ("Odm", 1, "no topic of type 'Odm'"), silent=("Odometry", 1, "types: none")
    ),
    "topic echo": row(
        "odom --once",
        ("odom --type geometry_msgs/msg/Twsit", 2, TYPO[1]),
        silent=("odom --timeout 0.2", *NOTHING),
        endless=Endless("odom", "position:", 130),
    ),
    "topic pub": row(
        PUB,
        (f"odom {TWIST} {{{{}}}}", 1, f"its type is nav_msgs/msg/Odometry, not {TWIST}"),
        silent=(
            "cmd_vel {{}} --once --max-wait 0.2",
            1,
            "no subscribers of cmd_vel; no nodes found at ",
        ),
        endless=Endless("Spare/cmd_vel {{}}", "subscriber"),
    ),
    "topic hz": row(
        "odom --once",
        ("a//b", 1, "holozen topic hz: key 'a//b': "),
        silent=("odom --timeout 0.2", *NOTHING),
        endless=Endless("odom", "average rate: "),
    ),
    "topic bw": row(
        "odom --once",
        ("odom --timeout x", 2, "'x': use a number"),
        silent=("odom --timeout 0.2", *NOTHING),
        endless=Endless("odom", "/s from "),
    ),
    "topic delay": row(
        "odom --once",
        ("cmd_vel_status --timeout 0.2", 1, "messages have no header.stamp"),
        silent=("odom --timeout 0.2", *NOTHING),
        endless=Endless("odom", "average delay: "),
    ),
    "topic plot": PLOT,
    "service list": row("", silent=("", 0, "no services: no nodes found at ")),
    "service type": row(
        "resume", ("resmue", 1, "did you mean 'resume'?"), silent=("odom", *NO_KEY)
    ),
    "service find": row(
        "NextGoal", ("NextGaol", 1, "of type 'NextGaol'"), silent=("x/X", 1, "types: none")
    ),
    "service info": row(
        "resume", ("resmue", 1, "did you mean 'resume'?"), silent=("odom", *NO_KEY)
    ),
    "service call": row(
        "next_goal",
        ("next_goal '{{goal: 1}}'", 1, "no field 'goal' (did you mean 'request_goal'?)"),
        foreign=("a/asked --any", "x: 1"),
        silent=("next_goal --timeout 0.2", 1, "no reply from 'next_goal' within 0.2 s at "),
        endless=Endless("next_goal -r 20", "x_goal", 130),
    ),
    "action list": row("", silent=("", 0, "no actions: no nodes found at ")),
    "action type": row(
        "simulate_steps",
        ("simulate_stps", 1, "did you mean 'simulate_steps'?"),
        silent=("odom", *NO_KEY),
    ),
    "action info": row(
        "simulate_steps",
        ("simulate_stps", 1, "did you mean 'simulate_steps'?"),
        silent=("odom", *NO_KEY),
    ),
    "action send_goal": row(
        None,
        ("simulate_steps '{{step: 1}}'", 1, "no field 'step' (did you mean 'steps'?)"),
        silent=(
            "simulate_steps --timeout 0.2",
            1,
            "no server for simulate_steps answered within 0.2 s at ",
        ),
    ),
    "node list": row("", silent=("", 0, "no nodes found at ")),
    "node info": row(
        "sim",
        ("smi", 1, "unknown node 'smi' (did you mean 'sim'?)"),
        silent=("x", 1, "no nodes found"),
    ),
    "param list": row("", ("smi", 1, "did you mean 'sim'?"), silent=("sim", *NO_NODE)),
    "param get": row(
        "sim max_linear", ("sim max_linaer", 1, "max_linaer"), silent=("sim rate", *NO_NODE)
    ),
    "param set": row(
        "sim max_linear 1.5",
        ("sim max_linear 1e9", 1, "use a number from "),
        silent=("sim rate 1", *NO_NODE),
    ),
    "param describe": row(
        "sim max_linear", ("sim max_linaer", 1, "max_linaer"), silent=("sim rate", *NO_NODE)
    ),
    "param dump": row("sim", ("smi", 1, "did you mean 'sim'?"), silent=("sim", *NO_NODE)),
    "param load": row(
        "sim {yaml}", ("sim {tmp}/none.yaml", *NO_FILE), silent=("sim {yaml}", *NO_NODE)
    ),
    "tf echo": row(
        "odom footprint_link --once",
        ("odom footprint --timeout 0.5", 1, "did you mean 'footprint_link'?"),
        silent=("odom base_link --timeout 0.2", 1, "no transforms on tf; no nodes found at "),
        endless=Endless("odom footprint_link", "- Translation: "),
    ),
    "doctor": row(""),
    "graph": row("", silent=("", 0, "no nodes found at ")),
    "completion": row("bash", ("tcsh", 2, "'tcsh'; there are bash, zsh, fish"), bus=False),
    "interface list": row("", ("--package a=/no/such", 2, "there is no folder"), bus=False),
    "interface show": row(
        "odom", ("geometry_msgs/msg/Twsit", *TYPO), silent=("odom", 1, "'odom' is not a type")
    ),
    "interface proto": row(TWIST, ("geometry_msgs/msg/Twsit", *TYPO), bus=False),
    "record": RECORD,
    "replay": REPLAY,
    "bag info": row("{bag}", ("{tmp}/none.mcap", *NO_FILE), bus=False),
    "bag plot": row("{bag} -o {tmp}/{id}.svg", ("{tmp}/none.mcap", *NO_FILE), bus=False),
    "bag record": RECORD,
    "bag play": REPLAY,
    "plot": PLOT,
    "map": row(
        "--once -w 2", silent=("--once -w 0.2", 1, "no robots found"), endless=Endless("", "bot x ")
    ),
}
