"""What the page that drives and its server say to each other: JSON texts on one WebSocket, typed on
both sides.

The page's half is in page/worker.js and page/page.js. `PROTOCOL` is the WebSocket's subprotocol: a
page of another version is not answered. What is newer than this on either side is an error, and not
a robot that stands still.

Age: the server numbers its beats, and the page returns the newest number that it has heard, its
    `echo`. The server
subtracts: a message is at most as old as that beat, by the server's own clock. A beat also stands
for those of the robot that the server had heard by then; these are what a command of the page
returns to the robot, which subtracts in the same way. So a delay or a hang of page, server or link
is one bound.
"""

from typing import Annotated

from msgspec import Meta, Struct, json

PROTOCOL = "holozen.cockpit.1"

Part = Annotated[float, Meta(ge=-1.0, le=1.0)]
"""A part of a velocity, of the most that is chosen; left and counter-clockwise are positive."""
Share = Annotated[float, Meta(ge=0.0, le=1.0)]
"""A place in the scene's picture: of its width from the left, or of its height from the top."""
Text = Annotated[str, Meta(max_length=200)]
Count = Annotated[int, Meta(ge=0, le=2**53)]


class FromPage(Struct, tag_field="type", forbid_unknown_fields=True, frozen=True):
    """A message of a page. `echo` is the number of the newest beat that it has heard, 0 before the
    first.
    """

    echo: Count


class Hold(FromPage, tag="hold", frozen=True):
    """A person holds keys or a stick: sent 20 times a second, and at once when it changes.

    Attributes:
        press: Counts what was pressed after all had been let go. One that has ended never counts
            again.
        robot: The name of the robot that it was pressed for.
        x, y, turn: Forward, left, counter-clockwise, as parts of `speed` (m/s) and `rate` (rad/s).
        sent: The time by the page's clock, in ms.
    """

    press: Count
    robot: Text
    x: Part
    y: Part
    turn: Part
    speed: float
    rate: float
    sent: float = 0.0


class LetGo(FromPage, tag="let_go", frozen=True):
    """All that was pressed was let go."""

    press: Count


class Ping(FromPage, tag="ping", frozen=True):
    """A page that holds nothing is there. `sent` as in Hold."""

    sent: float = 0.0


class Stop(FromPage, tag="stop", frozen=True):
    """Stop the robot until a release. It counts at any age."""

    robot: Text


class Release(FromPage, tag="release", frozen=True):
    """End a stop."""

    robot: Text


class Resume(FromPage, tag="resume", frozen=True):
    """Let sources that were overruled drive again, such as the controller."""

    robot: Text


class Goal(FromPage, tag="goal", frozen=True):
    """A click at `u`, `v` of the scene: the controller is to drive there, or, to `place` it, the
    sim puts it there.
    """

    robot: Text
    u: Share
    v: Share
    place: bool = False


class SlowDown(FromPage, tag="slow_down", frozen=True):
    """Let the robot slow down near obstacles, or no longer."""

    robot: Text
    on: bool


class Choose(FromPage, tag="choose", frozen=True):
    """Choose a robot: by its name, or by a click in the scene if that is empty."""

    robot: Text = ""
    u: Share = 0.0
    v: Share = 0.0


class Look(FromPage, tag="look", frozen=True):
    """How the scene's camera moves: one of open_page.VIEWS."""

    view: Text


class Simulation(FromPage, tag="simulation", frozen=True):
    """Pause, play, step or reset the sims."""

    verb: Text


class Spawn(FromPage, tag="spawn", frozen=True):
    """Spawn one more robot of a model."""

    model: Text


class Delete(FromPage, tag="delete", frozen=True):
    """Delete a robot."""

    robot: Text


class Display(FromPage, tag="display", frozen=True):
    """Switch a display on or off."""

    label: Text
    on: bool


class Frame(FromPage, tag="frame", frozen=True):
    """Choose the fixed frame of the displays."""

    name: Text


class Fields(FromPage, tag="fields", frozen=True):
    """Ask which numbers the messages of a topic have."""

    key: Text


class Plot(FromPage, tag="plot", frozen=True):
    """Plot a number of a topic, or no longer."""

    key: Text
    field: Text
    on: bool


class Camera(FromPage, tag="camera", frozen=True):
    """Choose the topic of the picture; empty: none."""

    key: Text


class Play(FromPage, tag="play", frozen=True):
    """Pause a bag, or go on; or with a time in s, jump there."""

    at: float | None = None


Said = (
    Hold
    | LetGo
    | Ping
    | Stop
    | Release
    | Resume
    | Goal
    | SlowDown
    | Choose
    | Look
    | Simulation
    | Spawn
    | Delete
    | Display
    | Frame
    | Fields
    | Plot
    | Camera
    | Play
)
"""What a page says."""

_decoder: json.Decoder[Said] = json.Decoder(Said)


def read(text: str | bytes) -> Said:
    """A page's message. Raises msgspec.DecodeError for what is none; JSON has no number that is not
    finite.
    """
    return _decoder.decode(text)


class ToPage(Struct, tag_field="type"):
    """A message to a page."""


class Welcome(ToPage, tag="welcome"):
    """The first one. `ticket` is part of the addresses of the page's scene and pictures, which have
    no cookie.
    """

    ticket: str
    look_only: bool
    bag: float | None  # its duration in s
    models: list[str]
    speeds: tuple[float, float]  # m/s; the least and the most
    rates: tuple[float, float]  # rad/s


class Beat(ToPage, tag="beat"):
    """A beat, to be echoed. `sent` is the newest time of the page's clock that has come here, in
    ms.
    """

    echo: int
    sent: float


class Dropped(ToPage, tag="dropped"):
    """A press counts as let go, and why."""

    press: int
    why: str


class Answer(ToPage, tag="answer"):
    """What became of something that the page asked for."""

    text: str
    ok: bool


class FieldsOf(ToPage, tag="fields"):
    """The numbers in the messages of a topic, those that people look at first in front."""

    key: str
    fields: list[str]


class Line(Struct):
    """What is plotted: pairs of time (s) and value."""

    key: str
    field: str
    points: list[tuple[float, float]]


class Lines(ToPage, tag="lines"):
    """All plots. `now` is in s."""

    now: float
    lines: list[Line]


class Chip(Struct):
    """A robot that may be chosen, and its `state`: "moves", "stands" or "silent"."""

    name: str
    state: str


class Box(Struct):
    """A display that may be switched on."""

    label: str
    on: bool


class State(ToPage, tag="state"):
    """What the page shows. Velocities are planar: m/s, m/s and rad/s in the body frame.

    Attributes:
        robots: Those that may be chosen.
        robot: The one that is chosen; empty: none was ever there.
        there: Whether it is there.
        driver: Who drives: "you", "page", "person", "script", "controller" or "".
        driver_name: The name of that source.
        stopped: Who stopped it; empty: nobody.
        held: Whether a controller waits for `resume`.
        lost: Whether its odometry has stopped.
        paused: Whether its sim is.
        waiting: Why commands are not sent yet; or "".
        refused: Why its last command was refused; or "".
        commanded, measured: Its velocities; measured is None without odometry.
        limits: Its greatest speed and rate; 0: not known.
        strafes: Whether its drive can move it sideways.
        slows: Whether it slows down near obstacles; None: no sensor of it sees any.
        limited: How they slow it down now, and why; or "".
        delay: The age of the page's messages in s when they come here, half a beat's period
            included.
        pace: The real-time factor; None: not known.
        frames: The rate of the scene in Hz; None: as fast as it should be.
        cameras: The topics of its pictures.
        camera: The one that is shown.
        picture: Why no picture comes; or "".
        boxes, frames_of, frame, problems: Of the displays.
        topics: Those whose fields may be plotted.
        bag: The time in a bag, in s, and whether it is paused; None without a bag.
    """

    robots: list[Chip] = []
    robot: str = ""
    there: bool = False
    sim: bool = False
    driver: str = ""
    driver_name: str = ""
    stopped: str = ""
    held: bool = False
    lost: bool = False
    paused: bool = False
    waiting: str = ""
    refused: str = ""
    commanded: tuple[float, float, float] = (0.0, 0.0, 0.0)
    measured: tuple[float, float, float] | None = None
    limits: tuple[float, float] = (0.0, 0.0)
    strafes: bool = True
    slows: bool | None = None
    limited: str = ""
    delay: float = 0.0
    pace: float | None = None
    frames: float | None = None
    view: str = ""
    cameras: list[str] = []
    camera: str = ""
    picture: str = ""
    boxes: list[Box] = []
    frames_of: list[str] = []
    frame: str = ""
    problems: list[str] = []
    topics: list[str] = []
    bag: tuple[float, bool] | None = None


def written(message: ToPage) -> str:
    """The text of a message to a page."""
    return json.encode(message).decode()
