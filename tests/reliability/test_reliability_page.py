"""docs/reliability.md names tests that exist, and every kind of file that is fuzzed."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "reliability.md").read_text(encoding="utf-8")


def test_every_test_that_the_page_names_exists() -> None:
    named = re.findall(r"`(tests/[\w/]+\.py)::(\w+)`( \(slow\))?", PAGE)
    assert len(named) > 30
    for file, name, slow in named:
        nodes = ast.parse((ROOT / file).read_text(encoding="utf-8")).body
        found = [node for node in nodes if isinstance(node, ast.FunctionDef) and node.name == name]
        assert found, f"{file}::{name}"
        marks = " ".join(ast.unparse(mark) for mark in found[0].decorator_list)
        assert ("pytest.mark.slow" in marks.split()) == bool(slow), f"{file}::{name}"


def test_every_kind_that_is_fuzzed_has_a_row() -> None:
    pytest.importorskip("torch")
    from tests.hostile.kinds import kinds

    rows = re.findall(r"^\| ([\w ]+) \|", PAGE.partition("## Hostile input")[2].partition("\n## ")[0], re.MULTILINE)
    assert [row for row in rows if row != "kind"] == list(kinds(1))
