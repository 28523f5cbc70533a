"""What a view costs the sim: a hundred robots that drive, in a page of `holozen view`.

The sim runs in real time, and another process commands each robot four times a second. In turns, a
view with an open page is there or not. Times are processor time: of the sim's process for a second
of its own time, and of the view's for a second of real time. The page takes all that it is sent,
and draws nothing; it counts the frames that move one robot. At the end Chromium, if it is there,
opens the page of all robots and that of one: the time from the start of `holozen view` to a picture
with a robot. The browser has been started before, and draws without a graphics card.
"""

import json
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any

import viser
import websockets.sync.client as websockets
import zstandard
from websockets.typing import Origin, Subprotocol

from benchmarks.company import (
    PROCESSES,
    beside,
    chromium,
    guest,
    meeting_point,
    page_address,
    processor_time,
    until,
)
from benchmarks.fleet import drive
from benchmarks.report import Case, parser, publish
from holozen import data
from holozen.bus import Bus
from holozen.messages import Odometry, SimulationStatus
from holozen.view.protocol import PROTOCOL

AIM = (
    "the sim needs at most 1 / 0.95 of its time, and keeps 0.95 of its real-time factor; "
    "the view at most 0.6 of a core; a first picture within 3 s"
)
SECONDS = 4.0  # of a turn
PICTURES = 3  # first ones
COMMANDED = 4.0  # Hz; a robot stands after 0.5 s without a command
RATE = 20.0  # Hz; of the frames, up to a hundred robots
SEES_ROBOT = """() => new Promise((done, fail) => {
    setTimeout(() => fail(new Error("no robot in the picture within 60 s")), 60000);
    const small = document.createElement("canvas");
    [small.width, small.height] = [240, 80];
    const pixels = small.getContext("2d", {willReadFrequently: true});
    const look = () => {
        const scene = [...document.querySelectorAll("canvas")].sort((a, b) => b.width - a.width)[0];
        if (scene && scene.width) {
            pixels.drawImage(scene, 0, 0, 240, 80);
            const {data} = pixels.getImageData(0, 0, 240, 80);
            let orange = 0;
            for (let i = 0; i < data.length; i += 4) {
                const [red, green, blue] = data.slice(i, i + 3);
                orange += red > 150 && red - blue > 70 && red - green > 25 && green - blue > 25;
            }
            if (orange > 4) return done(orange);
        }
        setTimeout(() => requestAnimationFrame(look));  // after the drawing, of which nothing is left later
    };
    look();
})"""  # waits for the orange deck of a robot in the picture  # noqa: E501
WATCHED = b"/entities/bot0"  # its node in the page
MOVED = b"\xa4name" + bytes([0xA0 | len(WATCHED)]) + WATCHED + b"\xa8position"  # in msgpack
HEADER = 16  # bytes of viser's message before what is compressed


@contextmanager
def started(endpoint: str, verb: str, *words: str) -> Iterator[tuple[int, Path]]:
    """Runs a verb in this block: its process id, and the file of what it prints."""
    with tempfile.NamedTemporaryFile() as file:
        command = [
            sys.executable,
            "-m",
            "holozen",
            verb,
            *words,
            "--connect",
            endpoint,
            "--listen",
            endpoint,
        ]
        process = subprocess.Popen(command, stdout=file, stderr=file)
        try:
            yield process.pid, Path(file.name)
        finally:
            process.send_signal(signal.SIGTERM)
            process.wait()


def page(address: str, frames: Any) -> None:
    """A page that takes what it is sent, and counts in `frames` how often the watched robot has
    moved.
    """
    origin, own = address.rstrip("/"), address.rstrip("/").replace("http", "ws")
    viser_own, of_page = Subprotocol(f"viser-v{viser.__version__}"), Subprotocol(PROTOCOL)
    with websockets.connect(f"{own}/drive", origin=Origin(origin), subprotocols=[of_page]) as drive:
        ticket = json.loads(drive.recv())["ticket"]
        threading.Thread(target=lambda: [None for _ in drive], daemon=True).start()  # it reads on
        with websockets.connect(
            f"{own}/scene/{ticket}/", subprotocols=[viser_own], max_size=None
        ) as scene:
            for message in scene:
                frames.value += moves(bytes(message))  # type: ignore[arg-type]


def moves(message: bytes) -> int:
    """How often a message of viser moves the watched robot."""
    packed = int.from_bytes(message[8:HEADER], "little")
    return zstandard.decompress(message[HEADER : HEADER + packed]).count(MOVED)


@contextmanager
def started_view(endpoint: str) -> Iterator[tuple[int, str]]:
    """A view in this block: its process id and its address, once it has printed that."""
    with started(endpoint, "view", "--port", "0") as (process, printed):
        until(lambda: "http://" in printed.read_text(), 0.01)
        yield process, page_address(printed.read_text())


def first_pictures(endpoint: str, times: int) -> list[float]:
    """Seconds from the start of the command to a robot in the picture of Chromium, so many
    times.
    """
    from playwright.sync_api import sync_playwright

    found = []
    with sync_playwright() as playwright:
        browser = chromium(playwright)
        for _ in range(times):
            page = browser.new_page(viewport={"width": 960, "height": 320})
            began = time.monotonic()
            with started_view(endpoint) as (_, address):
                page.goto(address, wait_until="commit")
                page.wait_for_selector("#frame[src]", state="attached")
                element = page.query_selector("#frame")
                scene = element and element.content_frame()
                assert scene
                scene.wait_for_url("**/scene/**", wait_until="commit")
                scene.evaluate(SEES_ROBOT)
                found.append(time.monotonic() - began)
            page.close()
        browser.close()
    return found


class Sim:
    """A running sim, measured from outside."""

    def __init__(self, bus: Bus, process: int) -> None:
        self._status, self._process = bus.latest("simulation_status", SimulationStatus), process

    def seconds(self) -> float:
        """Its own time, as of a status that has just come."""
        assert self._status.wait(self._status.count, 5.0)
        status = self._status.read()[0]
        assert status is not None
        return status.time

    def cost(self, seconds: float, other: int = 0) -> tuple[float, float, float]:
        """Over so many seconds: processor time a second of its own, real-time factor, and the load
        by `other`.
        """
        other = other or self._process
        began, own, work, others = (
            time.monotonic(),
            self.seconds(),
            processor_time(self._process),
            processor_time(other),
        )
        time.sleep(seconds)
        own, work = self.seconds() - own, processor_time(self._process) - work
        real, others = time.monotonic() - began, processor_time(other) - others
        return work / own, own / real, others / real


def main() -> int:
    args = parser("view", __doc__).parse_args()
    robots, turns, seconds, pictures = (5, 1, 0.5, 1) if args.quick else (100, 5, SECONDS, PICTURES)
    endpoint, loads, dropped = meeting_point(), list[float](), list[float]()
    factors: dict[str, list[float]] = {"with": [], "without": []}
    first: dict[str, list[float]] = {}
    has_browser = shutil.which("chromium") is not None
    with started(endpoint, "sim", "--empty") as (process, _), Bus("meter", guest(endpoint)) as bus:
        sim = Sim(bus, process)
        until(bus.endpoints)
        robot = str(data.find("urdf", "hb_bot.urdf.xacro"))
        words = ["spawn", robot, "--count", str(robots), "--connect", endpoint, "--timeout", "20"]
        subprocess.run([sys.executable, "-m", "holozen", *words], check=True, capture_output=True)
        odom = bus.latest(f"bot{robots - 1}/odom", Odometry)

        def moving() -> bool:
            last = odom.read()[0]
            return last is not None and last.twist.twist.linear.x > 0.1

        def without() -> list[float]:
            cost, factor, _ = sim.cost(seconds)
            factors["without"].append(factor)
            return [cost]

        def looked_at() -> list[float]:
            frames = PROCESSES.Value("q", 0)
            with started_view(endpoint) as (view, address), beside(page, address, frames):
                until(lambda: frames.value)
                time.sleep(2.0 if not args.quick else 0.5)  # all robots are in the page
                before, began = frames.value, time.monotonic()
                cost, factor, load = sim.cost(seconds, view)
                due = RATE * (time.monotonic() - began)
                dropped.append(max(0.0, 1 - (frames.value - before) / due))
            factors["with"].append(factor)
            loads.append(load)
            return [cost]

        with beside(drive, endpoint, robots, COMMANDED):
            until(moving)
            case = Case(f"{robots} robots", "s a second of the sim", AIM).take_turns(
                turns, view=looked_at, no_view=without
            )
            if has_browser:
                first[f"{robots} robots"] = first_pictures(endpoint, pictures)
    if has_browser:
        with started(endpoint, "sim"):
            first["1 robot"] = first_pictures(endpoint, pictures)
    ratio = median(factors["with"]) / median(factors["without"])
    each = {side: [round(factor, 3) for factor in found] for side, found in factors.items()}
    print(f"real-time factor, with a view over without: {ratio:.3f}, of {each}")
    print(
        f"the view's load of a core: {median(loads):.2f}, of "
        f"{', '.join(f'{load:.2f}' for load in loads)}"
    )
    print(f"frames dropped, of {RATE:g} a second: {', '.join(f'{part:.1%}' for part in dropped)}")
    for what, found in first.items():
        print(f"first picture of {what}: {', '.join(f'{one:.1f} s' for one in found)}")
    if not has_browser:
        print("first picture: not measured, there is no chromium")
    publish(
        "view",
        [case],
        args.json,
        loads=loads,
        factors=factors,
        factor_ratio=ratio,
        dropped=dropped,
        first_picture=first,
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
