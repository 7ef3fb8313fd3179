"""Published weights played without language feedback, beside what they score with it."""

from pathlib import Path
from typing import Any

from chmarl_pb.errors import ResultError
from chmarl_pb.evaluation.paper import SPLITS
from chmarl_pb.files import unsealed_or_plain
from chmarl_pb.policies.weights import read_manifest, weights_folder

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
    published, scores = read_manifest(weights_folder()), {}
    for path in sorted((results / FOLDER).glob("*.json")):
        try:
            content = unsealed_or_plain(path.read_text(encoding="utf-8"))
            if content["checkpoint"]["sha256"] != published[path.stem].sha256:
                raise ValueError("its weights are not the published ones")
            if content["evaluation"]["options"]["feedback"]:
                raise ValueError("it was played with feedback")
            scores[path.stem] = _means(content["evaluation"]["splits"])
        except (KeyError, TypeError, ValueError) as error:
            raise ResultError(f"{path}: not a result without feedback: {error!r}; play it again") from error
    return scores


def _means(splits: dict[str, Any]) -> Scores:
    return {split: {name: splits[split]["summary"][name]["mean"] for name in _METRICS} for split in SPLITS}


def _line(name: str, feedback: str, scores: Any) -> str:
    cells = (" / ".join(f"{100 * scores[split][metric]:.1f}" for metric in _METRICS) for split in SPLITS)
    return f"| {name} | {feedback} | {' | '.join(cells)} |"
