"""`python -m training.score`: evaluate one checkpoint on the splits of the tables; killed, it goes on."""

import argparse
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import torch

import chmarl_pb
from chmarl_pb import learning
from chmarl_pb.envs.tracks import OF_TRACK
from chmarl_pb.evaluation.paper import SPLITS
from chmarl_pb.evaluation.protocol import Plays
from chmarl_pb.evaluation.provenance import machine, source_hash, versions
from chmarl_pb.evaluation.result import Report
from chmarl_pb.files import Lock, file_hash, sealed, write_atomically
from chmarl_pb.learning.config import FROZEN
from chmarl_pb.learning.policies.side_by_side import play_side_by_side
from chmarl_pb.learning.runs.interrupts import run_command
from chmarl_pb.learning.runs.run import origin
from chmarl_pb.learning.storage.checkpoint import CheckpointError, load, reading
from chmarl_pb.learning.threads import threads
from chmarl_pb.robots.registry import TEAM, listed
from chmarl_pb.tasks.splits import GENERATED_HOMES, LIMITED_SPLITS

SCORES = "scores.json"
_ENDINGS = (".pt", ".zip")  # of the checkpoints of this package, whose facts are kept


def score(
    checkpoint: Path,
    observation: str,
    folder: Path,
    splits: Sequence[str] = SPLITS,
    messages: bool = OF_TRACK,
    feedback: bool = OF_TRACK,
    robots: str = ",".join(TEAM),
) -> dict[str, Any]:
    """Evaluate a checkpoint and return what a table keeps of it; the same call goes on where it was interrupted.

    Args:
        checkpoint: file of weights.
        observation: "scene_graph" or "visual".
        folder: for one result with all episodes for each split, and for ``scores.json``, which is returned.
        splits: to evaluate on.
        messages: whether the robots hear each other; as the checkpoint's rules have it if it is not given.
        feedback: whether they get language feedback, likewise.
        robots: the team, with commas between.

    Raises:
        ChmarlError: the checkpoint cannot be used.
        BusyError: another process plays for this folder.
    """
    if checkpoint.suffix not in _ENDINGS:
        raise CheckpointError(f"{checkpoint}: weights end in {' or '.join(_ENDINGS)}; name such a file")
    if not checkpoint.is_file():
        raise CheckpointError(f"{checkpoint}: no such file; name a checkpoint that is there")
    with Lock(folder / SCORES):
        rules = {"messages": messages, "feedback": feedback, "robots": listed(robots)}
        return _score(checkpoint, observation, folder, splits, rules)


def _score(
    checkpoint: Path, observation: str, folder: Path, splits: Sequence[str], rules: dict[str, Any]
) -> dict[str, Any]:
    sha256 = file_hash(checkpoint)
    reports = {
        split: chmarl_pb.evaluate(
            str(checkpoint), split, observation, workers=1, out=folder / f"{split}.json", reuse=True,
            progress=partial(_show, split), plays=_plays(split), **rules,
        )
        for split in splits
    }  # fmt: skip
    facts = {"sha256": sha256, "learners_sha256": source_hash(learning), **_facts(checkpoint)}
    if file_hash(checkpoint) != sha256:
        raise CheckpointError(f"{checkpoint}: changed while it was evaluated; copy it, or evaluate again")
    kept = {"checkpoint": facts, "evaluation": _kept(reports), "versions": _versions(), "machine": machine()}
    write_atomically(folder / SCORES, sealed(kept))
    return kept


def _plays(split: str) -> Plays | None:
    """Return how a split is played: side by side, unless each environment would have to enter many homes by itself."""
    return None if split in GENERATED_HOMES else play_side_by_side


def _facts(checkpoint: Path) -> dict[str, Any]:
    """Return what a checkpoint of this package tells of its training."""
    if checkpoint.suffix == ".zip":
        from chmarl_pb.learning.sb3.checkpoint import read_model

        config = asdict(read_model(checkpoint)[0])
        return {"kind": "sb3", "config": config, FROZEN: config["frozen"]}
    with reading(checkpoint):
        content = load(checkpoint)
        setting, start = content.get("setting", {}), Path(content["config"].get("start") or ".")
        begun = content.get("begun_with", {})
        if not begun and start.is_file():  # older weights name the file alone
            begun = origin(start)
    return {
        "kind": content["kind"],
        "config": content["config"],
        "validation": content.get("validation") or content.get("figures"),
        "episodes": content.get("episodes"),
        FROZEN: content.get(FROZEN) or setting.get(FROZEN) or "",
        **({"begun_with": begun} if begun else {}),
    }


def _kept(reports: dict[str, Report]) -> dict[str, Any]:
    """Return all but the episodes, and what is the same for all splits only once."""
    first = next(iter(reports.values())).settings
    homes = {home: sha for report in reports.values() for home, sha in report.settings["homes_sha256"].items()}
    return {
        **{key: first[key] for key in ("observation", "options", "seeds", "source_sha256")},
        "homes_sha256": homes,
        "splits": {split: _of_split(report) for split, report in reports.items()},
    }


def _of_split(report: Report) -> dict[str, Any]:
    gain = report.cooperation
    return {
        "tasks": report.settings["tasks"],
        "tasks_sha256": report.settings["tasks_sha256"],
        "seconds": report.run["seconds"],
        "summary": asdict(report.summary),
        "recognition": report.recognition.figures(),
        "per_wording": {name: asdict(summary) for name, summary in report.per_wording.items()},
        "plw_of_tasks": {task.id: round(plw, 6) for task, plw in report.plw_of_tasks.items()},
        "ends": {str(phi): count for phi, count in sorted(Counter(one.potential for one in report.episodes).items())},
        "plw_pair": None if gain is None else gain.plw_pair,
        "cooperation_share": None if gain is None else gain.share,
    }


def _versions() -> dict[str, str]:
    return {**versions(), "torch": str(torch.__version__)}


def _show(split: str, done: int, all: int) -> None:
    if done % 25 == 0 or done == all:
        print(f"{split}: {done} of {all} episodes", flush=True)


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return its exit code."""
    parser = argparse.ArgumentParser(prog="python -m training.score", description=__doc__.split("`: ")[1])
    switch = argparse.BooleanOptionalAction
    parser.add_argument("checkpoint", type=Path)
    parser.add_argument("--observation", choices=("scene_graph", "visual"), default="scene_graph")
    parser.add_argument("--messages", action=switch, default=OF_TRACK, help="whether the robots hear each other")
    parser.add_argument("--feedback", action=switch, default=OF_TRACK, help="whether they get language feedback")
    parser.add_argument("--robots", default=",".join(TEAM), help="the team, with commas between (default: %(default)s)")
    parser.add_argument("--out", type=Path, required=True, help="folder of the results")
    parser.add_argument("--splits", nargs="+", choices=(*SPLITS, *GENERATED_HOMES, *LIMITED_SPLITS), default=SPLITS)
    return run_command(partial(_main, parser.parse_args(arguments)))


@threads(1)  # these networks are too small for more
def _main(chosen: argparse.Namespace) -> int:
    rules = chosen.messages, chosen.feedback, chosen.robots
    score(chosen.checkpoint, chosen.observation, chosen.out, chosen.splits, *rules)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
