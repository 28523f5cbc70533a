"""A context begins once and ends once, and calls its shutdown callbacks."""

import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from holozen.messages import Twist
from holozen.ros.rclpy.context import Context, get_default_context
from holozen.ros.rclpy.exceptions import RCLError
from holozen.testing import Process, Wire, wait_for


class Open:
    """Something that counts how often it is closed."""

    def __init__(self) -> None:
        self.closed = 0

    def close(self) -> None:
        self.closed += 1


def test_it_begins_once() -> None:
    context = Context()
    assert not context.ok()
    context.init([])
    assert context.ok()
    with pytest.raises(
        RuntimeError, match=r"^Context\.init\(\) must only be called once; call rclpy\.shutdown\(\)"
    ):
        context.init([])
    context.shutdown()
    with pytest.raises(RuntimeError):
        context.init([])


def test_it_ends_once_and_not_before_it_began() -> None:
    context = Context()
    with pytest.raises(RuntimeError, match="must be initialized before it can be shutdown"):
        context.shutdown()
    context.try_shutdown()
    context.init([])
    context.shutdown()
    assert not context.ok()
    with pytest.raises(RCLError, match="the context was shut down already"):
        context.shutdown()
    context.try_shutdown()


@pytest.mark.parametrize("end", [Context.shutdown, Context.try_shutdown, Context.interrupt])
def test_shutdown_callbacks_run_once(end: Callable[[Context], None]) -> None:
    context, called = Context(), list[str]()

    class Owner:
        def on_shutdown(self) -> None:
            called.append("method")

    owner, forgotten = Owner(), Owner()
    context.init([])
    context.on_shutdown(owner.on_shutdown)
    context.on_shutdown(forgotten.on_shutdown)
    context.on_shutdown(lambda: called.append("function"))
    del forgotten
    end(context)
    wait_for(lambda: len(called) == 2)
    context.try_shutdown()
    assert called == ["method", "function"]
    context.on_shutdown(lambda: called.append("late"))
    assert called[-1] == "late"


def test_what_is_open_is_closed_at_the_end_but_not_by_a_signal() -> None:
    context, opened, closed = Context(), [Open(), Open(), Open()], Open()
    context.init([])
    for one in [*opened, closed]:
        context.opened(one)
    context.closed(closed)
    context.interrupt()
    assert [one.closed for one in opened] == [0, 0, 0]
    context.shutdown()  # welcome after a signal
    context.shutdown()
    assert [one.closed for one in [*opened, closed]] == [1, 1, 1, 0]


def test_an_end_right_after_a_signal_is_welcome(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("_thread.start_new_thread", lambda *_: None)  # it has not run yet
    context = Context()
    context.init([])
    context.interrupt()
    context.shutdown()
    assert not context.ok()


def test_a_block_begins_and_ends_it() -> None:
    with Context() as context:
        assert context.ok()
    assert not context.ok()
    with Context() as context:
        context.shutdown()


def test_a_domain_id_is_that_of_its_nodes() -> None:
    context = Context()
    context.init([], domain_id=7)
    context.shutdown()
    assert context.get_domain_id() == 7
    assert context.connection.address == "tcp/127.0.0.1:7517"
    with pytest.raises(RuntimeError, match="domain_id=233: use a number from 0 to 232"):
        Context().init([], domain_id=233)


def test_the_default_context_is_another_after_its_end() -> None:
    first: Any = get_default_context()
    assert get_default_context() is first
    assert get_default_context(shutting_down=True) is first
    assert get_default_context() is not first


START = """
import rclpy, sys, threading, time
from geometry_msgs.msg import Twist
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.wait_for_message import wait_for_message
from std_srvs.srv import Trigger
rclpy.init()
node = rclpy.create_node("script")
pub = node.create_publisher(Twist, "cmd_vel", 1)
node.create_subscription(Twist, "odom", print, 1)
service = node.create_service(Trigger, "mine", lambda _, response: response)
def up(): print("up", flush=True)
timer = node.create_timer(0.01, up)
"""
SPIN = "rclpy.spin(node)"
POLITE = """
import rclpy.context
rclpy.context.GRACE = 1000.0  # a busy machine may take long to stop
try:
    rclpy.spin(node)
except (KeyboardInterrupt, ExternalShutdownException):
    pub.publish(Twist())
    print("stopped", flush=True)
finally:
    node.destroy_node()
    rclpy.shutdown()
"""
LOOP = "up()\nwhile True:\n    pub.publish(Twist())\n    time.sleep(0.01)"
OK = "up()\nwhile rclpy.ok():\n    time.sleep(0.01)\nrclpy.try_shutdown()"
RATE = """
threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start()
rate = node.create_rate(50)
while rclpy.ok():
    rate.sleep()
"""
THREAD = "threading.Thread(target=rclpy.spin, args=(node,)).start()"
# What the main thread does not see stands for what comes just before it waits.
DEAF = """
import signal
def spin():
    up()
    rclpy.spin(node)
thread = threading.Thread(target=spin)
signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
thread.start()
thread.join()
"""
PENDING = """
future = node.create_client(Trigger, "nobody").call_async(Trigger.Request())
node.create_client(Trigger, "mine").call_async(Trigger.Request())
rclpy.spin_until_future_complete(node, future)
"""
CALL = "up()\nnode.create_client(Trigger, 'nobody').call(Trigger.Request())"
WAITS = """
from functools import partial
from tf2_ros import Buffer
client, long = node.create_client(Trigger, "nobody"), rclpy.duration.Duration(seconds=1000)
def forever(look):
    while not look():
        time.sleep(0.01)
def wait(name, call):
    try:
        call()
    except ExternalShutdownException:
        ended.append(name)
ended = []
calls = {
    "service": client.wait_for_service, "message": partial(wait_for_message, Twist, node, "x"),
    "reader": partial(forever, pub.get_subscription_count),
    "writer": partial(forever, partial(node.count_publishers, "x")),
    "node": partial(node.wait_for_node, "nobody", 1000.0),
    "frame": partial(Buffer().can_transform, "map", "odom", rclpy.time.Time(), timeout=long),
}
threads = [threading.Thread(target=wait, args=item) for item in calls.items()]
for thread in threads:
    thread.start()
up()
for thread in threads:
    thread.join()
print(*sorted(ended))
"""
MANY = """
executor = MultiThreadedExecutor(4)
executor.add_node(node)
def block():
    blocker.cancel()
    time.sleep(1000)
blocker = node.create_timer(0, block, callback_group=ReentrantCallbackGroup())
executor.spin()
"""
HALF_STARTED = """
import linecache
def interrupt(frame, event, _):  # as Ctrl-C does at this moment
    here = linecache.getline(frame.f_code.co_filename, frame.f_lineno)
    if frame.f_code is threading.Thread.start.__code__ and "_start_" in here and "_thread(" in here:
        raise KeyboardInterrupt
    return interrupt
sys.settrace(interrupt)
threading.Thread(target=print).start()
"""
NODES = "nodes = [rclpy.create_node(f'node{i}') for i in range(5)]\nrclpy.spin(node)"
EXTERNAL = "ExternalShutdownException: rclpy was shut down, by a signal or from elsewhere"
CASES = {
    "spin, SIGINT": (SPIN, signal.SIGINT, 130, ""),
    "spin, SIGTERM": (SPIN, signal.SIGTERM, 1, EXTERNAL),
    "polite, SIGINT": (POLITE, signal.SIGINT, 0, ""),
    "polite, SIGTERM": (POLITE, signal.SIGTERM, 0, ""),
    "publish for ever, SIGTERM": (LOOP, signal.SIGTERM, 1, EXTERNAL),
    "while ok, SIGTERM": (OK, signal.SIGTERM, 0, ""),
    "rate, SIGINT": (RATE, signal.SIGINT, 130, ""),
    "a thread spins, SIGINT": (THREAD, signal.SIGINT, 130, ""),
    "a thread spins, SIGTERM that the main thread does not see": (DEAF, signal.SIGTERM, 0, ""),
    "calls wait, SIGINT": (PENDING, signal.SIGINT, 130, ""),
    "a call, SIGINT": (CALL, signal.SIGINT, 130, ""),
    "many threads, SIGINT": (MANY, signal.SIGINT, 130, ""),
    "many nodes, SIGINT": (NODES, signal.SIGINT, 130, ""),
}


Script = Callable[[str], Process]


@pytest.fixture
def script(wire: Wire, tmp_path: Path) -> Script:
    """`with script(text) as process`: a script that begins as all here do, and goes on with a
    text.
    """

    def start(text: str) -> Process:
        path = tmp_path / "script.py"
        path.write_text(START + text)
        return wire.start("run", str(path))

    return start


@pytest.mark.parametrize("case", CASES)
def test_a_signal_ends_it(script: Script, case: str) -> None:
    text, number, code, message = CASES[case]
    with script(text) as process:
        process.wait_for_line("up")
        process.signal(number)
        assert process.wait() == code, process.err
        assert message in process.err if message else not process.err
        assert "Fatal Python error" not in process.err
        assert ("stopped" in process.out) == (text == POLITE)


def test_a_signal_ends_every_wait(script: Script) -> None:
    with script(WAITS) as process:
        process.wait_for_line("up")
        assert process.terminate() == 0, process.err
        assert not process.err
        assert process.out.splitlines()[-1] == "frame message node reader service writer"


@pytest.mark.parametrize(
    ("text", "code", "message"),
    [
        ("pub.publish(Twist())", 0, ""),
        ("sys.exit(3)", 3, ""),
        ("node.create_timer(0.01, lambda: sys.exit(4))\nrclpy.spin(node)", 4, ""),
        (
            "def mine(): 1 / 0\nnode.create_timer(0.01, mine)\nrclpy.spin(node)",
            1,
            "in mine\n    def mine(): 1 / 0",
        ),
        ("node.create_timer(0.1, rclpy.shutdown)\nrclpy.spin(node)", 0, ""),
        (
            "def elsewhere(): timer.cancel(), threading.Thread(target=rclpy.shutdown).start()\n"
            "timer = node.create_timer(0.01, elsewhere)\nrclpy.spin(node)",
            0,
            "",
        ),
        ("node.create_client(Trigger, 'nobody').call_async(Trigger.Request())", 0, ""),
        ("threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start()\nup()", 0, None),
        (HALF_STARTED, 130, ""),
    ],
)
def test_it_ends_by_itself(script: Script, text: str, code: int, message: str | None) -> None:
    with script(text) as process:
        assert process.wait() == code, process.err
        assert message is None or (message in process.err if message else not process.err)
        assert "Fatal Python error" not in process.err


def test_a_script_that_never_spins_publishes_and_leaves(wire: Wire, script: Script) -> None:
    bus = wire.bus()
    commands, graph = bus.subscribe("cmd_vel", Twist), bus.graph()
    with script("while not pub.get_subscription_count(): pass\npub.publish(Twist())") as process:
        assert commands.recv().source.startswith("script@")
        wait_for(lambda: any(node.source.startswith("script@") for node in graph.left()))
        assert process.wait() == 0
