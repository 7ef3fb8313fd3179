"""Published weights played without language feedback, beside what they score with it."""

from pathlib import Path
from typing import Any

from chmarl_pb.evaluation.paper import SPLITS
from chmarl_pb.policies.weights import read_manifest, weights_folder
from training.tables.published import read_published

FOLDER = "without-feedback"  # in that of the results: NAME.json, as training.score writes it
_METRICS = ("success_rate", "plw")

NOTE = """## Without feedback at test

The weights that come with the package, which were trained with feedback, also where none is given at test. Cells are
success / PLW, per cent; one training, each task once. A line is made by (pictures: with `--observation visual`)

```
python -m training.score results/weights/ours-graphs.pt --messages --no-feedback --out out/without-feedback/ours-graphs
cp out/without-feedback/ours-graphs/scores.json results/without-feedback/ours-graphs.json
```
"""


Scores = dict[str, dict[str, float]]  # split -> metric -> mean, 0 to 1


def without_feedback(results: Path) -> list[str]:
    """Return the section as Markdown, nothing where no such result is kept.

    Args:
        results: folder of the kept files.

    Raises:
        ResultError: a file is damaged, or of other weights than the published ones of its name.
    """
    published = read_manifest(weights_folder())
    lines = [f"| weights | feedback | {' | '.join(SPLITS)} |", "|---|---|" + "--:|" * len(SPLITS)]
    for name, scores in played_without(results).items():
        lines += [_line(name, "yes", published[name].published), _line("", "no", scores)]
    return [NOTE.strip(), "\n".join(lines)] if len(lines) > 2 else []


def played_without(results: Path) -> dict[str, Scores]:
    """Return the scores without feedback of published weights, by their names.

    Raises:
        ResultError: a file is damaged, or of other weights than the published ones of its name.
    """
    return {name: _means(one["splits"]) for name, one in read_published(results / FOLDER, _fault).items()}


def _fault(evaluation: dict[str, Any]) -> str:
    if evaluation["options"]["feedback"]:
        return "it was played with feedback"
    missing = set(SPLITS) - evaluation["splits"].keys()
    return f"it lacks {min(missing)}" if missing else ""


def _means(splits: dict[str, Any]) -> Scores:
    return {split: {name: splits[split]["summary"][name]["mean"] for name in _METRICS} for split in SPLITS}


def _line(name: str, feedback: str, scores: Any) -> str:
    cells = (" / ".join(f"{100 * scores[split][metric]:.1f}" for metric in _METRICS) for split in SPLITS)
    return f"| {name} | {feedback} | {' | '.join(cells)} |"
