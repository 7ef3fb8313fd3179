"""Lines of Python by package at several commits: ``python -m tools.lines COMMIT ...``; prints a table for the docs.

*code* leaves out blank lines, comments and docstrings; *all* are all lines.
"""

import ast
import io
import subprocess
import sys
import tokenize
from collections import Counter

_SILENT = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}


def code_lines(source: str) -> int:
    """Return the number of lines with code."""
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in _SILENT:
            lines.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            lines.difference_update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(lines)


def package_of(path: str) -> str:
    """Return the package that a file counts for."""
    folders = path.split("/")[:-1]
    return "/".join(folders[:2] if folders[:1] == ["chmarl_pb"] else folders[:1]) or "."


def count(commit: str) -> dict[str, tuple[int, int]]:
    """Return package -> lines with code and all lines at a commit."""
    code: Counter[str] = Counter()
    every: Counter[str] = Counter()
    for path in _git("ls-tree", "-r", "--name-only", commit).splitlines():
        if path.endswith(".py"):
            source = _git("show", f"{commit}:{path}")
            code[package_of(path)] += code_lines(source)
            every[package_of(path)] += len(source.splitlines())
    return {package: (code[package], every[package]) for package in every}


def _git(*arguments: str) -> str:
    return subprocess.run(["git", *arguments], check=True, capture_output=True, text=True, encoding="utf-8").stdout


def main(commits: list[str]) -> None:
    """Print the table."""
    counts = [count(commit) for commit in commits]
    print("| package |", " | ".join(f"{commit}: code | all" for commit in commits), "|")
    print("| --- |" + " --: | --: |" * len(commits))
    packages = sorted(set().union(*counts))
    for package in packages:
        print(f"| {package} |", " | ".join("{:,} | {:,}".format(*one.get(package, (0, 0))) for one in counts), "|")
    sums = [[sum(column) for column in zip(*one.values(), strict=True)] for one in counts]
    print("| sum |", " | ".join(f"{code:,} | {every:,}" for code, every in sums), "|")


if __name__ == "__main__":
    main(sys.argv[1:] or ["HEAD"])
