"""Takes the picture of docs/view.md and the README from the page of `holozen view`, and notes what it was made of."""

import hashlib
import shutil
from pathlib import Path

REPO = Path(__file__).parents[1]
PICTURE = REPO / "docs" / "view.png"
NOTE = PICTURE.with_suffix(".sha256")
WORLD = "worlds/arena.world"
SHOWN = (
    "scripts/pictures.py", "services/view/*.py", "urdf/explorer.urdf.xacro", "urdf/materials.xacro",
    WORLD, "meshes/base.dae", "meshes/wheel.stl",
)  # fmt: skip
UNSEEN = ("__init__", "__main__", "drive", "foxglove_server", "guard", "pad", "playback")
"""The modules of the view that are not in the picture."""
WEBGL = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
SETTLED = 3000  # ms for a software renderer


def made_of() -> str:
    """The hash of all that is in the picture."""
    found = hashlib.sha256()
    for path in _shown():
        found.update(path.name.encode() + path.read_bytes())
    return found.hexdigest()


def main() -> None:
    """Take the picture."""
    from playwright.sync_api import sync_playwright

    from holozen.testing import Wire

    with Wire() as wire, sync_playwright() as playwright:
        wire.start("sim", "--robot", "urdf/explorer.urdf.xacro", "--world", WORLD).wait_for_line("listens on")
        view = wire.start("view", "--port", "0")
        view.wait_for_line("http://")
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox", *WEBGL])
        page = browser.new_page(viewport={"width": 1120, "height": 630})
        page.goto(next(word for word in view.err.split() if word.startswith("http://")))
        page.get_by_text("Software WebGL").locator("xpath=../..").get_by_role("button").click()
        page.get_by_role("tab", name="Displays").click()
        for name in ("LaserScan: scan", "TF"):
            page.get_by_text(name, exact=True).click()
        page.wait_for_timeout(SETTLED)
        page.screenshot(path=PICTURE)
        browser.close()
    NOTE.write_text(f"{made_of()}\n")


def _shown() -> list[Path]:
    found = {path for pattern in SHOWN for path in REPO.glob(pattern)}
    return sorted(path for path in found if path.parent.name != "view" or path.stem not in UNSEEN)


if __name__ == "__main__":
    main()
