"""Each relative link in the documentation leads to a file, and to a heading of it; others have the
form of one.
"""

import re
from pathlib import Path

REPO = Path(__file__).parents[2]
PAGES = [
    *REPO.glob("*.md"),
    *REPO.glob("docs/**/*.md"),
    *REPO.glob("benchmarks/*.md"),
    *REPO.glob("e*/**/README.md"),
]
EXTERNAL = re.compile(r"https://[\w-]+(\.[\w-]+)+(/[^\s]*)?")


def anchors(page: Path) -> set[str]:
    """The anchors of its headings, as GitHub makes them."""
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.M | re.S)
    headings = re.findall(r"^#+ (.*)$", text, re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_links_lead_somewhere() -> None:
    broken, seen = [], 0
    for page in PAGES:
        for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
            if "://" in link:
                if not EXTERNAL.fullmatch(link):
                    broken.append(f"{page.relative_to(REPO)}: {link}")
                continue
            seen += 1
            path, _, anchor = link.partition("#")
            target = (page.parent / path).resolve() if path else page
            if not target.exists() or (anchor and anchor not in anchors(target)):
                broken.append(f"{page.relative_to(REPO)}: {link}")
    assert seen > 50
    assert broken == []
