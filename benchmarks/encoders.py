"""``python -m benchmarks.encoders``: what the features of a picture cost by each frozen network and arithmetic.

One thread, views of 128 pixels in a home, processor time, the best of some rounds in which all take turns. Rows without
a name are of ResNet-18; that of EfficientNet-Lite0 appears where its packages are installed.
"""

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path

from chmarl_pb.errors import MissingExtraError
from chmarl_pb.extras import needs
from chmarl_pb.files import write_atomically

with needs("benchmarks.encoders", "train", script=True):
    import torch
    from torch import Tensor

from chmarl_pb.learning.networks import detector, efficientnet
from chmarl_pb.learning.networks.frozen import read_weights, weights_file
from chmarl_pb.learning.networks.int8 import IntegerResNet18, ranges_of
from chmarl_pb.learning.networks.labelled_views import Job, layout_views
from chmarl_pb.learning.networks.residual import ResNet18, folded

BATCHES = (1, 2, 16)

Encode = Callable[[Tensor], Tensor]


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("`: ")[1])
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--json", type=Path, help="file for the figures")
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    torch.manual_seed(0)
    images = torch.from_numpy(layout_views(Job("train", task=0, seed=0)).images[: max(BATCHES)])
    rows = encoders(images)
    figures: dict[str, dict[int, float]] = {name: {} for name in rows}
    with torch.no_grad():
        for encode in rows.values():
            encode(images)  # the first call prepares the weights
        for _ in range(chosen.rounds):
            for name, encode in rows.items():
                for size in BATCHES:
                    spent = milliseconds(encode, images[:size])
                    figures[name][size] = min(spent, figures[name].get(size, spent))
    print(f"{'ms a picture, at batch':28}" + "".join(f"{size:8}" for size in BATCHES))
    for name, found in figures.items():
        print(f"{name:28}" + "".join(f"{found[size]:8.2f}" for size in BATCHES))
    if chosen.json:
        write_atomically(chosen.json, json.dumps(figures, indent=1) + "\n")


def milliseconds(encode: Encode, images: Tensor) -> float:
    """Return the processor time of a picture."""
    start = time.process_time()
    encode(images)
    return 1000 * (time.process_time() - start) / len(images)


def encoders(images: Tensor) -> dict[str, Encode]:
    """Return name -> encoder; those of ResNet-18 have the same random weights, the detector its published or own."""
    network = folded(ResNet18().eval().requires_grad_(False)).to(memory_format=torch.channels_last)

    def halves(pictures: Tensor) -> Tensor:
        with torch.autocast("cpu", torch.bfloat16):
            features: Tensor = network(pictures)
            return features

    ranges = ranges_of(network, images)
    rows: dict[str, Encode] = {"float32, channels last": network, "bfloat16": halves}
    rows |= {"int8 (used)": IntegerResNet18(network, ranges)}
    weights = read_weights(weights_file("detector"), "detector")
    floats = detector.read(weights).to(memory_format=torch.channels_last)
    rows |= {"detector, int8 (used)": detector.build(weights), "detector, float32": floats}
    try:
        imagenet = torch.load(efficientnet.weights_file(), weights_only=True)
        rows |= {"EfficientNet-Lite0, float32": efficientnet.build(imagenet)}
    except MissingExtraError as error:
        print(f"without EfficientNet-Lite0: {error}")
    return rows


if __name__ == "__main__":
    main()
