"""Networks that draw or count while they learn, as those with dropout and batch normalisation do."""

from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from chmarl_pb.learning import train
from chmarl_pb.learning.algorithms.value import ValueLearner
from chmarl_pb.learning.networks.encoders import build_encoder
from chmarl_pb.learning.rollouts.collect import Collector
from chmarl_pb.learning.rollouts.replay_buffer import ReplayBuffer
from chmarl_pb.learning.runs.validation import by_return
from chmarl_pb.learning.spaces import learner_interface_of
from tests.helpers.small_runs import CONFIGS, EXPERT, SMALL
from tests.helpers.stopping import in_pieces
from tests.helpers.uneven_env import UnevenEnv


class Dropping(nn.Module):
    """The usual encoder with batch normalisation and dropout behind it."""

    def __init__(self, space: Any, size: int, *others: Any, **options: Any):
        super().__init__()
        self.inner = build_encoder(space, size, *others, **options)
        self.behind = nn.Sequential(nn.BatchNorm1d(size), nn.Dropout(0.5))

    def forward(self, observation: Any) -> Tensor:
        found: Tensor = self.behind(self.inner(observation))
        return found


class Noting(Dropping):
    """The same; notes whether it draws where nothing is learned from its features."""

    notes: ClassVar[list[tuple[bool, bool]]] = []

    def forward(self, observation: Any) -> Tensor:
        self.notes.append((torch.is_grad_enabled(), self.training))
        return super().forward(observation)


def _sum(agents: nn.Module) -> float:
    return float(sum(weight.double().sum() for weight in agents.state_dict().values()))


@pytest.mark.parametrize("algorithm", ["vdn", "pqn", "imitation", "mappo"])
def test_a_seed_fixes_what_networks_draw(algorithm: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = replace(CONFIGS[algorithm], encoder=f"{__name__}:{Dropping.__name__}")
    run = partial(train, UnevenEnv, algorithm, config, validate=by_return(8), expert=EXPERT)
    torch.manual_seed(1)
    first = _sum(run().agents)
    torch.manual_seed(2)
    drawn = torch.get_rng_state()
    assert _sum(run().agents) == first and torch.equal(torch.get_rng_state(), drawn)
    result, times = in_pieces(partial(run, folder=tmp_path / "cut"), 13, monkeypatch)
    assert times > 1 and _sum(result.agents) == first


def test_networks_are_played_and_validated_as_they_are_evaluated() -> None:
    learning: list[bool] = []
    returns = by_return(2)

    def validate(collector: Collector, agents: nn.ModuleDict) -> dict[str, float]:
        learning.extend(agent.training for agent in agents.values())
        return returns(collector, agents)

    config = replace(SMALL, encoder=f"{__name__}:{Dropping.__name__}")
    result = train(UnevenEnv, "vdn", config, validate=validate)
    assert learning and not any(learning) and not result.agents.training


@pytest.mark.parametrize("algorithm", ["vdn", "pqn", "mappo"])
def test_targets_and_what_actions_are_compared_with_draw_nothing(algorithm: str) -> None:
    Noting.notes.clear()
    train(UnevenEnv, algorithm, replace(CONFIGS[algorithm], encoder=f"{__name__}:{Noting.__name__}"))
    assert set(Noting.notes) == {(True, True), (False, False)}


def test_targets_begin_as_weights_that_were_given_after_they_were_made() -> None:
    config, interface = replace(SMALL, target_update_interval=1000), learner_interface_of(UnevenEnv())
    learner = ValueLearner("vdn", interface, config)
    with torch.no_grad():
        for weight in learner.networks.parameters():
            weight.fill_(0.25)
    given = {name: value.clone() for name, value in learner.networks.state_dict().items()}
    replay = ReplayBuffer(interface, config.horizon, 8, 1.0)
    with closing(Collector(UnevenEnv, 4, horizon=config.horizon)) as collector:
        for episode in collector.play(learner.agents, learner.choose(0), np.random.default_rng(0), range(4)):
            replay.add(episode)
    assert len(list(learner.learn(replay, np.random.default_rng(0)))) == config.gradient_steps
    assert all(torch.equal(value, given[name]) for name, value in learner._targets.state_dict().items())


def test_targets_have_the_counts_of_the_networks_that_they_copy() -> None:
    config = replace(SMALL, encoder=f"{__name__}:{Dropping.__name__}", target_update_interval=1)
    learner: Any = train(UnevenEnv, "vdn", config).learner
    kept, own = dict(learner._targets.named_buffers()), dict(learner.networks.named_buffers())
    means = [name for name in own if name.endswith("running_mean")]
    assert means and all(torch.equal(kept[name], own[name]) for name in means)


def test_the_usual_validation_plays_in_several_homes_where_homes_are_drawn() -> None:
    seeds: list[int] = []

    class Played:
        episode_return = 0.0

    class Envs:
        envs = (object(),)  # a wrapper of one's own
        episodes_in_a_home = 100

        def play(self, agents: Any, choose: Any, rng: Any, chosen: Any) -> Any:
            seeds.extend(chosen)
            return [Played() for _ in chosen]

    by_return(4)(Envs(), nn.ModuleDict())  # type: ignore[arg-type]
    assert len({seed // 100 for seed in seeds}) == 4
