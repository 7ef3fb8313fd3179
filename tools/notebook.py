"""Write the notebook of the quick start from its page: ``python -m tools.notebook``."""

import json
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "quick_start.md"
NOTEBOOK = ROOT / "examples" / "quick_start.ipynb"
_CODE = re.compile(r"^```python\n(.*?)^```\n", re.MULTILINE | re.DOTALL)


def cells(page: str) -> list[tuple[str, str]]:
    """Return the kinds ("markdown" or "code") and texts of the cells of a page, in order."""
    parts = _CODE.split(page)  # text and code by turns
    kinds = ("markdown", "code")
    return [(kinds[number % 2], part.strip("\n")) for number, part in enumerate(parts) if part.strip()]


def notebook(page: str) -> str:
    """Return a page as a notebook of nbformat 4.5, without outputs."""
    rows: list[dict[str, Any]] = []
    for number, (kind, text) in enumerate(cells(page)):
        if kind == "markdown":
            text = re.sub(r"\]\((\w+\.md)", r"](../docs/\1", text)
        source = text.splitlines(keepends=True)
        row: dict[str, Any] = {"cell_type": kind, "id": f"cell-{number}", "metadata": {}, "source": source}
        rows.append(row | ({"execution_count": None, "outputs": []} if kind == "code" else {}))
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    whole = {"cells": rows, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(whole, indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    NOTEBOOK.write_text(notebook(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    print(NOTEBOOK)
