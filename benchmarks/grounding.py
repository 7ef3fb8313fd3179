"""``python -m benchmarks.grounding``: what each part of the grounded encoder brings, one by one.

Robots are cloned from the same episodes of the belief search, which are played once, with encoders that differ in one
thing each; then they play validation tasks. For each row: success and PLW on val-seen and val-unseen, PLW for
instructions in the words of training and in others, and how often a robot acts on what it sees. Rows that are in the
file are not trained again; how many are of other code is said.
"""

import argparse
import json
import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np

from chmarl_pb.extras import needs
from chmarl_pb.files import write_atomically
from chmarl_pb.tasks.splits import VALIDATION

with needs("benchmarks.grounding", "train", script=True):
    import torch  # noqa: F401

import chmarl_pb
from benchmarks.kept import SOURCE, warn_of_other_code
from chmarl_pb.evaluation.provenance import source_hash
from chmarl_pb.evaluation.recognition import total
from chmarl_pb.learning.algorithms.dagger import DAgger, DAggerConfig, expert_mixture
from chmarl_pb.learning.algorithms.registry import make_learner
from chmarl_pb.learning.observation_keys import GOAL
from chmarl_pb.learning.rollouts.batch import Batch
from chmarl_pb.learning.rollouts.collect import Collector
from chmarl_pb.learning.rollouts.replay_buffer import ReplayBuffer
from chmarl_pb.learning.runs.validation import examine, spread_tasks
from chmarl_pb.learning.storage import checkpoint
from chmarl_pb.learning.threads import threads
from chmarl_pb.tasks import language
from chmarl_pb.tasks.task import Task

SPLITS = VALIDATION["train"]
KIND = "demonstrations"
ENVS, HORIZON = 4, 28


@dataclass(frozen=True)
class Row:
    """An encoder.

    Attributes:
        name: in the table.
        settings: of the encoder.
        goal: whether the goal is observed.
    """

    name: str
    settings: dict[str, Any] = field(default_factory=dict)
    goal: bool = False


_GROUNDED = {"graph_pool": "grounded", "word_vectors": True, "grounding_coef": 1.0}
ROWS = (
    Row("mean pool, as in the paper", {"graph_pool": "mean"}),
    Row("mean pool + word vectors", {"graph_pool": "mean", "word_vectors": True}),
    Row("mean pool + grounding loss", {"graph_pool": "mean", "grounding_coef": 1.0}),
    Row("mean pool + numbers past", {"graph_pool": "mean", "numbers_past": True}),
    Row("mean pool + goal", {"graph_pool": "mean"}, goal=True),
    Row("gated pool", {"graph_pool": "gated"}),
    Row("gated pool + word vectors", {"graph_pool": "gated", "word_vectors": True}),
    Row("gated pool + numbers past", {"graph_pool": "gated", "numbers_past": True}),
    Row("grounded pool", {"graph_pool": "grounded"}),
    Row("grounded pool + word vectors", {"graph_pool": "grounded", "word_vectors": True}),
    Row("grounded pool + grounding loss", {"graph_pool": "grounded", "grounding_coef": 1.0}),
    Row("grounded pool + word vectors + grounding loss", _GROUNDED),
    Row("the same + numbers past", {**_GROUNDED, "numbers_past": True}),
    Row("the same + goal", {**_GROUNDED, "numbers_past": True}, goal=True),
    Row("parsed pool + numbers past", {"graph_pool": "parsed", "numbers_past": True}),
    Row(
        "parsed pool + word vectors + numbers past",
        {"graph_pool": "parsed", "word_vectors": True, "numbers_past": True},
    ),
)


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("``: ")[1])
    parser.add_argument("--episodes", type=int, default=800, help="of the belief search (default: %(default)s)")
    parser.add_argument("--updates", type=int, default=250, help="gradient steps of 32 episodes (default: %(default)s)")
    parser.add_argument("--tasks", type=int, default=60, help="of each validation split (default: %(default)s)")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0], help="of the weights (default: 0)")
    parser.add_argument("--rows", type=int, nargs="+", default=range(len(ROWS)), help="numbers of rows, from 0 on")
    parser.add_argument("--data", type=Path, default=Path("out/grounding.pt"), help="keeps the episodes")
    parser.add_argument("--json", type=Path, default=Path("results/encoders.json"), help="keeps the figures")
    chosen = parser.parse_args()
    kept = json.loads(chosen.json.read_text(encoding="utf-8")) if chosen.json.is_file() else {}
    tasks = {split: spread_tasks(split, chosen.tasks) for split in SPLITS}
    warn_of_other_code(chosen.json, kept.values())
    settings = {"episodes": chosen.episodes, "updates": chosen.updates, "tasks": chosen.tasks}
    with threads(1):
        shown = demonstrations(chosen.data, chosen.episodes)
        for seed, row in ((seed, ROWS[number]) for seed in chosen.seeds for number in chosen.rows):
            name = f"{row.name}, seed {seed}"
            if kept.get(name, {}).get("settings") != settings:
                kept[name] = {
                    "settings": settings,
                    SOURCE: source_hash(),
                    **measure(row, seed, shown, chosen.updates, tasks),
                }
                write_atomically(chosen.json, json.dumps(kept, indent=1) + "\n")
                print(name, kept[name], flush=True)
    print(table(kept))


def demonstrations(path: Path, episodes: int) -> ReplayBuffer:
    """Return episodes of the belief search; they are played if the file does not hold them."""
    teacher = partial(chmarl_pb.make_policy, "belief")
    with closing(Collector(partial(chmarl_pb.parallel_env, goal=True), ENVS, teacher, HORIZON)) as collector:
        shown = ReplayBuffer(collector.interface, HORIZON, episodes, memory_gib=4.0)
        if path.is_file():
            shown.restore(checkpoint.load(path, KIND)["replay"])
        if shown.added != episodes:
            shown.added = 0
            agents = make_learner("imitation", collector.interface, DAggerConfig(features=8, hidden=8)).agents
            rng, seeds = np.random.default_rng(0), np.random.default_rng(1).integers(2**31, size=episodes).tolist()
            for first in range(0, episodes, ENVS):
                for episode in collector.play(
                    agents, expert_mixture(1.0), rng, seeds[first : first + ENVS], ask_experts=True
                ):
                    shown.add(episode)
            checkpoint.save(path, KIND, {"replay": shown.state()})
    return shown


def measure(
    row: Row, seed: int, shown: ReplayBuffer, updates: int, tasks: Mapping[str, Sequence[Task]]
) -> dict[str, Any]:
    """Train the row's encoder from the episodes and return how it plays."""
    with closing(Collector(partial(chmarl_pb.parallel_env, goal=row.goal), ENVS, horizon=HORIZON)) as collector:
        learner = make_learner("imitation", collector.interface, DAggerConfig(seed=seed, **row.settings))
        assert isinstance(learner, DAgger)
        start, rng = time.process_time(), np.random.default_rng(seed)
        for _ in range(updates):
            batch = shown.sample(32, rng)
            learner.update(batch if row.goal else without_goal(batch))
        seconds = time.process_time() - start
        learner.agents.eval()
        played = {task: one for of in tasks.values() for task, one in zip(of, examine(collector, learner.agents, of),
                                                                          strict=True)}  # fmt: skip
    groups = {
        **tasks,
        **{
            f"{wording} words": [task for task in played if language.wording_of_task(task) == wording]
            for wording in language.WORDINGS
        },
    }
    figures = {name: [played[task] for task in of] for name, of in groups.items()}
    return {
        **{name: {"success": _per_cent(one.success for one in of), "plw": _per_cent(one.score for one in of)}
           for name, of in figures.items()},
        **total(one.recognition for one in played.values()).figures(),
        "weights": sum(part.numel() for part in learner.agents.parameters()),
        "seconds": round(seconds),
    }  # fmt: skip


def without_goal(batch: Batch) -> Batch:
    """Return a batch in which the goal is not observed."""
    seen = {
        agent: {key: part for key, part in tree.items() if key != GOAL} for agent, tree in batch.observations.items()
    }
    return replace(batch, observations=seen)


def table(kept: Mapping[str, Any]) -> str:
    """Return the figures as a table in Markdown, means over the seeds."""
    columns = (*SPLITS, *(f"{wording} words" for wording in language.WORDINGS))
    lines = [
        f"| encoder | {' | '.join(columns)} | picks | places | weights | s |",
        "|---|" + "--:|" * (len(columns) + 4),
    ]
    for row in ROWS:
        same = [one for name, one in kept.items() if name.startswith(f"{row.name}, seed ")]
        if same:
            cells = [
                " / ".join(f"{fmean(one[column][key] for one in same):.1f}" for key in ("success", "plw"))
                for column in columns
            ]
            cells += [f"{100 * fmean(one.get(key, 0.0) for one in same):.0f}" for key in ("pick_share", "place_share")]
            cells += [f"{fmean(one[key] for one in same):,.0f}" for key in ("weights", "seconds")]
            lines.append(f"| {row.name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _per_cent(values: Iterable[float]) -> float:
    return round(100 * fmean(values), 1)


if __name__ == "__main__":
    main()
