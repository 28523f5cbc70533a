"""The documentation as a site: built strictly, it loads nothing from elsewhere, and its search
needs no server.
"""

import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest
from playwright.sync_api import Browser

REPO = Path(__file__).parents[2]

pytestmark = pytest.mark.needs("chromium")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    words = [
        sys.executable,
        "-m",
        "mkdocs",
        "build",
        "--strict",
        "--quiet",
        "--site-dir",
        str(folder),
    ]
    done = subprocess.run(words, cwd=REPO, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


class Parts(HTMLParser):
    """The kinds of elements of a page, and what these load: files beside it, or addresses."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.kinds, self.loads = set[tuple[str, str]](), set[str]()
        self.feed(page.read_text())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        has = {name: value or "" for name, value in attrs}
        if tag != "span":  # which colours code
            self.kinds |= {(tag, name) for name in has.get("class", "").split() or [""]}
        self.loads |= {has[name] for name in ("src", "srcset", "poster", "data") if name in has}
        if tag == "link":
            self.loads.add(has["href"])


def differing(pages: dict[Path, Parts]) -> list[Path]:
    """Of those pages some that have every kind of element: the scripts act by these."""
    seen, found = set[tuple[str, str]](), []
    for page, parts in sorted(pages.items(), key=lambda each: -len(each[1].kinds)):
        if parts.kinds - seen:
            found.append(page)
        seen |= parts.kinds
    return found


def test_a_page_from_the_disk_loads_nothing_from_elsewhere_and_finds_words(
    site: Path, chromium: Browser
) -> None:
    page = chromium.new_page()
    requests, errors = list[str](), list[str]()
    page.on("request", lambda request: requests.append(request.url))
    page.on("console", lambda message: errors.append(f"{message.text} {message.location}"))
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto((site / "index.html").as_uri())
    page.click("input[name=query]")
    page.keyboard.type("planar_move")
    page.wait_for_selector(".md-search-result__item")
    assert "hb_bot" in page.inner_text(".md-search-result__list")
    # 404.html is for servers
    pages = {each: Parts(each) for each in sorted(set(site.rglob("*.html")) - {site / "404.html"})}
    for each, parts in pages.items():
        assert [one for one in parts.loads if not (each.parent / one).is_file()] == [], each
    for each in differing(pages):
        page.goto(each.as_uri())
    assert [url for url in requests if not url.startswith("file:")] == []
    assert errors == []
    page.close()


def test_copying_a_block_of_a_terminal_takes_its_commands_alone(
    site: Path, chromium: Browser
) -> None:
    context = chromium.new_context(permissions=["clipboard-read", "clipboard-write"])
    page = context.new_page()
    page.goto((site / "check.html").as_uri())
    block = page.locator(".highlight", has_text="holozen check urdf/hb_bot").first
    block.hover()
    block.locator("button[data-clipboard-target], .md-code__button").first.click()
    page.wait_for_selector(".md-dialog--active")
    assert (
        page.evaluate("navigator.clipboard.readText()").strip()
        == "holozen check urdf/hb_bot.urdf.xacro"
    )
    context.close()
