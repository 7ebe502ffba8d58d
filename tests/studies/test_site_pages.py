"""Links of pages as the site of documents has them."""

import re
from pathlib import Path

import pytest
import yaml

from studies.site_pages import PAGES, ROOT, with_site_links

MKDOCS = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("folder", "link", "in_site"),
    [
        (".", "[a](docs/theory.md#part)", "[a](theory.md#part)"),
        (".", "![a](docs/gap.png)", "![a](gap.png)"),
        (".", "[a](CHANGELOG.md)", "[a](changelog.md)"),
        ("docs", "[a](../README.md#install)", "[a](index.md#install)"),
        ("docs", "[a](../problems/pick_and_place.yaml)", "[a](problems/pick_and_place.yaml)"),
        ("docs/dev", "![a](../gap.png)", "![a](../gap.png)"),
        ("docs/dev", "[a](../../README.md)", "[a](../index.md)"),
        ("docs", "[a](https://keepachangelog.com)", "[a](https://keepachangelog.com)"),
        ("docs", "[a](#part)", "[a](#part)"),
    ],
)
def test_link_in_the_site(folder, link, in_site):
    assert with_site_links(link, folder=ROOT / folder) == in_site


def test_every_page_is_in_the_navigation_once():
    """MkDocs says so too, where it is installed."""
    listed = re.findall(r"[\w-]+\.md", str(MKDOCS["nav"]))
    pages = [*(file.name for file in Path(ROOT, "docs").glob("*.md")), *PAGES.values()]
    assert sorted(listed) == sorted(pages)
