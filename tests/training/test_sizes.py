"""Sizes of the learners: what is counted is what a run does, and the page of the learners shows it."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from torch import nn

from chmarl_pb.learning import train
from chmarl_pb.learning.algorithms.mappo import MappoConfig
from chmarl_pb.learning.algorithms.pqn import PqnConfig
from chmarl_pb.learning.algorithms.value import Config, ValueLearner
from chmarl_pb.learning.config import RunConfig
from training import sizes
from training.games import MATRIX_GAMES, MatrixGame
from training.sizes_of_others import table_of_others

SMALL: dict[str, Any] = {"horizon": 1, "features": 8, "hidden": 8, "validation_interval": 1000}
make_game = partial(MatrixGame, MATRIX_GAMES["additive"])


@pytest.mark.parametrize(
    ("algorithm", "config", "expected"),
    [
        ("qmix", Config(episodes=40, envs=4, learning_starts=10, gradient_steps=3, batch_size=8, **SMALL), 24),
        ("qtran", Config(episodes=6, envs=4, learning_starts=100, gradient_steps=2, batch_size=8, **SMALL), 2),
        ("mappo", MappoConfig(episodes=50, envs=4, buffer_size=16, n_epochs=2, batch_size=6, **SMALL), 20),
        ("pqn", PqnConfig(episodes=50, envs=4, buffer_size=10, n_epochs=3, batch_size=8, **SMALL), 27),
    ],
)
def test_gradient_steps_are_those_of_a_run(algorithm: str, config: RunConfig, expected: int) -> None:
    learner = train(make_game, algorithm, config).learner
    assert learner.updates == sizes.gradient_steps(config) == expected


@pytest.mark.parametrize("interval", [1, 5, 30])
def test_updates_of_targets_are_those_of_a_run(interval: int) -> None:
    config = Config(episodes=40, envs=4, learning_starts=10, gradient_steps=3, batch_size=8, **SMALL)
    config = replace(config, target_update_interval=interval)
    with patch.object(ValueLearner, "_update_targets", autospec=True) as update:
        train(make_game, "vdn", config)
    assert update.call_count == sizes.target_updates(config) == 24 // interval


def test_the_page_of_the_learners_has_the_table() -> None:
    text = (Path(__file__).parents[2] / "docs" / "training_findings.md").read_text(encoding="utf-8")
    assert sizes.table() in text and table_of_others() in text


def test_sizes_of_others_are_those_of_their_layers() -> None:
    recurrent = (nn.Linear(842, 128), nn.GRUCell(128, 128), nn.Linear(128, 10))
    plain = (nn.Linear(842, 64), nn.Linear(64, 64), nn.Linear(64, 10))
    counts = [sum(w.numel() for layer in layers for w in layer.parameters()) for layers in (recurrent, plain)]
    iql, vdn = table_of_others().splitlines()[2:4]
    assert iql == f"| IQL, EPyMARL | 842 | {counts[0]:,} | none |"
    assert vdn == f"| VDN, EPyMARL | 842 | {counts[1]:,} | none |"
