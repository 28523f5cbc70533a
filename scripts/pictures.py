"""Takes the pictures of docs/ that are older than what they show, of the page of `holozen view`.

Each has a line in docs/pictures.sha256 with the hash of all files that it shows. `pictures gallery`
takes the page in all its states at the sizes of desks and phones, in build/gallery, for whoever
changes how it looks.
"""

import base64
import hashlib
import io
import shutil
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

REPO = Path(__file__).parents[1]
NOTE = REPO / "docs" / "pictures.sha256"
WORLD = "worlds/arena.world"
IN_ALL = (
    "scripts/pictures.py",
    "extensions/view/*.py",
    "extensions/view/page/*",
    "urdf/materials.xacro",
    "meshes/*.dae",
    "meshes/*.stl",
)
UNSEEN = (
    "__init__",
    "__main__",
    "cockpit",
    "drive",
    "foxglove_server",
    "guard",
    "helm",
    "playback",
    "protocol",
    "scenes",
    "seat",
    "server",
    "timed",
    "worker",
)
"""The modules of the view that no picture shows."""
WEBGL = ("--enable-unsafe-swiftshader",)
SETTLED = 4000  # ms for a software renderer
SIZE = {"width": 1280, "height": 800}
PHONE = {"is_mobile": True, "has_touch": True}
SIZES: dict[str, dict[str, Any]] = {
    "1280x800": {"viewport": SIZE},
    "1920x1080": {"viewport": {"width": 1920, "height": 1080}},
    "390x844": {"viewport": {"width": 390, "height": 844}, **PHONE},
    "844x390": {"viewport": {"width": 844, "height": 390}, **PHONE},
}
"""The sizes of the gallery."""
PATIENCE = 120_000  # ms
COLORS = 1000  # in a picture of the scene that shows a robot
TRIES = 9  # of a picture while a key is held, which fails on a busy machine
ROBOTS = {
    "hb_bot.urdf.xacro": (0.2, 1.5),
    "omni.urdf.xacro": (0.0, 0.1),
    "mecanum.urdf.xacro": (0.2, -1.1),
    "mecanum_rollers.urdf.xacro": (1.2, -0.9),
    "differential.urdf.xacro": (1.0, 0.0),
    "wheely_boi.xacro": (0.7, 0.5),
    "rover.urdf.xacro": (-0.8, 0.6),
    "explorer.urdf.xacro": (2.0, 1.2),
}
"""Each robot of urdf/, and its x and y in m."""


def made_of(name: str) -> str:
    """The hash of all files that a picture shows."""
    found = hashlib.sha256()
    for path in sorted(
        {path for pattern in (*IN_ALL, *PICTURES[name][1]) for path in REPO.glob(pattern)}
    ):
        if path.parent.name not in ("view", "page") or path.stem not in UNSEEN:
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
        if sys.argv[1:] == ["gallery"]:
            with playwright.chromium.launch(
                executable_path=shutil.which("chromium"), args=flags
            ) as browser:
                gallery(browser, REPO / "build" / "gallery")
            return
        for name, (take, _) in PICTURES.items():
            if taken.get(name) != made_of(name):
                # A page that stays open goes on drawing, in the process that has to draw the next
                # one too.
                with (
                    Wire() as wire,
                    playwright.chromium.launch(
                        executable_path=shutil.which("chromium"), args=flags
                    ) as browser,
                ):
                    take(wire, browser, REPO / "docs" / name)
                taken[name] = made_of(name)
                NOTE.write_text(
                    "".join(f"{taken[one]}  {one}\n" for one in PICTURES if one in taken)
                )


def explorer(wire: Any, browser: Any, path: Path) -> None:
    """A robot that is driven in the arena, with its camera and what its lidar sees."""
    wire.start("sim", "--robot", "urdf/explorer.urdf.xacro", "--world", WORLD).wait_for_line(
        "listens on"
    )
    page = opened(wire, browser)
    page.get_by_role("button", name="☰").click()
    page.get_by_label("LaserScan: scan").check()
    page.get_by_role("button", name="☰").click()
    drive(page, path)


def may_be_taken(page: Any) -> bool:
    """Whether the page drives, by a picture that is not covered."""
    return (
        page.locator("#driver:text('you drive')").is_visible()
        and not page.locator("#cover").is_visible()
    )


def phone(wire: Any, browser: Any, path: Path) -> None:
    """The page on a phone."""
    wire.start("sim", "--world", WORLD).wait_for_line("listens on")
    drive(opened(wire, browser, **SIZES["390x844"]), path)


def drive(page: Any, path: Path) -> None:
    """Take a picture while keys are held."""
    for _ in range(TRIES):
        page.keyboard.down("w")
        page.keyboard.down("e")
        page.wait_for_timeout(SETTLED / 2)
        clear = may_be_taken(page)
        shot = page.screenshot()
        drives = clear and may_be_taken(page)
        page.keyboard.up("w")
        page.keyboard.up("e")
        if drives:
            path.write_bytes(shot)
            return
    raise SystemExit("pictures: this machine is too busy for a picture of driving; try again later")


def robots(wire: Any, browser: Any, path: Path) -> None:
    """All robots of urdf/, side by side."""
    wire.start("sim", "--empty").wait_for_line("sim: ")
    for file, (x, y) in ROBOTS.items():
        done = wire.run(
            "spawn", f"urdf/{file}", "--name", file.partition(".")[0], "-x", str(x), "-y", str(y)
        )
        assert done.returncode == 0, done.stderr
    page = opened(wire, browser)
    page.get_by_role("button", name="Free").click()
    page.mouse.move(640, 300)
    for _ in range(3):
        page.mouse.wheel(0, 200)  # farther away
        page.wait_for_timeout(SETTLED / 4)
    page.mouse.move(0, 0)
    page.wait_for_timeout(SETTLED)
    page.screenshot(path=path, clip=page.locator("#stage").bounding_box())


def teleop_and_view(wire: Any, browser: Any, path: Path) -> None:
    """The teleop in a terminal, and what it drives."""
    import pyte

    from tests.core.teleop.picture import COLUMNS, ROWS, svg

    wire.start("sim", "--world", WORLD).wait_for_line("listens on")
    page = opened(wire, browser, viewport={"width": 960, "height": 864})
    with (
        wire.terminal("teleop", size=(COLUMNS, ROWS)) as terminal,
        ThreadPoolExecutor() as operator,
    ):
        terminal.wait_for_text("listening")
        for _ in range(TRIES):
            held = operator.submit(terminal.hold, "u", 5.0)
            time.sleep(3.0)
            shot, drawn = page.screenshot(), terminal.raw
            driven = page.get_by_text("teleop drives").is_visible()
            held.result()
            screen = pyte.Screen(COLUMNS, ROWS)
            pyte.Stream(screen).feed(drawn.replace("\x1b[0;2m", "\x1b[0;90m"))
            text = "".join(screen.display)
            if "you drive" in text and "late:" not in text and driven:
                break
        else:
            raise SystemExit(
                "pictures: this machine is too busy for a picture of the teleop; try again later"
            )
    page.close()
    side = browser.new_page(viewport={"width": 1400, "height": 630})
    picture = base64.b64encode(shot).decode()
    side.set_content(
        "<body "
        'style="margin:0;display:flex;align-items:center"><style>svg{width:700px;height:auto}</style>'
        f'{svg(screen)}<img src="data:image/png;base64,{picture}" width="700"></body>'
    )
    side.screenshot(path=path)


def opened(wire: Any, browser: Any, **options: Any) -> Any:
    """A page of the view, once it shows the scene."""
    view = wire.start("view", "--port", "0")
    view.wait_for_line("http://")
    page = browser.new_context(**{"viewport": SIZE, **options}).new_page()
    page.set_default_timeout(PATIENCE)
    page.goto(next(word for word in view.err.split() if word.startswith("http://")))
    page.locator("#driver:not(:empty)").wait_for()
    for _ in range(60):  # s
        page.wait_for_timeout(1000)
        if page.locator("#sheet").is_visible() or is_drawn(page):
            break
    page.wait_for_timeout(SETTLED)
    return page


def is_drawn(page: Any) -> bool:
    """Whether the scene shows more than the sky."""
    from PIL import Image

    with Image.open(
        io.BytesIO(page.screenshot(clip=page.locator("#stage").bounding_box()))
    ) as picture:
        return len(picture.convert("RGB").getcolors(1 << 24) or ()) > COLORS


def gallery(browser: Any, folder: Path) -> None:
    """Take the page in all its states at all SIZES."""
    from holozen.testing import Wire

    folder.mkdir(parents=True, exist_ok=True)

    def take(state: str, *sims: tuple[str, ...], act: Callable[[Any, Path], None]) -> None:
        for size, options in SIZES.items():
            with Wire() as wire:
                for words in sims:
                    if words[0] == "sim":
                        wire.start(*words).wait_for_line("sim: ")
                    else:
                        wire.run(*words)
                page = opened(wire, browser, **options)
                act(page, folder / f"{state}-{size}.png")
                page.context.close()

    def still(page: Any, path: Path) -> None:
        page.screenshot(path=path)

    def by_camera(page: Any, path: Path) -> None:
        page.locator("#picture .swap").click()
        drive(page, path)

    def stopped(page: Any, path: Path) -> None:
        page.keyboard.press("Space")
        page.get_by_role("button", name="Release", exact=True).wait_for()
        page.screenshot(path=path)

    take("driving", ("sim", "--world", WORLD), act=drive)
    take(
        "by-camera", ("sim", "--robot", "urdf/explorer.urdf.xacro", "--world", WORLD), act=by_camera
    )
    take("ten", ("sim", "--empty"), ("spawn", "urdf/hb_bot.urdf.xacro", "--count", "10"), act=drive)
    take("stopped", ("sim", "--world", WORLD), act=stopped)
    take("no-sim", act=still)


Take = Callable[[Any, Any, Path], None]
PICTURES: dict[str, tuple[Take, tuple[str, ...]]] = {
    "view.png": (explorer, ("urdf/explorer.urdf.xacro", WORLD)),
    "view-phone.png": (phone, ("urdf/hb_bot.urdf.xacro", WORLD)),
    "robots.png": (robots, tuple(f"urdf/{file}" for file in (*ROBOTS, "wheels.xacro"))),
    "teleop-and-view.png": (
        teleop_and_view,
        ("urdf/hb_bot.urdf.xacro", WORLD, "services/teleop/view.py", "services/teleop/screen.py"),
    ),
}
"""The function that takes each picture, and the files that it shows besides IN_ALL."""

if __name__ == "__main__":
    main()
