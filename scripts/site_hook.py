"""What the site has besides docs/: pages from elsewhere in the repository, and each file that a
page links to.
"""

import re
from pathlib import Path, PurePosixPath
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from pymdownx.slugs import slugify

REPO = Path(__file__).parents[1]
PAGES = {
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "examples/fleet/README.md": "fleet.md",
}
LINK = re.compile(
    r"(?P<before>\]\(|(?:src|href)=\")(?P<path>[^)\"#\s:]+)(?P<after>#[^)\"\s]*)?(?=[)\"])"
)
UNSEARCHED = "---\nsearch: {exclude: true}\n---\n"
LANGUAGES = {".world": "xml", ".xacro": "xml", ".svg": "xml", ".json5": "json"}


def on_config(config: MkDocsConfig) -> None:
    """Make the same anchors as GitHub, where the same pages are read."""
    config.mdx_configs["toc"]["slugify"] = slugify(case="lower")


def source(page: File) -> Path:
    """The path, in the repository, of the file that a page is made from."""
    return next(
        (Path(path) for path, uri in PAGES.items() if uri == page.src_uri),
        Path("docs", page.src_uri),
    )


def place(path: PurePosixPath) -> str:
    """The path of a file of the repository in the site."""
    if str(path) in PAGES:
        return PAGES[str(path)]
    if path.parts[0] == "docs":
        return str(path.relative_to("docs"))
    return f"files/{path}" if path.suffix == ".png" else f"files/{path}.md"


def targets(text: str, folder: Path) -> list[tuple[re.Match[str], PurePosixPath]]:
    """The links of a page, each with the path in the repository that it leads to."""
    code = [block.span() for block in re.finditer(r"^```.*?^```$|`[^`\n]+`", text, re.M | re.S)]
    found = [
        link
        for link in LINK.finditer(text)
        if not any(start <= link.start() < end for start, end in code)
    ]
    paths = [(REPO / folder / link["path"]).resolve().relative_to(REPO) for link in found]
    return [(link, PurePosixPath(path)) for link, path in zip(found, paths, strict=True)]


def on_files(files: Files, config: MkDocsConfig) -> None:
    for path, uri in PAGES.items():
        files.append(File.generated(config, uri, content=(REPO / path).read_text()))
    files.append(
        File.generated(
            config, "files/meshes/logo.png", content=(REPO / "meshes/logo.png").read_bytes()
        )
    )
    for page in list(files.documentation_pages()):
        for _, target in targets(page.content_string, source(page).parent):
            uri, file = place(target), REPO / target
            if uri.startswith("files/") and not files.get_file_from_path(uri):
                if not file.is_file():
                    raise PluginError(f"{source(page)} links to {target}, which is not a file")
                if file.suffix == ".png":
                    content: str | bytes = file.read_bytes()
                else:
                    language = LANGUAGES.get(file.suffix, file.suffix[1:])
                    content = f"{UNSEARCHED}# {target}\n\n````{language}\n{file.read_text()}````\n"
                files.append(File.generated(config, uri, content=content))


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Turn the links of a page, which are paths in the repository, into paths in the site."""
    if page.file.src_uri.startswith("files/"):
        return markdown
    here, done, end = PurePosixPath(page.file.src_uri).parent, [], 0
    for link, path in targets(markdown, source(page.file).parent):
        up = len(here.parts)
        to = "../" * up + place(path)
        done += [markdown[end : link.start()], link["before"], to, link["after"] or ""]
        end = link.end()
    return "".join(done) + markdown[end:]
