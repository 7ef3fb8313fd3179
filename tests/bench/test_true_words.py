"""What misread words cost: what reads in weights is told the words, and noted as it reads by itself."""

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import torch

import chmarl_pb
from benchmarks.true_words import Readers, misread, read_by
from chmarl_pb.learning import Config
from chmarl_pb.learning.networks import DictEncoder, build_encoder
from chmarl_pb.learning.networks.agents import make_agents
from chmarl_pb.learning.networks.match import named_by
from chmarl_pb.learning.storage.checkpoint import CheckpointError

WEIGHTS = Path(__file__).parents[2] / "results" / "weights" / "ours-grounded.pt"


@pytest.mark.parametrize("told", [False, True])
def test_words_are_read_as_learned_or_by_the_rule(told: bool) -> None:
    with closing(chmarl_pb.parallel_env(track="grounded")) as env:
        readers = Readers(WEIGHTS, told)
        policy = readers(env)
        observations, infos = env.reset(options={"task": "generated-val-010"})  # "on the kitchen range"
        policy.reset(0)
        policy.act(observations, infos)
    tokens = observations["humanoid"]["instruction"]
    assert [reading.misread for reading in readers.made] == [{("stove", "kitchen_counter"): 1}] * len(readers.made)
    encoder = build_encoder(env.observation_space("humanoid"), 16, graph_pool="grounded", taught=True)
    assert isinstance(encoder, DictEncoder)
    tables = encoder._tables("node_class")
    (reading,) = read_by(torch.nn.ModuleList([encoder]), told)
    read = reading(torch.from_numpy(tokens)[None], *tables)
    assert bool(np.array_equal(read.classes[0].argmax(dim=1), named_by(tokens)[0])) == told
    counted = [tuple(row.values()) for row in misread(readers.made)]
    assert counted == [("stove", "kitchen_counter", 1.0), ("any of these", "", 1.0)]


def test_what_reads_by_the_rule_already_is_refused() -> None:
    with closing(chmarl_pb.parallel_env(track="grounded")) as env:
        agents = make_agents(
            {"humanoid": env.observation_space("humanoid")}, {"humanoid": (26, 16)}, Config(graph_pool="parsed")
        )
    with pytest.raises(CheckpointError, match="have not learned to read"):
        read_by(agents, told=True)
