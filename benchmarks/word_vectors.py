"""Do static word vectors let a network understand unseen names? ``python -m benchmarks.word_vectors`` asks it.

A graph encoder, gated by the instruction, learns to say whether the object that an instruction names is among eight
nodes. It learns from the sentences and names of training alone, with and without the vectors, and is asked about the
names of training and about those held out of it. Guessing is right in half of the questions.
"""

import argparse

import numpy as np
import torch
from gymnasium import spaces
from torch import Tensor, nn

from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.learning.networks import build_encoder
from chmarl_pb.tasks import language
from chmarl_pb.tasks.language.instructions import phrase
from chmarl_pb.tasks.language.templates import INSTRUCTIONS

NODES, BATCH, ASKED = 8, 64, 4_000
SPACE = spaces.Dict(
    {
        "instruction": spaces.Box(0, language.vocabulary_size() - 1, (language.INSTRUCTION_LENGTH,), np.int16),
        "node_class": spaces.Box(0, len(BENCHMARK.rows), (NODES,), np.int16),
        "node_state": spaces.Box(0, len(BENCHMARK.states), (NODES,), np.int16),
        "edges": spaces.Box(0, NODES, (1, 3), np.int16),
    }
)

Question = dict[str, Tensor]


def questions(rng: np.random.Generator, count: int, held_out: bool) -> tuple[Question, Tensor]:
    """Return questions (count) and the answers, whether X is among the nodes; of names held out of training, or not."""
    objects, places = ([*kind.values()] for kind in (BENCHMARK.graspables, BENCHMARK.receptacles))
    tokens, nodes = np.zeros((count, language.INSTRUCTION_LENGTH), np.int16), np.zeros((count, NODES), np.int16)
    answers = rng.integers(2, size=count)
    for row in range(count):
        chosen = [objects[number] for number in rng.permutation(len(objects))[: NODES + 1]]
        x, y = (
            kind.names[rng.choice([n for n, name in enumerate(kind.names) if name.held_out == held_out])]
            for kind in (chosen[0], places[rng.integers(len(places))])
        )
        template = INSTRUCTIONS.train[rng.integers(len(INSTRUCTIONS.train))]
        tokens[row] = language.tokenize(phrase(template, x, y, True, True), language.INSTRUCTION_LENGTH)
        nodes[row] = [BENCHMARK.class_ids[kind.name] for kind in (chosen[:NODES] if answers[row] else chosen[1:])]
    asked = {"instruction": tokens, "node_class": nodes, "node_state": np.ones_like(nodes)}
    asked["edges"] = np.zeros((count, 1, 3), np.int16)
    return {key: torch.from_numpy(part) for key, part in asked.items()}, torch.from_numpy(answers).float()


def trained(word_vectors: bool, steps: int, seed: int) -> nn.Module:
    """Return a network after some gradient steps on questions with names of training."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    encoder = build_encoder(SPACE, 64, graph_pool="gated", word_vectors=word_vectors)
    network = nn.Sequential(encoder, nn.Linear(64, 1), nn.Flatten(0))
    optimizer = torch.optim.Adam(network.parameters(), lr=2e-3)
    for _ in range(steps):
        asked, answers = questions(rng, BATCH, held_out=False)
        loss = nn.functional.binary_cross_entropy_with_logits(network(asked), answers)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    return network.eval()


@torch.no_grad()
def right(network: nn.Module, held_out: bool) -> float:
    """Return the share of right answers."""
    asked, answers = questions(np.random.default_rng(1_000_000), ASKED, held_out)
    return float(((network(asked) > 0) == (answers > 0)).float().mean())


def main() -> int:
    """Run the command; return its exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.word_vectors", description=__doc__.split("\n")[0])
    parser.add_argument("--steps", type=int, default=2_000, help="gradient steps (default: %(default)s)")
    parser.add_argument("--seeds", type=int, default=1, help="networks of each kind (default: %(default)s)")
    options = parser.parse_args()
    torch.set_num_threads(1)
    print("| right answers, % | names of training | held-out names |\n|---|--:|--:|", flush=True)
    for name, word_vectors in (("learned table", False), ("word vectors", True)):
        networks = [trained(word_vectors, options.steps, seed) for seed in range(options.seeds)]
        shares = [100 * np.mean([right(network, held_out) for network in networks]) for held_out in (False, True)]
        print(f"| {name} | {shares[0]:.1f} | {shares[1]:.1f} |", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
