"""A hook of MkDocs: what the site has besides docs/, and links that lead out of docs/.

README.md is its first page and CHANGELOG.md another. Files of problems/ and examples/ that a page
links to are copied beside the pages, so that the links lead somewhere without a network.
"""

from __future__ import annotations

import re
from pathlib import Path
from posixpath import relpath
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the tests of this module do without MkDocs
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = {"README.md": "index.md", "CHANGELOG.md": "changelog.md"}
"""Pages outside of docs/, and their names in the site."""
FOLDERS = ("problems", "examples")
"""Folders that pages link to."""
_LINK = re.compile(r"(\]\()([^)#:]+)((?:#[^)]*)?\))")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages and files that are not in docs/."""
    from mkdocs.structure.files import File

    for source, name in PAGES.items():
        text = (ROOT / source).read_text(encoding="utf-8")
        files.append(File.generated(config, name, content=with_site_links(text, folder=ROOT)))
    for folder in FOLDERS:
        for file in sorted((ROOT / folder).rglob("*.*")):
            if file.suffix in (".yaml", ".csv", ".py", ".ipynb"):
                name = file.relative_to(ROOT).as_posix()
                files.append(File.generated(config, name, abs_src_path=str(file)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Replace links of a page of docs/ that lead out of that folder."""
    if page.file.src_uri in PAGES.values():
        return markdown
    return with_site_links(markdown, folder=(DOCS / page.file.src_uri).parent)


def with_site_links(markdown: str, *, folder: Path) -> str:
    """A page's text with links to files as the site has them; ``folder``: where the page is."""
    inside = folder.relative_to(DOCS).as_posix() if folder.is_relative_to(DOCS) else "."

    def as_in_site(link: re.Match[str]) -> str:
        target = (folder / link[2]).resolve()
        if not target.is_relative_to(ROOT):
            return link[0]
        name = target.relative_to(ROOT).as_posix()
        place = PAGES.get(name, name.removeprefix("docs/"))
        return link[1] + relpath(place, inside) + link[3]

    return _LINK.sub(as_in_site, markdown)
