"""The documents as a site: it builds, fetches nothing, and breaks where a link does."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from importlib import import_module
from pathlib import Path

import pytest
import yaml

pytest.importorskip("material")
pytest.importorskip("robotic")

ROOT = Path(__file__).parents[1]
LOADS = {"script": "src", "img": "src", "iframe": "src", "source": "src", "link": "href"}
FETCHING = ("stylesheet", "preload", "preconnect", "icon", "modulepreload")


def build(root: Path, site: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--site-dir", str(site)],
        cwd=root,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        timeout=120,
    )


class Loads(HTMLParser):
    """Collects what a page loads by itself."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        kind = (given.get("rel") or "").split()
        if tag in LOADS and (tag != "link" or any(each in FETCHING for each in kind)):
            self.found.append(given.get(LOADS[tag]) or "")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    built = build(ROOT, folder)
    assert built.returncode == 0, built.stderr
    assert "WARNING" not in built.stderr
    return folder


def test_every_document_is_a_page(site: Path) -> None:
    for document in (ROOT / "docs").rglob("*.md"):
        page = document.relative_to(ROOT / "docs").with_suffix(".html")
        page = page.with_name("index.html") if page.name == "README.html" else page
        assert (site / page).is_file(), page


def test_no_page_loads_anything_from_elsewhere(site: Path) -> None:
    loaded = []
    for page in site.rglob("*.html"):
        parser = Loads()
        parser.feed(page.read_text(encoding="utf-8"))
        loaded += parser.found
    assert len(loaded) > 100
    assert [url for url in loaded if re.match(r"[a-z]+:|//", url) and "data:" not in url] == []
    styles = "".join(sheet.read_text(encoding="utf-8") for sheet in site.rglob("*.css"))
    assert re.findall(r"(?:@import|url\()\s*[\"']?(?:https?:)?//[^)]*", styles) == []


def test_equations_are_drawn_without_a_script(site: Path) -> None:
    page = (site / "method.html").read_text(encoding="utf-8")
    count = (ROOT / "docs/method.md").read_text(encoding="utf-8").count("```math")
    assert page.count("</math>") == count > 5
    assert "\\gamma" not in re.sub(r"<annotation.*?</annotation>", "", page, flags=re.DOTALL)


@pytest.mark.parametrize("link", ["nowhere.md", "start.md#nowhere"])
def test_a_broken_link_is_an_error(link: str, tmp_path: Path) -> None:
    (tmp_path / "docs").mkdir()
    (tmp_path / "tools").symlink_to(ROOT / "tools")
    text = f"# Start\n\n[broken]({link})\n"
    (tmp_path / "docs/start.md").write_text(text, encoding="utf-8")
    loader = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
    settings = {**loader, "nav": [{"Start": "start.md"}], "hooks": []}
    (tmp_path / "mkdocs.yml").write_text(yaml.safe_dump(settings), encoding="utf-8")
    ended = build(tmp_path, tmp_path / "site")
    assert ended.returncode == 1
    assert "nowhere" in ended.stderr


def names() -> Iterator[str]:
    """Yield the names of the code that the page of the method has."""
    yield from re.findall(r"`(kmn_\w+(?:\.\w+)+)`", (ROOT / "docs/method.md").read_text("utf-8"))


@pytest.mark.parametrize("name", sorted(set(names())))
def test_the_method_names_what_is_in_the_code(name: str) -> None:
    parts = name.split(".")
    modules = [i for i in range(len(parts), 0, -1) if is_module(".".join(parts[:i]))]
    found = import_module(".".join(parts[: modules[0]]))
    for part in parts[modules[0] :]:
        found = getattr(found, part)


def is_module(name: str) -> bool:
    path = ROOT / "src" / name.split(".")[0] / name.replace(".", "/")
    return path.is_dir() or path.with_suffix(".py").is_file()


def test_the_figures_of_the_readme_stand_on_the_pages_that_it_names() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (table,) = re.findall(r"\| task \|.*?\n\n", text, flags=re.DOTALL)
    rows = [row.split("|")[1:-1] for row in table.strip().splitlines()[2:]]
    assert len(rows) > 5
    for task, figures, _, link in rows:
        (page,) = re.findall(r"\((docs/[^)#]+)", link)
        stated = (ROOT / page).read_text(encoding="utf-8")
        for figure in re.findall(r"\d+(?:\.\d+)?(?: of \d+)?", figures):
            whole = rf"(?<![\d.]){re.escape(figure)}(?![\d.]*\d)"
            assert re.search(whole, stated), f"{task}: {figure}"
