"""`python -m training.publish RUN NAME`: let the weights of a finished run come with the package, under a name.

The checkpoint is copied to ``results/weights``, and the manifest there gets a row: what the file is, by which command
it was trained, what it observes, its track, and the figures of its result.
"""

import argparse
import json
import shutil
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from chmarl_pb.assets import WEIGHTS_DIR
from chmarl_pb.envs.options import Options
from chmarl_pb.envs.tracks import PAPER
from chmarl_pb.errors import OptionError, ResultError
from chmarl_pb.files import file_hash, replacing, unsealed_or_plain
from chmarl_pb.learning.runs.interrupts import run_command
from chmarl_pb.policies.registry import BUILT_IN
from chmarl_pb.policies.weights import MOST_BYTES, POLICY, Weights, read_manifest, write_manifest
from chmarl_pb.reading import read_regular
from training.score import SCORES

CHECKPOINTS = ("best.pt", "best.zip")  # files of a run's folder


def publish(run: Path, name: str, result: Path | None = None, by: str = "", folder: Path = WEIGHTS_DIR) -> Weights:
    """Copy a checkpoint beside the manifest and add its row; one of the same name is replaced.

    Args:
        run: folder of a run that ``training.table`` or ``training.score`` has evaluated, or a checkpoint.
        name: of the policy.
        result: file with its figures; None: the ``scores.json`` of the run's folder.
        by: the command that trained it; "": the one that the result names.
        folder: of the manifest.

    Raises:
        OptionError: there is no checkpoint, the name cannot be used, or all weights together would be too large.
        ResultError: the figures are missing, damaged, or those of other weights.
    """
    if name in BUILT_IN or not name.replace("-", "").isalnum():
        raise OptionError(f"{name!r}: name weights by letters, digits and hyphens, and not as a built-in policy")
    checkpoint = _checkpoint(run)
    facts = _facts(result or checkpoint.parent / SCORES, file_hash(checkpoint))
    rows = read_manifest(folder)
    if name in rows and rows[name].kind != POLICY:
        raise OptionError(f"{name!r}: an encoder has this name; choose another")
    others = sum(_size(folder / row.file, row) for row in rows.values() if row.name != name)
    if (size := others + checkpoint.stat().st_size) > MOST_BYTES:
        raise OptionError(f"{checkpoint}: all weights would have {size:,} bytes, more than {MOST_BYTES:,}")
    row = Weights(
        name, f"{name}{checkpoint.suffix}", file_hash(checkpoint), POLICY, by or facts["by"], facts["observation"],
        facts["options"].pop("track", PAPER), facts["options"], facts["published"], str(result or ""),
    )  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    with replacing(folder / row.file) as temporary:
        shutil.copyfile(checkpoint, temporary)
    write_manifest(folder, {**rows, name: row})
    if name in rows and rows[name].file != row.file:
        (folder / rows[name].file).unlink(missing_ok=True)
    return row


def _size(file: Path, row: Weights) -> int:
    """Return the bytes of a published file.

    Raises:
        OptionError: it is not there.
    """
    if not file.is_file():
        raise OptionError(f"{file}: the weights {row.name!r} of the manifest beside it are not there; get them again")
    return file.stat().st_size


def _checkpoint(run: Path) -> Path:
    if run.is_file():
        return run
    found = [run / name for name in CHECKPOINTS if (run / name).is_file()]
    if len(found) != 1:
        raise OptionError(f"{run}: has {len(found)} of {', '.join(CHECKPOINTS)}; name a finished run, or a checkpoint")
    return found[0]


def _facts(path: Path, sha256: str) -> dict[str, Any]:
    """Return what a result tells of a checkpoint."""
    if not path.exists():
        raise ResultError(f"{path}: no such result; run `python -m training.score`, or name one by --result")
    try:
        content = unsealed_or_plain(read_regular(path).decode("utf-8"))
        played = content["evaluation"]
        if content["checkpoint"]["sha256"] != sha256:
            raise ValueError("its figures are those of other weights")
        return {
            "by": content.get("commands", {}).get("train", ""),
            "observation": played["observation"],
            "options": _unusual(played["options"]),
            "published": {split: _figures(one["summary"]) for split, one in played["splits"].items()},
        }
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ResultError(f"{path}: not the result of these weights: {error}; evaluate them again") from error


def _unusual(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options of an evaluation that are not the paper's."""
    usual = Options().recorded()
    return {name: value for name, value in options.items() if name not in usual or value != usual[name]}


def _figures(summary: Mapping[str, Any]) -> dict[str, float]:
    return {name: round(float(summary[name]["mean"]), 6) for name in ("success_rate", "plw")}


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m training.publish", description="Let the weights of a finished run come with the package.",
        epilog="example: python -m training.publish out/tables/scene-graph/qmix-messages-seed0 qmix-graphs "
        "--result results/scene-graph/qmix-messages-seed0.json",
    )  # fmt: skip
    parser.add_argument("run", type=Path, metavar="RUN", help="folder of a run, or a checkpoint")
    parser.add_argument("name", metavar="NAME", help="by which the policy is asked for")
    parser.add_argument("--result", type=Path, metavar="JSON", help="file with its figures (default: RUN/scores.json)")
    parser.add_argument("--by", default="", metavar="COMMAND", help="that trained it (default: as the result has it)")
    parser.add_argument("--folder", type=Path, default=WEIGHTS_DIR, help="of the manifest (default: %(default)s)")
    return run_command(partial(_main, parser.parse_args(arguments)))


def _main(chosen: argparse.Namespace) -> int:
    row = publish(chosen.run, chosen.name, chosen.result, chosen.by, chosen.folder)
    print(f"{chosen.folder / row.file}: {row.name}, sha256 {row.sha256}")
    print(json.dumps(row.published))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
