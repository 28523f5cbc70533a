"""Runs every sequence of events that one robot's arbiter can meet, from every state that it can
reach, and compares each step with the promises of docs/safety.md.

Time passes in quanta: a command takes no time to speak of, and a `wait` is longer than any silence
that counts. So the states are finite, and the search ends when no event leads to a new one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from copy import copy
from functools import partial
from typing import NamedTuple, TypeVar

from holozen.command.arbiter import AUTOPILOT, PERSON, Arbiter, Sent, Source
from holozen.command.motion import is_stop
from holozen.limits import STOP, Planar
from holozen.transport.samples import PRIORITIES

SCRIPT = PRIORITIES.index("DATA")
TICK = 1e-4  # s; the time that an event takes
LATE = 0.1  # s by which a command is late that was sent before the event that precedes it
QUANTUM = 0.6  # s; longer than the silence

T = TypeVar("T")
MakeArbiter = Callable[[], Arbiter]


class Promise(AssertionError):
    """A promise that an event broke."""


class Ghost(NamedTuple):
    """What the promises need to know of one source, from its own commands alone.

    Attributes:
        is_fresh: Whether no silence has passed since its last command, on the clock of commands.
        is_quiet: Whether it has sent nothing since the last silence in real time.
        owes: Whether it commanded a motion that it has to let go of.
        waits: Whether it waits for `resume`.
    """

    is_fresh: bool = False
    is_quiet: bool = True
    owes: bool = False
    waits: bool = False


class State:
    """The arbiter under test and what the promises know, at one time."""

    def __init__(self, arbiter: Arbiter, sources: tuple[Source, ...]) -> None:
        self.arbiter = arbiter
        self.sources = sources
        self.now = 1000.0
        self.ghosts = [Ghost() for _ in sources]
        # the source that was obeyed last, while no silence has passed since
        self.driver: int | None = None
        self.autopilots_wait = False
        self.released_at = self.began_at = 0.0

    def apart(self) -> State:
        """A state that changes on its own."""
        twin = shallow(self)
        twin.ghosts = list(self.ghosts)
        twin.arbiter = clone(self.arbiter)
        return twin

    def key(self) -> object:
        """What distinguishes this state from others, with times as the silences that they make."""
        arbiter, at = self.arbiter, self.arbiter.time.at(self.now)
        driver = arbiter.driver(self.now)
        drives = driver and (
            driver.source,
            is_stop(driver.motion),
            driver.gone,
            at - driver.sent > 0.5,
        )
        records = tuple(
            (
                rank,
                name,
                record.waits,
                record.commanded is not None and at - record.commanded > 0.5,
                record.commanded is None,
            )
            for rank, of_rank in sorted(arbiter.state.records.items())
            for name, record in sorted(of_rank.named.items())
        )
        late = (self.now - LATE < self.released_at, self.now - LATE < self.began_at)
        known = (tuple(self.ghosts), self.driver, self.autopilots_wait)
        return (
            drives,
            records,
            arbiter.state.highest,
            bool(arbiter.stopped_by),
            arbiter.time.is_paused,
            late,
            known,
        )

    def ghost(self, index: int, **changes: bool) -> None:
        """Change what is known of a source."""
        self.ghosts[index] = self.ghosts[index]._replace(**changes)


def shallow(one: T) -> T:
    """What copy.copy returns for an object without slots, but quicker."""
    twin = object.__new__(type(one))
    twin.__dict__.update(one.__dict__)
    return twin


def clone(arbiter: Arbiter) -> Arbiter:
    """A copy of an arbiter with a clock of its own."""
    twin = shallow(arbiter)
    twin.time = shallow(arbiter.time)
    twin.state = copy(arbiter.state)
    twin.state.records = {rank: shallow(records) for rank, records in arbiter.state.records.items()}
    for records in twin.state.records.values():
        records.named = dict(records.named)
    return twin


def motion_of(index: int) -> Planar:
    """The motion that a source commands, which no other does."""
    return (0.1 * (index + 1), 0.0, 0.0)


def moving(state: State) -> Planar:
    """How the robot moves."""
    motion = state.arbiter.motion(state.now).value
    assert isinstance(motion, tuple)
    return motion


def promise(holds: bool, text: str) -> None:
    """Raise Promise unless it holds."""
    if not holds:
        raise Promise(text)


def command(state: State, index: int, goes: bool, late: bool) -> None:
    """A source commands a motion or a stop, if `late` one that it sent before the event before."""
    arbiter, source, ghost, before = (
        state.arbiter,
        state.sources[index],
        state.ghosts[index],
        moving(state),
    )
    at = state.now - (LATE if late else 0.0)
    sent = Sent(at, at, QUANTUM if ghost.is_quiet else 0.0)
    other = state.sources[state.driver] if state.driver not in (None, index) else None
    stopped, moved = bool(arbiter.stopped_by), other is not None and before != STOP
    before_release = late and at < state.released_at
    outcome = arbiter.offer(*source, motion_of(index) if goes else STOP, state.now, sent).outcome
    lets_go = not goes or (not ghost.is_fresh and (ghost.is_quiet or arbiter.time.is_paused))
    owes = ghost.owes and not lets_go
    if goes:
        kept_off = other is not None and source.rank >= other.rank
        waits = ghost.waits or (source.rank >= AUTOPILOT and state.autopilots_wait)
        is_old = before_release or (late and at < state.began_at)
        may = not (stopped or owes or is_old or kept_off or waits)
        promise(outcome.is_obeyed == may, f"who may drive does, and no one else: {outcome}")
        promise(
            moving(state) == (motion_of(index) if may else before), "what is refused moves nothing"
        )
    else:
        may = not stopped and (other is None or source.rank <= other.rank)
        promise(
            outcome.is_obeyed == may, f"a stop of the driver's rank or above is obeyed: {outcome}"
        )
        promise(moving(state) == (STOP if may else before), "a stop stops")
    if may:
        if other and (source.rank < other.rank or (moved and not goes)):
            lost_key = moved and source.rank == other.rank == PERSON
            state.ghost(state.sources.index(other), waits=True)
            if lost_key:
                state.ghost(state.sources.index(other), owes=True)
        state.driver = index
        state.autopilots_wait |= source.rank < AUTOPILOT
    elif goes:
        equal = other is not None and moved and source.rank == other.rank
        owes |= stopped or before_release or equal or (source.rank == PERSON and ghost.waits)
        if other and moved and source.rank > other.rank:
            state.ghost(index, waits=True)
    state.ghost(index, is_fresh=True, is_quiet=False, owes=owes)


def pass_silence(state: State, real: bool) -> None:
    """Let a silence pass, in real time or by steps of a paused sim."""
    if real:
        state.now += QUANTUM
    else:
        state.arbiter.time.step(QUANTUM)
    for index in range(len(state.sources)):
        if real:
            state.ghost(index, is_quiet=True)
        if real != state.arbiter.time.is_paused:
            state.ghost(index, is_fresh=False)
    if real != state.arbiter.time.is_paused:
        state.driver = None


def die(state: State, name: str) -> None:
    """The process of a source ends."""
    state.arbiter.forget(name)


def stop(state: State) -> None:
    """The software stop is set."""
    if state.driver is not None and moving(state) != STOP:
        state.ghost(state.driver, owes=True, is_fresh=True)
    state.arbiter.stop("ann", state.now)
    state.driver = None
    state.autopilots_wait = True
    promise(moving(state) == STOP, "a stopped robot stands")


def release(state: State) -> None:
    """It is released."""
    if state.arbiter.stopped_by:
        state.released_at = state.now
    state.arbiter.release(state.now)


def resume(state: State) -> None:
    """`resume`, which may be refused."""
    is_led = state.driver is not None and state.sources[state.driver].rank < AUTOPILOT
    driven = is_led and moving(state) != STOP
    refused = bool(state.arbiter.resume(state.now))
    promise(
        refused == (driven or bool(state.arbiter.stopped_by)),
        "resume is refused while a person or script moves it",
    )
    if not refused:
        state.autopilots_wait = False
        state.driver = None if is_led else state.driver
        for index in range(len(state.sources)):
            state.ghost(index, waits=False)


def begin(state: State) -> None:
    """The sim was reset."""
    state.arbiter.begin(state.now)
    state.driver = None
    state.began_at = state.now
    promise(moving(state) == STOP, "nothing moves after a reset")


def respawn(state: State) -> None:
    """The robot is deleted, and another one is spawned in its place."""
    old, limit = state.arbiter, state.arbiter.velocity_timeout
    old.settle(state.now)
    state.arbiter = type(old)(limit, old.time)
    state.arbiter.inherit(old, state.now)
    for index, ghost in enumerate(state.ghosts):
        if ghost.owes and not ghost.is_fresh:
            state.ghost(index, owes=False)
    begin(state)


def pause(state: State) -> None:
    """The sim is paused."""
    state.arbiter.time.pause(state.now)


def play(state: State) -> None:
    """The sim plays again."""
    state.arbiter.time.play(state.now)
    begin(state)


Event = tuple[str, Callable[[State], None]]


def events(state: State, with_world: bool) -> Iterator[Event]:
    """What may happen next."""
    for index, source in enumerate(state.sources):
        yield f"{source.name} goes", partial(command, index=index, goes=True, late=False)
        yield f"{source.name} stops", partial(command, index=index, goes=False, late=False)
        yield f"{source.name} goes, late", partial(command, index=index, goes=True, late=True)
        yield f"{source.name} dies", partial(die, name=source.name)
    yield "wait", partial(pass_silence, real=True)
    for event in (stop, release, resume):
        yield event.__name__, event
    if not with_world:
        return
    for event in (begin, respawn):
        yield event.__name__, event
    if state.arbiter.time.is_paused:
        yield "step", partial(pass_silence, real=False)
        yield "play", play
    else:
        yield "pause", pause


def check(was: Planar, after: State, event: str) -> None:
    """The promises that hold for every event. `was`: how the robot moved before it."""
    is_ = moving(after)
    if is_ != STOP and is_ != was:
        promise(
            event.partition(",")[0].endswith(" goes"),
            "only a command of motion sets a robot moving",
        )
    if is_ != STOP:
        index = next(index for index in range(len(after.sources)) if motion_of(index) == is_)
        ghost = after.ghosts[index]
        promise(ghost.is_fresh, "a robot moves by a fresh command alone")
        promise(not after.arbiter.stopped_by, "a stopped robot stands")
        promise(event != f"{after.sources[index].name} dies", "the end of its driver stops a robot")


def explore(
    sources: tuple[Source, ...], with_world: bool, make: MakeArbiter = lambda: Arbiter(0.5)
) -> int:
    """Explore to the fixed point; returns the number of states. Raises Promise with the shortest
    way to a broken one.
    """
    begin_state = State(make(), sources)
    ways: dict[object, tuple[object, str]] = {begin_state.key(): (None, "")}
    todo = deque([begin_state])
    while todo:
        state = todo.popleft()
        was = moving(state)
        for name, happens in events(state, with_world):
            after = state.apart()
            after.now += TICK
            try:
                happens(after)
                check(was, after, name)
            except Promise as broken:
                raise Promise(
                    f"{broken}; after: {', '.join([*_way(ways, state.key()), name])}"
                ) from None
            key = after.key()
            if key not in ways:
                ways[key] = (state.key(), name)
                todo.append(after)
    return len(ways)


def _way(ways: dict[object, tuple[object, str]], key: object) -> list[str]:
    """The events that lead to a state."""
    names: list[str] = []
    while key is not None:
        before, name = ways[key]
        names.append(name)
        key = before
    return [name for name in reversed(names) if name]
