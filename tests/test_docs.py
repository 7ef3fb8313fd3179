"""The documentation: every page is reachable, links lead to files, tutorials and the notebook are what runs."""

import re
from pathlib import Path
from typing import Any

import pytest

from tools.notebook import NOTEBOOK, PAGE, cells, notebook

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))
TOCTREE = re.compile(r"^```\{toctree\}\n(.*?)^```", re.MULTILINE | re.DOTALL)
CODE = re.compile(r"^```.*?^```|`[^`\n]*`(?!\])", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")
EXAMPLES = {path.stem for path in (ROOT / "examples").glob("*.py")}


def listed(page: str) -> set[str]:
    """Return the pages that a page's tables of contents list."""
    text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
    lines = (line for tree in TOCTREE.findall(text) for line in tree.splitlines())
    return {line for line in lines if line and not line.startswith(":")}


def test_every_page_is_reachable_from_the_index() -> None:
    reached, left = {"index"}, ["index"]
    while left:
        new = listed(left.pop()) - reached
        reached |= new
        left += new
    assert reached == {page.stem for page in PAGES}


@pytest.mark.parametrize("page", [*PAGES, ROOT / "README.md", ROOT / "CONTRIBUTING.md"], ids=lambda page: page.name)
def test_links_lead_to_files_of_the_checkout(page: Path) -> None:
    links = LINK.findall(CODE.sub("", page.read_text(encoding="utf-8")))
    missing = [link for link in links if "://" not in link and not (page.parent / link).exists()]
    assert not missing


def test_tutorials_have_all_examples_and_each_is_run_by_a_test() -> None:
    shown = re.findall(r"^\[`examples/(\w+)\.py`\]", (DOCS / "tutorials.md").read_text(encoding="utf-8"), re.MULTILINE)
    run = re.findall(r'example\("(\w+)"\)', (ROOT / "tests" / "test_examples.py").read_text(encoding="utf-8"))
    assert set(shown) == EXAMPLES == set(run) and len(shown) == len(set(shown))


def test_the_notebook_is_the_quick_start() -> None:
    assert NOTEBOOK.read_text(encoding="utf-8") == notebook(PAGE.read_text(encoding="utf-8")), (
        "run python -m tools.notebook"
    )


def test_the_cells_of_the_quick_start_run(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("stable_baselines3")
    scope: dict[str, Any] = {}
    for kind, text in cells(PAGE.read_text(encoding="utf-8")):
        if kind == "code":
            exec(compile(text, str(PAGE), "exec"), scope)
    shown = capsys.readouterr().out
    assert re.search(r"planner +success True, (\d+) steps, at best \1\n", shown)
    assert re.search(r"search +success True", shown) and "PLW" in shown
