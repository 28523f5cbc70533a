"""Keys that are held in the page for ten seconds, on a busy machine: how many of the holds are lost
before the key is released.

Each page of `holozen view` drives a robot of its own, in one Chromium; other processes compute all
the time, as many as the load says. A hold is lost if its robot does not move within three seconds,
or stands before the release. The scenes are not drawn, as without a graphics card that would be the
load.
"""

import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from benchmarks.company import beside, chromium, page_address
from benchmarks.report import parser, show, write
from holozen.messages import Odometry
from holozen.testing import Wire, wait_for
from holozen.transport.pubsub import Latest

AIM = "0 of 100 holds lost at loads of up to 4"
LOADS = (1, 4, 8)
STANDS, MOVES = 0.01, 0.1  # m/s
BEGINS = 3.0  # s until a robot moves
LOOK = 0.02  # s between two looks at the velocities
KEYS = ("w", "s")  # in turns, so that the robots stay where they are
ROBOT = "urdf/hb_bot.urdf.xacro"


def compute() -> None:
    """Take what one core gives."""
    while True:
        pass


class Driver:
    """A page that drives a robot, and the robot's odometry."""

    def __init__(self, page: Any, robot: str, odom: Latest[Odometry]) -> None:
        self._page, self._robot, self._odom = page, robot, odom
        page.get_by_role("button", name=robot, exact=True).click()
        page.locator(f"#robots [aria-pressed=true]:text-is('{robot}')").wait_for()
        page.locator("#driver:text('ready')").wait_for()

    @property
    def speed(self) -> float:
        """How fast the robot moves, m/s."""
        message = self._odom.read()[0]
        return abs(message.twist.twist.linear.x) if message else 0.0

    def press(self, key: str) -> None:
        """Hold a key."""
        self._page.keyboard.down(key)

    def release(self, key: str) -> str:
        """Release it; returns what the page says."""
        said = self._page.locator("#toast").inner_text()
        self._page.keyboard.up(key)
        return f"{self._robot}: {said or 'it says nothing'}"


@contextmanager
def drivers(count: int) -> Iterator[list[Driver]]:
    """Pages that drive a robot each."""
    from playwright.sync_api import sync_playwright

    with Wire() as wire, sync_playwright() as playwright:
        wire.start("sim", "--empty").wait_for_line("sim: ")
        spawned = wire.run("spawn", ROBOT, "--name", "bot", "--count", str(count))
        assert spawned.returncode == 0, spawned.stderr
        view, bus = wire.start("view", "--port", "0"), wire.bus("witness")
        view.wait_for_line("http://")
        browser = chromium(playwright)
        found = []
        for number in range(count):
            # a page of its own has the keys, as in a window of its own
            context = browser.new_context()
            context.route("**/scene/**", lambda route: route.fulfill(body="<title>a scene</title>"))
            page = context.new_page()
            page.set_default_timeout(60_000)
            page.goto(page_address(view.err))
            robot = f"bot{number}"
            found.append(Driver(page, robot, bus.latest(f"{robot}/odom", Odometry)))
        yield found
        browser.close()


def hold(pages: list[Driver], key: str, seconds: float) -> list[str]:
    """Hold a key in all pages at once; returns what those say whose hold was lost."""
    for page in pages:
        page.press(key)
    pressed, moving, lost = time.monotonic(), set[Driver](), set[Driver]()
    while time.monotonic() < pressed + seconds:
        for page in pages:
            if page.speed > MOVES:
                moving.add(page)
            if page in moving and page.speed < STANDS:
                lost.add(page)
        if time.monotonic() > pressed + BEGINS:
            lost |= set(pages) - moving
        time.sleep(LOOK)
    said = {page: page.release(key) for page in pages}
    for page in pages:
        wait_for(lambda page=page: page.speed < STANDS, 10, "rest after the release")  # type: ignore[misc]
    return [said[page] for page in lost]


def main() -> int:
    flags = parser("holds", __doc__)
    flags.add_argument(
        "--loads", type=int, nargs="+", default=LOADS, metavar="N", help="(default: 1 4 8)"
    )
    flags.add_argument(
        "--holds", type=int, default=100, metavar="N", help="at each load (default: 100)"
    )
    flags.add_argument("--pages", type=int, default=1, metavar="N", help="at a time (default: 1)")
    args = flags.parse_args()
    holds, seconds = (args.pages, 1.0) if args.quick else (args.holds, 10.0)
    rows: list[tuple[str, ...]] = [("load", "holds", "lost")]
    cases = list[dict[str, object]]()
    with drivers(args.pages) as pages:
        for load in args.loads:
            lost = list[str]()
            with ExitStack() as burners:
                for _ in range(load):
                    burners.enter_context(beside(compute))
                rounds = -(-holds // args.pages)
                for turn in range(rounds):
                    lost += hold(pages, KEYS[turn % 2], seconds)
            rows.append((str(load), str(rounds * args.pages), str(len(lost))))
            cases.append({"load": load, "holds": rounds * args.pages, "lost": lost})
            print(*lost, sep="\n", end="\n" if lost else "")
    show(rows)
    print(f"aim: {AIM}")
    write("holds", args.json, cases=cases, aim=AIM)
    return 0


if __name__ == "__main__":
    sys.exit(main())
