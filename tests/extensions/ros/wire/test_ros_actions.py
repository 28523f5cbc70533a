"""Action servers and clients as ROS's tutorials write them, in processes, and `holozen action` with
them.
"""

import json
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from holozen.testing import Process, Wire, wait_for
from tests.integration.conftest import Verb

SERVER = """
import time

import rclpy
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node

from example_interfaces.action import Fibonacci


class FibonacciActionServer(Node):

    def __init__(self):
        super().__init__('fibonacci_action_server')
        self._action_server = ActionServer(
            self,
            Fibonacci,
            'fibonacci',
            execute_callback=self.execute_callback,
            callback_group=ReentrantCallbackGroup(),
            goal_callback=self.goal_callback,
            cancel_callback=self.cancel_callback)
        self.get_logger().info('ready')

    def goal_callback(self, goal_request):
        return GoalResponse.REJECT if goal_request.order > 10000 else GoalResponse.ACCEPT

    def cancel_callback(self, goal_handle):
        return CancelResponse.REJECT if goal_handle.request.order == 7 else CancelResponse.ACCEPT

    def execute_callback(self, goal_handle):
        if goal_handle.request.order < 0:
            raise ValueError('negative order')
        feedback_msg = Fibonacci.Feedback()
        feedback_msg.sequence = [0, 1]
        for i in range(1, goal_handle.request.order):
            if goal_handle.is_cancel_requested:
                goal_handle.canceled()
                return Fibonacci.Result(sequence=feedback_msg.sequence)
            if i < 40:
                feedback_msg.sequence.append(feedback_msg.sequence[i] + feedback_msg.sequence[i - 1])
            goal_handle.publish_feedback(feedback_msg)
            time.sleep(0.05)
        if goal_handle.request.order == 0:
            return Fibonacci.Result()  # and the goal's state is not set
        goal_handle.succeed()
        result = Fibonacci.Result()
        result.sequence = feedback_msg.sequence
        return result


def main(args=None):
    rclpy.init(args=args)
    rclpy.spin(FibonacciActionServer(), executor=MultiThreadedExecutor())


if __name__ == '__main__':
    main()
"""  # noqa: E501

CLIENT = """
import sys
import time

import rclpy
from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.node import Node

from example_interfaces.action import Fibonacci


class FibonacciActionClient(Node):

    def __init__(self):
        super().__init__('fibonacci_action_client')
        self._action_client = ActionClient(self, Fibonacci, 'fibonacci')
        self._awaited = 1 + ('cancel' in sys.argv)  # replies

    def ended(self):
        self._awaited -= 1
        if not self._awaited:
            rclpy.shutdown()

    def send_goal(self, order):
        goal_msg = Fibonacci.Goal()
        goal_msg.order = order
        self._action_client.wait_for_server()
        self._send_goal_future = self._action_client.send_goal_async(
            goal_msg, feedback_callback=self.feedback_callback)
        if sys.argv[2:3] == ['late']:
            time.sleep(0.5)
        self._send_goal_future.add_done_callback(self.goal_response_callback)

    def goal_response_callback(self, future):
        self._goal_handle = future.result()
        if not self._goal_handle.accepted:
            print('rejected')
            rclpy.shutdown()
            return
        print('accepted')
        self._get_result_future = self._goal_handle.get_result_async()
        self._get_result_future.add_done_callback(self.get_result_callback)

    def get_result_callback(self, future):
        result = future.result().result
        print('result', future.result().status, list(result.sequence))
        self.ended()

    def cancel_callback(self, future):
        print('cancel', len(future.result().goals_canceling))
        self.ended()

    def feedback_callback(self, feedback_msg):
        print('feedback', list(feedback_msg.feedback.sequence), flush=True)
        if sys.argv[2:3] == ['cancel']:
            sys.argv.remove('cancel')
            self._goal_handle.cancel_goal_async().add_done_callback(self.cancel_callback)


def main(args=None):
    rclpy.init(args=args)
    action_client = FibonacciActionClient()
    action_client.send_goal(int(sys.argv[1]))
    rclpy.spin(action_client)


if __name__ == '__main__':
    main()
"""


@pytest.fixture(scope="module")
def scripts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scripts")
    (folder / "server.py").write_text(SERVER)
    (folder / "client.py").write_text(CLIENT)
    return folder


def serve(wire: Wire, scripts: Path) -> Process:
    server = wire.start("run", str(scripts / "server.py"))
    server.wait_for_line("ready")
    return server


@pytest.fixture(scope="module")
def town(scripts: Path) -> Iterator[Wire]:
    """A wire with a server."""
    with Wire() as wire:
        serve(wire, scripts)
        yield wire


def client(wire: Wire, scripts: Path, *words: str) -> Process:
    return wire.start("run", str(scripts / "client.py"), *words)


def printed(process: Process) -> list[str]:
    assert process.wait() == 0, process.err
    return process.out.splitlines()


PROGRESS = ["feedback [0, 1, 1]", "feedback [0, 1, 1, 2]", "feedback [0, 1, 1, 2, 3]"]


def test_a_goal_is_accepted_reports_its_progress_and_succeeds(town: Wire, scripts: Path) -> None:
    accepted, *progress, result = printed(client(town, scripts, "4"))
    assert (accepted, result) == ("accepted", "result 4 [0, 1, 1, 2, 3]")
    # it comes by a topic, so the reply may overtake the last of it
    assert progress in (PROGRESS, PROGRESS[:-1])


def test_progress_waits_for_the_callback_of_the_answer_however_late_it_is_added(
    town: Wire, scripts: Path
) -> None:
    first, second, *_ = printed(client(town, scripts, "4", "late"))
    assert (first, second) == ("accepted", "feedback [0, 1, 1]")


def test_a_goal_ends_as_its_server_says(town: Wire, scripts: Path) -> None:
    for words, lines in [
        (("20000",), ["rejected"]),
        (("-1",), ["accepted", "result 6 []"]),  # its callback raises an exception
        (("0",), ["accepted", "result 6 []"]),  # its callback sets no state
        (("7", "cancel"), ["cancel 0", "result 4 [0, 1, 1, 2, 3, 5, 8, 13]"]),  # which is refused
    ]:
        found = printed(client(town, scripts, *words))
        last = [line for line in found if not line.startswith("feedback")][-len(lines) :]
        # the replies to a goal and to its cancellation come in any order
        assert sorted(last) == sorted(lines)


def test_what_the_callback_of_a_goal_raises_is_shown_without_frames_of_ours(
    wire: Wire, scripts: Path
) -> None:
    server = serve(wire, scripts)
    assert printed(client(wire, scripts, "-1"))[-1] == "result 6 []"
    wait_for(lambda: server.err.endswith("ValueError: negative order\n"))
    assert server.err.partition("Traceback")[2].count("  File ") == 1


def test_a_goal_is_cancelled(town: Wire, scripts: Path) -> None:
    lines = printed(client(town, scripts, "9999", "cancel"))
    assert "cancel 1" in lines and any(line.startswith("result 5 [0, 1, 1") for line in lines)


def test_a_server_that_dies_ends_its_goals(wire: Wire, scripts: Path) -> None:
    server = serve(wire, scripts)
    waiting = client(wire, scripts, "9999")
    verb = wire.start("action", "send_goal", "fibonacci", "{order: 9999}", "--feedback")
    for process in (waiting, verb):
        process.wait_for_line("eedback")
    server.kill()
    assert waiting.wait() == 1
    assert "the server of 'fibonacci' has left before the end of the goal" in waiting.err
    assert verb.wait() == 1
    assert verb.err.splitlines()[-1].endswith(
        "the server of 'fibonacci' has left before the end of the goal"
    )


def test_the_verbs_list_it_and_send_it_goals(verb: Verb, town: Wire) -> None:
    assert (
        "fibonacci [example_interfaces/action/Fibonacci]"
        in verb(town, "action", "list", "-t").stdout
    )
    shown = json.loads(verb(town, "action", "info", "fibonacci", "--json").stdout)
    assert [one["node"] for one in shown["servers"]] == ["fibonacci_action_server"]
    done = verb(
        town,
        "action",
        "send_goal",
        "/fibonacci",
        "example_interfaces/Fibonacci",
        "{order: 3}",
        "-f",
        "--json",
    )
    first, *progress, last = map(json.loads, done.stdout.splitlines())
    assert first["accepted"]
    assert progress == [
        {"feedback": {"sequence": [0, 1, 1]}},
        {"feedback": {"sequence": [0, 1, 1, 2]}},
    ]
    assert last == {"status": "SUCCEEDED", "result": {"sequence": [0, 1, 1, 2]}}
    assert done.returncode == 0
    for goal, reason in (
        ("{order: 20000}", "the goal was rejected"),
        ("{ordr: 3}", "no field 'ordr' (did you mean 'order'?)"),
        ("{order: x}", "'x' is not a valid int32"),
    ):
        refused = verb(town, "action", "send_goal", "fibonacci", goal)
        assert refused.returncode == 1
        assert reason in refused.stderr
        assert len(refused.stderr.splitlines()) == 1
    other = verb(town, "action", "send_goal", "fibonacci", "nav2_msgs/NavigateToPose", "{}")
    assert (
        "its type is example_interfaces/action/Fibonacci, not nav2_msgs/action/NavigateToPose"
        in other.stderr
    )


TURNER = """
import rclpy
from rclpy.action import ActionServer
from rclpy.node import Node
from turner.action import Turn


class Turner(Node):
    def __init__(self):
        super().__init__('turner')
        self.server = ActionServer(self, Turn, 'turn', self.execute)
        print('ready', flush=True)

    async def execute(self, goal_handle):
        goal_handle.publish_feedback(Turn.Feedback(left=goal_handle.request.angle / 2))
        goal_handle.succeed()
        result = Turn.Result(done=True)
        result.at.x = goal_handle.request.angle
        return result


rclpy.init()
rclpy.spin(Turner())
"""


@pytest.mark.parametrize("form", ["json", "cdr"])
def test_an_action_of_a_package_is_known_to_who_does_not_have_it(
    verb: Verb, form: str, wire: Wire, tmp_path: Path
) -> None:
    files = {
        "package.xml": "<package><name>turner</name></package>",
        "action/Turn.action": "float64 angle\n---\nbool done\ngeometry_msgs/Point "
        "at\n---\nfloat64 left\n",
        "scripts/turn.py": TURNER,
    }
    for name, text in files.items():
        (tmp_path / "turner" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "turner" / name).write_text(text)
    wire.start(
        "run", "--wire", form, str(tmp_path / "turner" / "scripts" / "turn.py")
    ).wait_for_line("ready")
    done = verb(wire, "action", "send_goal", "turn", "{angle: 1.5}", "--feedback", "--json")
    assert [json.loads(line) for line in done.stdout.splitlines()[1:]] == [
        {"feedback": {"left": 0.75}},
        {"status": "SUCCEEDED", "result": {"done": True, "at": {"x": 1.5, "y": 0.0, "z": 0.0}}},
    ], done.stderr
    assert (
        "(did you mean 'angle'?)" in verb(wire, "action", "send_goal", "turn", "{angl: 1.5}").stderr
    )


def test_a_signal_to_the_verb_cancels_its_goal(town: Wire) -> None:
    for number in [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]:
        verb = town.start("action", "send_goal", "fibonacci", "{order: 9999}", "--feedback")
        verb.wait_for_line("Feedback")
        verb.signal(number)
        assert verb.wait() == 130
        assert verb.out.splitlines()[-1] == "Goal finished with status: CANCELED"
