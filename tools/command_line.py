"""`python -m tools.command_line`: write docs/command_line.md from the parsers of the command line itself."""

import argparse
import io
import os
import re
from collections.abc import Iterator
from contextlib import redirect_stdout, suppress
from pathlib import Path
from unittest import mock

from chmarl_pb.cli import sb3, train
from chmarl_pb.cli.arguments import EXAMPLE
from chmarl_pb.cli.completion import parsers_in
from chmarl_pb.cli.program import COMMANDS, LEARNERS, parser_of
from chmarl_pb.files import write_atomically

PAGE = Path(__file__).parents[1] / "docs" / "command_line.md"
_OPTION = re.compile(r"(?<![\w-])--[a-z][a-z0-9.-]*[a-z0-9]")
_DOUBLED = re.compile(r" \(default: [^()]*\)$")  # what Python before 3.13 adds to switches with two names
_HEAD = """# The command line

Every command has `--help`, ends with exit code 0 on success, 1 if a check failed, 2 on bad input, 128 + N when stopped
by the signal N, and tells what is wrong in one line on the standard error, where progress bars of long work show, too.
Where nobody reads its output any more, as after `| head`, it ends quietly, with 141 (SIGPIPE).

- `--quiet`: no progress bars and no notes; results and errors alone.
- `--json FILE`, where a command reports a result, writes it as JSON, too. `--json -` prints it on the standard output,
  and nothing else there: `chmarl-pb evaluate --policy search --json - | jq .summary.success_rate.mean`. The file is
  written before anything is shown. Of an evaluation it is a summary; single episodes are in the file of `--out`, which
  `report` reads.
- No command writes over a file that it reads, and what it writes has the ending of its kind: `.json`, `.html`, `.png`,
  `.urdf`. `--json FILE`, and `--out` of `evaluate`, `audit` and `episode save`, write anew only what the same command
  has written.
- A policy is a built-in name, that of [weights that come with the package](play.md#watch-without-training), the path of
  a checkpoint, or `module:callable`.

**Completion in a shell** (extra `completion`, which brings [shtab](https://docs.iterative.ai/shtab/)): the script holds
all commands and their options, so no Python starts while you type.

```bash
pip install -e ".[completion]"
chmarl-pb completion bash > ~/.local/share/bash-completion/completions/chmarl-pb
chmarl-pb completion zsh > ~/.zfunc/_chmarl-pb    # with ~/.zfunc in fpath
```

This page is written by `python -m tools.command_line` from the commands themselves.
"""


def reference() -> str:
    """Return the page."""
    parts = [_HEAD]
    for parser in parsers_in(parser_of(COMMANDS)):
        if parser.epilog:
            parts.append(_section(parser))
    return "\n".join([*parts, *(_learner(name) for name in LEARNERS)])


def _section(parser: argparse.ArgumentParser) -> str:
    rows = [row for action in parser._actions for row in _row(parser, action)]
    example = (parser.epilog or "").removeprefix(EXAMPLE)
    table = ["| argument | meaning |", "|---|---|", *rows]
    return "\n".join([f"## {parser.prog}", "", f"{parser.description} `{example}`", "", *table, ""])


def _row(parser: argparse.ArgumentParser, action: argparse.Action) -> Iterator[str]:
    if isinstance(action, argparse._HelpAction | argparse._SubParsersAction) or "--quiet" in action.option_strings:
        return
    two_names = isinstance(action, argparse.BooleanOptionalAction)
    value = "" if action.nargs == 0 or two_names else f" {_value(action)}"
    names = ", ".join(f"`{name}{value}`" for name in action.option_strings) or f"`{value.strip()}`"
    text = (action.help or "") % {**vars(action), "prog": parser.prog}
    text = _DOUBLED.sub("", text) if two_names and "OF_TRACK" in text else text
    choices = f" One of: {', '.join(map(str, action.choices))}." if action.choices and action.metavar is None else ""
    needed = " Required." if action.required and action.option_strings else ""
    yield f"| {names} | {_cell(text)}{needed}{choices} |"


def _value(action: argparse.Action) -> str:
    return str(action.metavar or (action.option_strings or [action.dest])[0].lstrip("-")).upper()


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _learner(command: str) -> str:
    """Return the section of a command whose options tyro reads, which explains them by ``--help``."""
    asked = [[name, "--help"] for name in train.COMMANDS] if command == "train" else [["--help"]]
    options = sorted({option for words in asked for option in learner_options(command, words)})
    example = re.findall(EXAMPLE + "(.*)", (train.ABOUT if command == "train" else sb3.ABOUT))[0]
    told = "`chmarl-pb train --algo NAME --help` explains those of an algorithm" if command == "train" else (
        "`chmarl-pb sb3 --help` explains them"
    )  # fmt: skip
    names = ", ".join(f"`{option}`" for option in options)
    head = f"{LEARNERS[command][0].upper()}{LEARNERS[command][1:]}. `{example}`"
    page = "training.md" if command == "train" else "training_sb3.md"
    return f"## chmarl-pb {command}\n\n{head}\n\n{told}; see [{page}]({page}). All options: {names}.\n"


def learner_options(command: str, words: list[str]) -> set[str]:
    """Return the options that the help of a learner's command names."""
    shown = io.StringIO()
    parse = {"train": train.parse, "sb3": sb3.parse}[command]
    with redirect_stdout(shown), suppress(SystemExit), mock.patch.dict(os.environ, COLUMNS="300", NO_COLOR="1"):
        parse(words)
    return set(_OPTION.findall(shown.getvalue()))


if __name__ == "__main__":
    write_atomically(PAGE, reference())
    print(PAGE)
