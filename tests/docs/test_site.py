"""The built documentation: every page is reached, nothing is loaded from a network, search works.

The build executes the notebooks, whose assertions are their claims.
"""

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(900),
    pytest.mark.skipif(
        find_spec("myst_nb") is None and "VALIDATE_REQUIRE_DOCS" not in os.environ,
        reason="Sphinx and MyST-NB absent: the extra `docs`",
    ),
]
ROOT = Path(__file__).resolve().parents[2]
LOADED = {"script": "src", "link": "href", "img": "src", "iframe": "src", "source": "src"}


class Page(HTMLParser):
    """What a page links to and what a browser loads for it."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        if tag == "a" and (href := values.get("href")):
            self.links.append(href)
        if (name := LOADED.get(tag)) and (address := values.get(name)):
            self.loaded.append(address)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-j", "2",
         "-d", out / "doctrees", ROOT / "docs", out / "html"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-6000:]
    return out / "html"


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Page]:
    files = [file for file in site.rglob("*.html") if "_static" not in file.parts]
    return {file: Page(file.read_text("utf-8")) for file in files}


def local(page: Path, address: str) -> Path:
    path = unquote(urlsplit(address).path)
    return (page.parent / path).resolve() if path else page


def remote(address: str) -> bool:
    return urlsplit(address).scheme not in ("", "data") or address.startswith("//")


def test_every_page_is_reached_from_the_start_page(site: Path, pages: dict[Path, Page]) -> None:
    reached, todo = set[Path](), [site / "index.html"]
    while todo:
        page = todo.pop()
        if page in pages and page not in reached:
            reached.add(page)
            todo += [local(page, link) for link in pages[page].links if not remote(link)]
    assert pages.keys() - reached == {site / "search.html"}  # a form leads there
    assert len(reached) > 30


def test_nothing_is_loaded_from_a_network(site: Path, pages: dict[Path, Page]) -> None:
    loaded = [(page, address) for page in pages for address in pages[page].loaded]
    assert [item for item in loaded if remote(item[1])] == []
    missing = [item for item in loaded if "data:" not in item[1] and not local(*item).is_file()]
    assert missing == []
    for style in site.rglob("*.css"):
        text = style.read_text("utf-8")
        assert not re.search(r"""(?:url\(|@import)\s*["']?(?:https?:)?//""", text), style


def test_words_of_every_page_are_in_the_search_index(site: Path) -> None:
    index = (site / "searchindex.js").read_text("utf-8")
    assert index.startswith("Search.setIndex(")  # a script: pages read it from a file, too
    names = [p.relative_to(ROOT / "docs").with_suffix("") for p in (ROOT / "docs").rglob("*.md")]
    assert [n.as_posix() for n in names if f'"{n.as_posix()}"' not in index] == []


def test_notebooks_were_executed(site: Path) -> None:
    tutorials = ROOT / "docs" / "tutorials"
    for name in ("own_files", *(notebook.stem for notebook in tutorials.glob("*.ipynb"))):
        page = Page((site / "tutorials" / f"{name}.html").read_text("utf-8"))
        assert any("_images/" in address for address in page.loaded), name
