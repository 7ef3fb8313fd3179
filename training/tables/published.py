"""Results of the weights that come with the package, kept as ``training.score`` writes them: NAME.json in a folder."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from chmarl_pb.errors import ResultError
from chmarl_pb.files import unsealed_or_plain
from chmarl_pb.policies.weights import read_manifest, weights_folder
from chmarl_pb.reading import read_regular

Evaluation = dict[str, Any]  # its options, and what was found on each split


def read_published(folder: Path, fault: Callable[[Evaluation], str]) -> dict[str, Evaluation]:
    """Return name of the weights -> their evaluation.

    Args:
        folder: of the files.
        fault: says of an evaluation why it is none of this folder; "" if it is one.

    Raises:
        ResultError: a file is damaged, not of this folder, or of other weights than the published ones of its name.
    """
    published, found = read_manifest(weights_folder()), {}
    for path in sorted(folder.glob("*.json")):
        try:
            content = unsealed_or_plain(read_regular(path).decode("utf-8"))
            if content["checkpoint"]["sha256"] != published[path.stem].sha256:
                raise ValueError("its weights are not the published ones")
            if why := fault(content["evaluation"]):
                raise ValueError(why)
            found[path.stem] = content["evaluation"]
        except (KeyError, TypeError, ValueError) as error:
            raise ResultError(f"{path}: no result of {folder.name}: {error!r}; play it again") from error
    return found
