"""When the controller leaves the robot to others, and when it drives again."""

import itertools
import math
import struct
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from types import SimpleNamespace

import pytest

from holozen.bus import Bus
from holozen.kinematics import to_world
from holozen.limits import STOP, Planar
from holozen.messages import (
    CommandStatus,
    Header,
    Message,
    NextGoalReply,
    NextGoalRequest,
    Odometry,
    Point,
    Pose,
    PoseStamped,
    PoseWithCovariance,
    Quaternion,
    SimulationStatus,
    Time,
    Twist,
    TwistWithCovariance,
)
from holozen.messages import nav2_msgs as nav
from holozen.messages.codec import encode, encoding
from holozen.messages.unique_identifier_msgs import UUID
from holozen.testing import Wire, wait_for
from holozen.transport.actions import State, new_id
from holozen.transport.errors import ServiceError
from holozen.transport.pubsub import Publisher, Subscription
from holozen.wire import ODOM_SILENCE
from services.controller.backlog import HELD_UP, LATE, Backlog
from services.controller.follow import STOP_FOR, Follower
from services.controller.goto import Gains, Leg

OLD = LATE, HELD_UP
"""How refusals of goals end that a busy machine may have held up."""
QUICK = Gains(
    max_speed=2, max_turn=5, max_acceleration=10, max_turn_acceleration=20, linear=3, angular=3
)
MARK = 123.456  # m
STATUS_EVERY = 20  # steps between two statuses of the sim, unless its clock is set back
STEP = 0.01  # s of the robot's clock between two odoms
AHEAD = 0.1  # s of that clock that a robot moves on before it waits for the next command
STALE = 3.0  # s without odom; a busy machine may hold it up for longer than a controller waits
GOALS = [(0.5, 0.0, 1.0), (0.5, 0.5, 0.0)]


class Robot:
    """An ideal robot whose clock runs as fast as its thread does. It is ten times as fast as ours:
    while the robot moves, it stands still where the next command is late.
    """

    def __init__(self, bus: Bus) -> None:
        self.bus, self.moving, self.slips = bus, threading.Event(), threading.Event()
        self.commands: Subscription[Twist] = bus.subscribe("cmd_vel", Twist)
        self.heard: list[Twist] = []
        self.pose = (0.0, 0.0, 0.0)
        self._odom: Publisher[Odometry] = bus.publisher("odom", Odometry)
        self._status: Publisher[CommandStatus] = bus.publisher("cmd_vel_status", CommandStatus)
        self._sim: Publisher[SimulationStatus] = bus.publisher(
            "simulation_status", SimulationStatus
        )
        self._velocity: Planar = STOP
        self._moves_until = 0.0  # s of its clock
        # Set back to 0, it is not soon as late again: a busy machine may look late.
        self.time, self.epoch = 1000.0, 0
        self._steps, self._told = 0, -1  # -1: no epoch was published
        self.resets: deque[Callable[[Robot], None]] = deque()  # to be done in its thread

    def status(self, **fields: object) -> bool:
        """Publish a status that names the driver; whether anyone reads it."""
        self._status.put(CommandStatus(**fields))  # type: ignore[arg-type]
        return self._status.matched

    def live(self, end: threading.Event) -> None:
        """Receive, move and publish until the end; pause while `moving` is not set."""
        while not end.wait(STEP / 10):
            if self.moving.is_set():
                self._step()

    def _step(self) -> None:
        while self.resets:
            self.resets.popleft()(self)
        for received in iter(self.commands.try_recv, None):
            assert received.message is not None
            self.heard.append(received.message)
            linear, angular = received.message.linear, received.message.angular
            self._velocity = (
                (0.1, 0.0, 0.0) if self.slips.is_set() else (linear.x, linear.y, angular.z)
            )
            self._moves_until = self.time + AHEAD
        if self._velocity == STOP or self.slips.is_set() or self.time < self._moves_until:
            x, y, yaw = self.pose
            vx, vy = to_world(self._velocity, yaw, STEP)
            self.pose = x + vx * STEP, y + vy * STEP, yaw + self._velocity[2] * STEP
            self.time += STEP
        turned = Quaternion(0, 0, math.sin(self.pose[2] / 2), math.cos(self.pose[2] / 2))
        pose = PoseWithCovariance(Pose(Point(self.pose[0], self.pose[1]), turned))
        twist = TwistWithCovariance(Twist.planar(*self._velocity))
        self._steps += 1
        if self.epoch != self._told or self._steps % STATUS_EVERY == 0:
            self._told = self.epoch
            self._sim.put(SimulationStatus(epoch=self.epoch))
        self._odom.put(Odometry(Header(Time.of(self.time)), pose=pose, twist=twist))


class Case:
    """A follower, its robot, its reports, and how to run it in a thread."""

    def __init__(self, wire: Wire, pool: ThreadPoolExecutor, end: threading.Event) -> None:
        self.robot, self.stop, self.reports = Robot(wire.bus("sim")), threading.Event(), list[str]()
        self.bus = wire.bus("controller")
        self.follower = Follower(self.bus, "", QUICK, self.stop, self.reports.append)
        self._pool, self._laps = pool, list[Future[list[Leg]]]()
        self.living = pool.submit(self.robot.live, end)

    def lap(self, moving: bool = True) -> "Future[list[Leg]]":
        if moving:
            self.robot.moving.set()
        self._laps.append(self._pool.submit(self.follower.lap))
        return self._laps[-1]

    def resume(self, number: int = 1) -> None:
        """Publish the resume of this number until the follower knows of it, as a sim does."""
        wait_for(
            lambda: (
                self.robot.status(resumed=number)
                and (known := self.follower.status.read()[0])
                and known.resumed == number
            ),
            what="the news of the resume",
        )

    def end(self) -> None:
        """End the lap, which waits for odom."""
        self.stop.set()
        self.robot.moving.set()
        wait(self._laps, 30)

    def reported(self, start: str) -> bool:
        """Whether the newest report begins so: on a busy machine one of stale odom may come
        before.
        """
        return bool(self.reports) and self.reports[-1].startswith(start)

    def goals(self, last: int = len(GOALS) - 1, fail: Callable[[int], str] = lambda _: "") -> None:
        """Serve GOALS; `fail` may give a reason to refuse a goal."""

        def next_goal(request: NextGoalRequest) -> NextGoalReply:
            if reason := fail(request.request_goal):
                raise ServiceError(reason)
            return NextGoalReply(*GOALS[request.request_goal], int(request.request_goal == last))

        self.robot.bus.serve("next_goal", NextGoalRequest, NextGoalReply, next_goal).start()


@pytest.fixture
def case(wire: Wire, monkeypatch: pytest.MonkeyPatch) -> Iterator[Case]:
    # The robot sends 2,000 messages a second. On a busy machine a goal waits behind them for
    # seconds.
    monkeypatch.setattr("services.controller.follow.MAX_AGE", 60.0)
    monkeypatch.setattr("holozen.odometry.ODOM_SILENCE", STALE)
    # A status that lists no sources never shows that the robot has heard a stop.
    monkeypatch.setattr("services.controller.follow.STOP_FOR", 0.2)
    end = threading.Event()
    with ThreadPoolExecutor() as pool:
        case = Case(wire, pool, end)
        try:
            yield case
        finally:
            case.end()
            end.set()
            case.living.result(30)  # raises what has ended it early


@pytest.fixture
def quick_silence(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    """Odom is stale as soon as it is for people."""
    monkeypatch.setattr("holozen.odometry.ODOM_SILENCE", ODOM_SILENCE)


def test_a_lap_visits_every_goal_and_ends_standing(case: Case) -> None:
    case.goals()
    legs = case.lap().result(30)
    assert [leg.goal for leg in legs] == GOALS
    wait_for(lambda: case.robot.heard[-1] == Twist())
    assert case.robot.pose == pytest.approx(GOALS[-1], abs=0.03)
    assert legs[0].began < legs[0].ended <= legs[1].began < legs[1].ended
    assert all(leg.path_error < 0.3 for leg in legs)


def test_commands_have_the_priority_of_an_autopilot(case: Case) -> None:
    samples = case.robot.bus.subscribe_raw("cmd_vel")
    case.goals()
    case.lap().result(30)
    assert samples.recv().priority == "DATA_LOW"


def test_it_waits_for_the_service_and_reports_it_once(case: Case) -> None:
    lap = case.lap()
    wait_for(lambda: case.reports)
    assert "waiting for goal 0: no reply from 'next_goal' within 0.5 s" in case.reports[0]
    assert case.reports[0].endswith("; `holozen pose-service` starts one")
    case.goals()
    assert len(lap.result(30)) == 2
    # others are of a service that a busy machine held up
    assert sum("goal 0" in report for report in case.reports) == 1
    assert "continues" in case.reports[1:]


def test_without_the_service_too_a_robot_that_is_not_there_is_reported(
    wire: Wire, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("services.controller.follow.NOTICE", 0.0)
    _odom = wire.bus("sim").publisher("Ann/odom", Odometry)
    stop, reports = threading.Event(), list[str]()
    follower = Follower(wire.bus("controller"), "Fred", QUICK, stop, reports.append)
    with ThreadPoolExecutor() as pool:
        pool.submit(follower.lap)
        wait_for(lambda: reports)
        stop.set()
    assert reports[0].startswith("waiting for goal 0: no reply from 'next_goal' within 0.5 s")
    assert reports[0].endswith("; Fred: no node publishes its odom; there are: Ann")


def test_a_first_goal_that_is_refused_is_asked_for_again(case: Case) -> None:
    reasons = iter(["the list is being read"])
    case.goals(fail=lambda _: next(reasons, ""))
    assert len(case.lap().result(30)) == 2
    refused = case.reports.index("goal 0: the list is being read")
    assert "continues" in case.reports[refused:]


def test_a_list_that_got_shorter_ends_the_lap(case: Case) -> None:
    case.goals(last=99, fail=lambda number: "the list holds goals 0 to 0" if number else "")
    assert [leg.goal for leg in case.lap().result(30)] == GOALS[:1]
    assert case.reports[-1] == "goal 1: the list holds goals 0 to 0"


def test_without_odom_it_reports_that_and_moves_nothing(case: Case, quick_silence: None) -> None:
    case.goals()
    lap = case.lap(moving=False)
    wait_for(lambda: "waiting for odom: it is stale, or none was received" in case.reports)
    assert case.robot.commands.try_recv() is None
    case.robot.moving.set()
    assert len(lap.result(30)) == 2


def test_when_odom_goes_stale_it_stops_the_robot_once(case: Case, quick_silence: None) -> None:
    # Not those of the robot, which needs the stop: moving, its clock stands without commands.
    commands = case.robot.bus.subscribe("cmd_vel", Twist)
    case.goals()
    lap = case.lap()
    wait_for(lambda: case.robot.heard)
    case.robot.moving.clear()
    wait_for(lambda: "waiting for odom: it is stale, or none was received" in case.reports)
    heard: list[Twist | None] = []

    def stopped() -> bool:
        heard.extend(received.message for received in iter(commands.try_recv, None))
        return heard[-1:] == [Twist()]

    wait_for(stopped)
    case.robot.moving.set()
    assert len(lap.result(30)) == 2


def test_a_robot_that_cannot_strafe_is_reported_once(case: Case) -> None:
    wait_for(lambda: case.robot.status(strafes=False) and case.follower.status.count)
    case.goals()
    case.lap().result(30)
    assert sum(report.startswith("this robot cannot strafe") for report in case.reports) == 1


def test_it_yields_to_any_other_driver_and_sends_not_even_a_stop(case: Case) -> None:
    wait_for(lambda: case.robot.status(obeyed="teleop@9", held=True) and case.follower.status.count)
    case.goals()
    lap = case.lap()
    reason = (
        "yields to teleop@9; resume with `holozen controller --resume` or press r in the teleop"
    )
    wait_for(lambda: reason in case.reports)
    assert case.robot.heard == []
    case.resume()
    assert len(lap.result(30)) == 2
    assert "continues" in case.reports[case.reports.index(reason) :]


def test_a_stopped_robot_is_not_commanded_and_after_the_resume_it_begins_with_a_stop(
    case: Case,
) -> None:
    """A source that commanded a stopped robot has to release it first."""
    case.goals()
    lap = case.lap()
    wait_for(lambda: case.robot.heard)
    wait_for(
        lambda: (
            case.robot.status(stopped="stop@9", held=True)
            and case.reported("yields: the robot is stopped by")
        )
    )
    assert case.reports[-1].startswith(
        "yields: the robot is stopped by stop@9; `holozen release` ends that"
    )
    wait_for(
        lambda: case.robot.status(held=True) and case.reported("yields to the stop by stop@9; ")
    )
    before = len(case.robot.heard)
    case.resume()
    assert len(lap.result(30)) == 2
    assert case.robot.heard[before] == Twist()
    assert case.robot.heard[before + 1] != Twist()


def test_a_controller_that_drives_lets_go_without_a_word_when_another_takes_over(
    case: Case,
) -> None:
    """A stop command of its own would hold up the person who drives now."""
    case.goals()
    lap = case.lap()
    wait_for(lambda: case.robot.heard)
    case.robot.slips.set()
    wait_for(
        lambda: (
            case.robot.status(obeyed="teleop@9", held=True)
            and case.reported("yields to teleop@9; ")
        )
    )
    case.stop.set()
    assert len(lap.result(30)) < 2
    case.follower.halt()
    assert Twist() not in case.robot.heard


def test_a_goal_beyond_any_floor_is_not_driven_to(case: Case) -> None:
    def next_goal(_request: NextGoalRequest) -> NextGoalReply:
        return NextGoalReply(2e6)

    case.robot.bus.serve("next_goal", NextGoalRequest, NextGoalReply, next_goal).start()
    lap = case.lap()
    wait_for(lambda: "goal 0 is more than 1e+06 m away; waiting for another" in case.reports)
    case.stop.set()
    assert lap.result(30) == []
    assert case.robot.heard == []


def test_a_pose_beyond_any_floor_is_not_believed(case: Case) -> None:
    case.robot.pose = (-2e6, 0.0, 0.0)
    case.goals()
    lap = case.lap()
    wait_for(lambda: "waiting for odom: its pose is more than 1e+06 m away" in case.reports)
    assert case.robot.heard == []
    case.robot.pose = (0.0, 0.0, 0.0)
    assert len(lap.result(30)) == 2


def test_a_stop_is_repeated_until_the_robot_rests(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("services.controller.follow.STOP_FOR", STOP_FOR)
    case.goals()
    lap = case.lap()
    wait_for(lambda: case.robot.heard)
    case.robot.slips.set()  # a robot that goes on whatever is commanded
    case.stop.set()
    lap.result(30)
    case.follower.halt()
    wait_for(lambda: case.robot.heard.count(Twist()) > 3)


def test_asked_to_stop_it_ends_its_lap_and_halts_the_robot(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    case.goals()
    lap = case.lap()
    wait_for(lambda: case.robot.heard)
    case.stop.set()
    assert len(lap.result(30)) < 2
    case.follower.halt()
    wait_for(lambda: case.robot.heard[-1] == Twist())
    more: list[Message] = []  # some of the first are still on their way
    put = Publisher.put

    def note(publisher: Publisher[Message], message: Message) -> None:
        more.append(message)
        put(publisher, message)

    monkeypatch.setattr(Publisher, "put", note)
    case.follower.halt()
    assert not [message for message in more if isinstance(message, Twist)], "a robot that rests"


def send(case: Case, x: float, y: float, frame: str = "odom", again: tuple[str, ...] = OLD) -> None:
    """Send a goal on goal_pose until it is taken, or refused: `again` where it is refused since a
    busy machine held it up.
    """
    goals = case.robot.bus.publisher("goal_pose", PoseStamped)
    wait_for(lambda: goals.echoes and goals.echoes.heard)
    payload = encode(PoseStamped(Header(frame_id=frame), Pose(Point(MARK, y))), "cdr").replace(
        struct.pack("<d", MARK), struct.pack("<d", x)
    )

    def is_answered() -> bool:
        seen = len(case.reports)
        goals.put_bytes(payload, encoding("cdr", PoseStamped))
        answer = wait_for(
            lambda: [line for line in case.reports[seen:] if line.startswith("goal_pose: ")],
            what=f"an answer; the last reports: {case.reports[-3:]}",
        )
        return not answer[0].endswith(again) if again else True

    wait_for(is_answered)
    goals.close()


def test_a_goal_of_goal_pose_comes_before_the_list_and_the_robot_stays_until_a_resume(
    case: Case,
) -> None:
    case.goals()
    wait_for(lambda: case.robot.status() and case.follower.status.count)
    lap = case.lap()  # it beats only while it drives
    send(case, -0.4, 0.3)
    wait_for(
        lambda: (
            "yields to a goal of goal_pose; resume with `holozen controller --resume` or press r "
            "in the teleop" in case.reports
        )
    )
    assert any(line.startswith("goal_pose: (-0.40, 0.30) by sim@") for line in case.reports)
    assert case.robot.pose == pytest.approx((-0.4, 0.3, 0.0), abs=0.03)
    send(case, -0.4, -0.3)
    wait_for(
        lambda: case.reports[-1].startswith("yields") and case.robot.pose[1] < -0.25,
        what="the next goal",
    )
    case.resume()
    assert [leg.goal for leg in lap.result(30)] == GOALS


RESETS: dict[str, Callable[[Robot], None]] = {
    "its clock goes back": lambda robot: setattr(robot, "time", 0.0),
    "it is elsewhere": lambda robot: setattr(robot, "pose", (5.0, 5.0, 0.0)),
    "an epoch begins": lambda robot: setattr(robot, "epoch", robot.epoch + 1),
}


@pytest.mark.parametrize("reset", RESETS.values(), ids=RESETS)
def test_a_goal_of_goal_pose_is_dropped_by_a_reset_and_the_list_is_driven_after_it(
    case: Case, reset: Callable[[Robot], None]
) -> None:
    case.goals()
    wait_for(lambda: case.robot.status() and case.follower.status.count)
    lap = case.lap()
    send(case, 1e4, 0.0)
    wait_for(lambda: case.robot.heard and case.robot.heard[-1].linear.x > 1.9)
    case.robot.resets.append(reset)
    wait_for(
        lambda: case.reports[-1].startswith("yields to a goal of goal_pose"),
        what=lambda: f"it to stay; {case.reports}",
    )
    assert case.reports[-2] == "goal_pose: given up: the robot was reset or moved"
    wait_for(lambda: case.robot.heard[-1] == Twist())
    case.resume()
    wait_for(lambda: case.robot.heard[-1] != Twist())
    case.robot.resets.append(reset)
    assert [leg.goal for leg in lap.result(60)] == GOALS


def navigate(case: Case, x: float) -> Callable[[], int]:
    """Send a goal of the action; what waits for the state in which it ends."""
    send, result = nav.NavigateToPose.Impl.SendGoalService, nav.NavigateToPose.Impl.GetResultService
    key, goal, client = "navigate_to_pose/_action", UUID(list(new_id())), case.robot.bus
    request = send.Request(goal, nav.NavigateToPoseGoal(PoseStamped(pose=Pose(Point(x)))))
    assert client.call(f"{key}/send_goal", request, send.Response).accepted
    return lambda: int(
        client.call(f"{key}/get_result", result.Request(goal), result.Response, 30).status
    )


def test_a_goal_is_aborted_after_the_controller_was_suspended(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    case.lap()
    end = navigate(case, 1e4)
    wait_for(lambda: case.robot.heard)
    # Its clock has gone on when the next odom comes.
    monkeypatch.setattr(
        "services.controller.follow.time", SimpleNamespace(monotonic=lambda: time.monotonic() + 3.0)
    )
    assert end() == State.ABORTED
    wait_for(lambda: case.robot.heard[-1] == Twist(), what="the robot to be stopped")


def test_a_goal_may_arrive_before_the_news_of_the_resume_after_which_it_was_sent(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    for limit in ("STATUS_DELAY", "LOST"):
        monkeypatch.setattr(f"services.controller.follow.{limit}", 60.0)
    wait_for(lambda: case.robot.status(obeyed="teleop@9", held=True) and case.follower.status.count)
    case.lap()
    end = navigate(case, 0.3)
    wait_for(lambda: case.reported("yields to teleop@9; "))
    assert not case.robot.heard, "it may not drive yet"
    case.resume()
    assert end() == State.SUCCEEDED


def test_after_a_suspension_it_speeds_up_from_rest(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    # each look that comes late finds several suspensions
    monkeypatch.setattr("services.controller.follow.LOST", math.inf)
    offset = itertools.count()

    def suspend(robot: Robot) -> None:
        """A second has passed when the next odom comes."""
        robot.time, passed = robot.time + 1.0, next(offset) + 1.0
        clock = SimpleNamespace(monotonic=lambda: time.monotonic() + passed)
        monkeypatch.setattr("services.controller.follow.time", clock)

    case.lap()
    send(case, 1e4, 0.0)
    wait_for(lambda: case.robot.heard and case.robot.heard[-1].linear.x == pytest.approx(2.0))
    case.robot.heard.clear()

    def slows_down() -> bool:
        case.robot.resets.append(suspend)
        return any(0 < command.linear.x < 1.1 for command in case.robot.heard)

    wait_for(slows_down, what="a command at which the robot speeds up from rest")


def test_a_goal_that_waited_for_a_suspended_controller_is_refused(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = itertools.count(time.monotonic(), 3.0)  # it is suspended between any two looks
    monkeypatch.setattr(
        "services.controller.follow.time", SimpleNamespace(monotonic=lambda: next(clock))
    )
    lap = case.lap()
    send(case, -0.4, 0.3, again=())
    reason = "refused: the controller was suspended when it was sent; send it again"
    assert f"goal_pose: {reason}" in case.reports
    assert navigate(case, 1e4)() == State.ABORTED
    assert f"navigate_to_pose: {reason}" in case.reports and not case.robot.heard
    case.goals()
    assert [leg.goal for leg in lap.result(30)] == GOALS


@pytest.mark.parametrize(("began", "is_silent", "why"), [(3.0, False, LATE), (1.0, True, HELD_UP)])
def test_a_goal_is_refused_at_the_first_look_at_which_it_can_be_there(
    began: float, is_silent: bool, why: str
) -> None:
    backlog = Backlog()
    assert not backlog.update(0.0, False)
    # a second apart without a list of goals
    looks = [(began, is_silent), (began + 1.0, False), (began + 2.0, False)]
    assert [backlog.update(now, silent) for now, silent in looks] == [why, why, ""]
    assert [backlog.update(now, True) for now in (9.0, 9.1)] == [LATE, LATE], (
        "odom comes a moment later"
    )


def test_a_goal_that_a_link_may_have_held_up_is_refused(
    case: Case, quick_silence: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("services.controller.follow.SUSPENDED", 1.5)
    monkeypatch.setattr("services.controller.backlog.CATCHING_UP", 0.5)
    case.lap()

    goals = case.robot.bus.publisher("goal_pose", PoseStamped)

    def send_until(reported: str) -> None:
        seen = len(case.reports)

        def is_reported() -> bool:
            goals.put(PoseStamped(pose=Pose(Point(9.0))))
            return any(report.startswith(reported) for report in case.reports[seen:])

        wait_for(is_reported, what=lambda: f"{reported!r}; the last reports: {case.reports[-3:]}")

    send_until("goal_pose: (9.00, ")
    case.robot.moving.clear()
    send_until(f"goal_pose: refused: {HELD_UP}")
    heard = len(case.robot.heard)
    case.robot.moving.set()
    send_until("goal_pose: (9.00, ")
    wait_for(lambda: len(case.robot.heard) > heard)


def test_a_goal_of_goal_pose_waits_while_another_drives(case: Case) -> None:
    case.goals()
    wait_for(lambda: case.robot.status(obeyed="teleop@9", held=True) and case.follower.status.count)
    lap = case.lap()
    wait_for(lambda: case.reported("yields to teleop@9; "))
    send(case, -0.4, 0.3)
    assert case.robot.heard == []
    case.resume()
    wait_for(lambda: case.reports[-1].startswith("yields to a goal of goal_pose"))
    assert case.robot.pose == pytest.approx((-0.4, 0.3, 0.0), abs=0.03)
    case.resume(2)
    assert len(lap.result(30)) == 2


@pytest.mark.parametrize(
    ("x", "frame", "reason"),
    [
        (1.0, "camera", "its frame is 'camera'; give it in 'odom'"),
        (2e6, "odom", "it is more than 1e+06 m away"),
        (math.nan, "odom", "pose.position.x is not a finite number"),
    ],
)
def test_an_implausible_goal_is_refused(case: Case, x: float, frame: str, reason: str) -> None:
    case.goals()
    lap = case.lap()
    send(case, x, 0.0, frame)
    assert f"goal_pose: refused: {reason}" in case.reports
    assert [leg.goal for leg in lap.result(30)] == GOALS
