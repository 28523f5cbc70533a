"""Takes the pictures of docs/ that are older than what they show, of the page of `holozen view`.

Each has a line in docs/pictures.sha256 with the hash of all files that it shows.
"""

import base64
import hashlib
import shutil
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

REPO = Path(__file__).parents[1]
NOTE = REPO / "docs" / "pictures.sha256"
WORLD = "worlds/arena.world"
IN_ALL = ("scripts/pictures.py", "services/view/*.py", "urdf/materials.xacro", "meshes/*.dae", "meshes/*.stl")
UNSEEN = ("__init__", "__main__", "drive", "foxglove_server", "guard", "pad", "playback")
"""The modules of the view that no picture shows."""
WEBGL = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
SETTLED = 3000  # ms for a software renderer
SIZE = {"width": 1120, "height": 630}
TRIES = 9  # of a picture while a key is held, which fails on a busy machine
ROBOTS = {
    "hb_bot.urdf.xacro": (0.2, 1.5), "omni.urdf.xacro": (0.0, 0.1), "mecanum.urdf.xacro": (0.2, -1.1),
    "mecanum_rollers.urdf.xacro": (1.2, -0.9), "differential.urdf.xacro": (1.0, 0.0), "wheely_boi.xacro": (0.7, 0.5),
    "rover.urdf.xacro": (-0.8, 0.6), "explorer.urdf.xacro": (2.0, 1.2),
}  # fmt: skip
"""Each robot of urdf/, and its x and y in m."""


def made_of(name: str) -> str:
    """The hash of all files that a picture shows."""
    found = hashlib.sha256()
    for path in sorted({path for pattern in (*IN_ALL, *PICTURES[name][1]) for path in REPO.glob(pattern)}):
        if path.parent.name != "view" or path.stem not in UNSEEN:
            found.update(path.name.encode() + path.read_bytes())
    return found.hexdigest()


def notes() -> dict[str, str]:
    """The hash that each picture had when it was taken."""
    lines = NOTE.read_text().splitlines() if NOTE.exists() else []
    return {name: digest for digest, name in map(str.split, lines)}


def main() -> None:
    """Take the pictures that are out of date."""
    from playwright.sync_api import sync_playwright

    from holozen.testing import Wire

    taken = notes()
    flags = ["--no-sandbox", *WEBGL]
    with sync_playwright() as playwright:
        for name, (take, _) in PICTURES.items():
            if taken.get(name) != made_of(name):
                # A page that stays open goes on drawing, in the process that has to draw the next one too.
                with (
                    Wire() as wire,
                    playwright.chromium.launch(executable_path=shutil.which("chromium"), args=flags) as browser,
                ):
                    take(wire, browser, REPO / "docs" / name)
                taken[name] = made_of(name)
                NOTE.write_text("".join(f"{taken[one]}  {one}\n" for one in PICTURES if one in taken))


def explorer(wire: Any, browser: Any, path: Path) -> None:
    """A robot in the arena, with its frames and what its lidar sees."""
    wire.start("sim", "--robot", "urdf/explorer.urdf.xacro", "--world", WORLD).wait_for_line("listens on")
    page = opened(wire, browser)
    page.get_by_role("tab", name="Displays").click()
    for name in ("LaserScan: scan", "TF"):
        page.get_by_text(name, exact=True).click()
    page.wait_for_timeout(SETTLED)
    page.screenshot(path=path)


def robots(wire: Any, browser: Any, path: Path) -> None:
    """All robots of urdf/, side by side."""
    wire.start("sim", "--empty").wait_for_line("sim: ")
    for file, (x, y) in ROBOTS.items():
        done = wire.run("spawn", f"urdf/{file}", "--name", file.partition(".")[0], "-x", str(x), "-y", str(y))
        assert done.returncode == 0, done.stderr
    page = opened(wire, browser)
    open_panels = page.locator(".tabler-icon-minus:visible")
    while open_panels.count():
        open_panels.first.click()
    page.mouse.move(0, 0)
    page.wait_for_timeout(SETTLED)
    page.screenshot(path=path)


def teleop_and_view(wire: Any, browser: Any, path: Path) -> None:
    """The teleop in a terminal, and what it drives."""
    import pyte

    from tests.unit.teleop.picture import COLUMNS, ROWS, svg

    wire.start("sim", "--world", WORLD).wait_for_line("listens on")
    page = opened(wire, browser, width=700)
    with wire.terminal("teleop", size=(COLUMNS, ROWS)) as terminal, ThreadPoolExecutor() as operator:
        terminal.wait_for_text("listening")
        for _ in range(TRIES):
            held = operator.submit(terminal.hold, "u", 5.0)
            time.sleep(3.0)
            shot, drawn = page.screenshot(), terminal.raw
            driven = page.get_by_text("driven by teleop").is_visible()
            held.result()
            screen = pyte.Screen(COLUMNS, ROWS)
            pyte.Stream(screen).feed(drawn.replace("\x1b[0;2m", "\x1b[0;90m"))
            text = "".join(screen.display)
            if "you drive" in text and "late:" not in text and driven:
                break
        else:
            raise SystemExit("pictures: this machine is too busy for a picture of the teleop; try again later")
    page.close()
    side = browser.new_page(viewport={"width": 1400, "height": 630})
    picture = base64.b64encode(shot).decode()
    side.set_content(
        '<body style="margin:0;display:flex;align-items:center"><style>svg{width:700px;height:auto}</style>'
        f'{svg(screen)}<img src="data:image/png;base64,{picture}" width="700"></body>'
    )
    side.screenshot(path=path)


def opened(wire: Any, browser: Any, width: int = SIZE["width"]) -> Any:
    """A page of the view."""
    view = wire.start("view", "--port", "0")
    view.wait_for_line("http://")
    page = browser.new_page(viewport=SIZE | {"width": width})
    page.goto(next(word for word in view.err.split() if word.startswith("http://")))
    page.get_by_text("Software WebGL").locator("xpath=../..").get_by_role("button").dispatch_event("click")
    return page


Take = Callable[[Any, Any, Path], None]
PICTURES: dict[str, tuple[Take, tuple[str, ...]]] = {
    "view.png": (explorer, ("urdf/explorer.urdf.xacro", WORLD)),
    "robots.png": (robots, tuple(f"urdf/{file}" for file in (*ROBOTS, "wheels.xacro"))),
    "teleop-and-view.png": (
        teleop_and_view,
        ("urdf/hb_bot.urdf.xacro", WORLD, "services/teleop/view.py", "services/teleop/screen.py"),
    ),
}
"""The function that takes each picture, and the files that it shows besides IN_ALL."""

if __name__ == "__main__":
    main()
