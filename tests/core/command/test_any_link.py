"""Any commands over links that stall, lose and deliver late, through the real inputs: what moves
the robot was sent by someone who is there, less than half a second ago, and who has let go since
the robot was stopped.
"""

from itertools import count, pairwise

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from holozen.command.arbiter import Arbiter
from holozen.command.inputs import TwistInput
from holozen.command.wait_set import Moment
from holozen.limits import STOP
from holozen.messages import Twist, TwistStamped
from holozen.transport.pubsub import Received
from tests.core.command.fakes import FakeSenders, received, stamp

NAMES = {
    "ann": "INTERACTIVE_HIGH",
    "bob": "INTERACTIVE_HIGH",
    "script": "DATA",
    "controller": "DATA_LOW",
}
STEP = 0.05  # s, in which a beat goes out
SILENCE = 0.5  # s
RING = 4  # commands that wait at most: a flood drops the oldest


class Link:
    """A source, its link to the robot, and all that it has sent, as time and speed."""

    def __init__(self, name: str, speed: float) -> None:
        self.name, self.speed, self.session = name, speed, name[:2]
        self.numbers = count()
        self.beat = 0.0  # s; the newest that it heard
        self.is_stalled = False
        self.waiting: list[Received[Twist | TwistStamped]] = []
        self.sent: list[tuple[float, float]] = []

    def send(self, now: float, speed: float) -> None:
        text = stamp(next(self.numbers), self.beat, self.session, self.name)
        command: Received[Twist | TwistStamped] = received(
            Twist.planar(speed), text, NAMES[self.name]
        )
        self.waiting = [*self.waiting, command][-RING:]
        self.sent.append((now, speed))

    def has_let_go(self, stopped: float, released: float, now: float) -> bool:
        """Whether it let go after all motions that it sent while the robot was stopped."""
        during = [at for at, speed in self.sent if speed and stopped <= at <= released]
        if not during:
            return True
        later = [each for each in self.sent if each[0] >= during[-1]]
        times = [at for at, _ in later] + [now]
        pauses = (after - before for before, after in pairwise(times))
        return any(not speed for _, speed in later) or max(pauses) > SILENCE


class Robot(RuleBasedStateMachine):
    """A robot, and four sources."""

    def __init__(self) -> None:
        super().__init__()
        self.now = 100.0
        self.links = {name: Link(name, 0.1 * (index + 1)) for index, name in enumerate(NAMES)}
        self.senders = FakeSenders({link.session for link in self.links.values()})
        self.arbiter = Arbiter(SILENCE)
        self.input = TwistInput(
            "Fred/cmd_vel", self.arbiter, self.senders, 2.0, 3.0, lambda _: None
        )
        self.stopped_at, self.released_at = 0.0, 0.0
        self.read_at = self.now
        self.beat()

    def beat(self) -> None:
        for link in self.links.values():
            if not link.is_stalled:
                link.beat = self.now

    def read(self) -> None:
        for link in self.links.values():
            if not link.is_stalled and link.waiting:
                self.input.take(link.waiting, Moment(self.now, self.read_at, (self.now,)))
                link.waiting = []
        self.read_at = self.now

    @rule(steps=st.sampled_from([1, 1, 1, 2, 4, 12]), hangs=st.booleans())
    def wait(self, steps: int, hangs: bool) -> None:
        for step in range(steps):
            self.now += STEP
            if not hangs or step == steps - 1:
                self.beat()
                self.read()

    @rule(name=st.sampled_from(sorted(NAMES)), goes=st.booleans())
    def send(self, name: str, goes: bool) -> None:
        self.now += 1e-3
        self.links[name].send(self.now, self.links[name].speed if goes else 0.0)
        self.read()

    @rule(name=st.sampled_from(sorted(NAMES)), steps=st.sampled_from([3, 8, 20]))
    def hold(self, name: str, steps: int) -> None:
        for _ in range(steps):
            self.wait(1, False)
            self.send(name, True)
            self.moves_by_a_command_of_now()

    @rule(name=st.sampled_from(sorted(NAMES)))
    def stall(self, name: str) -> None:
        self.links[name].is_stalled = True

    @rule(name=st.sampled_from(sorted(NAMES)))
    def mend(self, name: str) -> None:
        self.links[name].is_stalled = False
        self.read()

    @rule(name=st.sampled_from(sorted(NAMES)))
    def vanish(self, name: str) -> None:
        """Its token goes; what it sent may still be on its way."""
        self.senders.there.discard(self.links[name].session)
        self.read()
        self.arbiter.forget(f"{name}@{self.links[name].session}")

    @rule()
    def stop(self) -> None:
        self.arbiter.stop("eve", self.now)
        self.stopped_at = self.now

    @precondition(lambda self: self.arbiter.stopped_by)
    @rule()
    def release(self) -> None:
        self.now += 1e-3
        self.arbiter.release(self.now)
        self.released_at = self.now
        self.beat()

    @rule(
        name=st.sampled_from(sorted(NAMES)),
        count=st.sampled_from([1, 2, RING + 2]),
        lets_go=st.booleans(),
    )
    def hold_through_a_stop(self, name: str, count: int, lets_go: bool) -> None:
        """It sends motions over a link that stalls during a stop and is mended after the
        release.
        """
        self.stop()
        if lets_go:
            self.send(name, False)
        self.stall(name)
        for _ in range(count):
            self.send(name, True)
        self.release()
        self.mend(name)
        self.moves_by_a_command_of_now()
        self.send(name, True)

    @rule()
    def resume(self) -> None:
        self.arbiter.resume(self.now)

    @invariant()
    def moves_by_a_command_of_now(self) -> None:
        motion, driver = self.arbiter.motion(self.now).value, self.arbiter.driver(self.now)
        if motion == STOP or driver is None:
            return
        link = self.links[driver.source.name.partition("@")[0]]
        assert not self.arbiter.stopped_by
        assert link.session in self.senders.there
        moving = [at for at, speed in link.sent if speed]
        assert self.now - moving[-1] <= SILENCE + 1e-6, (
            "it moved for longer than its source commanded"
        )
        assert link.has_let_go(self.stopped_at, self.released_at, self.now), "a release moved it"


TestAnyLink = Robot.TestCase
TestAnyLink.settings = settings(stateful_step_count=40, max_examples=40, deadline=None)
