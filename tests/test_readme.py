"""What the README shows is what happens."""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_first_snippet_succeeds_and_prints_what_it_says() -> None:
    snippet = re.findall(r"```python\n(.*?)```", README, re.DOTALL)[0]
    (stated,) = re.findall(r"^print\(.*\)  # (.*)$", snippet, re.MULTILINE)
    assert stated.startswith("True ")
    done = subprocess.run([sys.executable, "-c", snippet], capture_output=True, text=True, timeout=600)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{stated}\n", "")


def test_the_quick_start_is_the_example_word_for_word() -> None:
    example = (ROOT / "examples" / "sb3_quickstart.py").read_text(encoding="utf-8")
    assert f"```python\n{example}```" in README
