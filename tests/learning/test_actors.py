"""Imitation of an expert, MAPPO, and graphs pooled by the instruction."""

from collections import Counter
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium import spaces
from hypothesis import given, settings
from hypothesis import strategies as st

import chmarl_pb
from chmarl_pb.files import file_hash
from chmarl_pb.learning import train
from chmarl_pb.learning.algorithms.dagger import DAggerConfig, draw, expert_mixture, imitation_loss
from chmarl_pb.learning.algorithms.mappo import Mappo, MappoConfig
from chmarl_pb.learning.algorithms.registry import Algorithm, check_first_weights, make_learner
from chmarl_pb.learning.algorithms.value import Config
from chmarl_pb.learning.benchmark_env import setting_of
from chmarl_pb.learning.config import HOME, TRAINED_IN
from chmarl_pb.learning.networks import build_encoder
from chmarl_pb.learning.rollouts.batch import Batch
from chmarl_pb.learning.rollouts.collect import NO_LABEL, Collector
from chmarl_pb.learning.runs.logger import METRICS, read_rows
from chmarl_pb.learning.runs.loop import expert_name
from chmarl_pb.learning.runs.run import BEST, LAST
from chmarl_pb.learning.runs.validation import play_greedily
from chmarl_pb.learning.spaces import learner_interface_of
from chmarl_pb.learning.storage.checkpoint import CheckpointError, load, save
from chmarl_pb.policies.registry import make_expert, make_policy
from tests.helpers.small_runs import EXPERT, IMITATION, MAPPO, SMALL, Constant
from tests.helpers.uneven_env import UnevenEnv
from training.games import MATRIX_GAMES, MatrixGame, TwoStepGame

torch.set_num_threads(1)  # these networks are too small for more
#: An algorithm of somebody's own, which learns a policy.
OWN = Algorithm(Mappo, MappoConfig, logits=True)


def test_imitator_does_what_the_expert_does() -> None:
    expert = partial(Constant, actions={"first": 2, "second": 1})
    game = partial(MatrixGame, MATRIX_GAMES["additive"])
    config = replace(IMITATION, episodes=200, learning_rate=0.02)
    agents = train(game, "imitation", config, expert=expert).agents
    assert play_greedily(Collector(game, 1), agents, [0])[0].actions == [{"first": 2, "second": 1}]


def test_labels_are_the_experts_and_only_where_an_agent_acts() -> None:
    collector = Collector(UnevenEnv, 2, EXPERT)
    agents = make_learner("imitation", collector.interface, IMITATION).agents
    played = collector.play(agents, expert_mixture(1.0), np.random.default_rng(0), [0, 1], ask_experts=True)
    assert all(actions["long"] == 2 for episode in played for actions in episode.actions)
    untaught = collector.play(agents, expert_mixture(1.0), np.random.default_rng(0), [0, 1])
    assert not untaught[0].labels


def test_an_expert_is_told_what_was_done() -> None:
    class Heeding(Constant):
        def __init__(self, env: Any):
            super().__init__(env, {"long": 2, "short": 1})
            self.heard: list[dict[str, int]] = []

        propose = Constant.act

        def note(self, actions: dict[str, int]) -> None:
            self.heard.append(actions)

    collector = Collector(UnevenEnv, 1, Heeding)
    agents = make_learner("imitation", collector.interface, IMITATION).agents
    episode = collector.play(agents, expert_mixture(0.0), np.random.default_rng(0), [0], ask_experts=True)[0]
    (expert,) = collector._experts
    assert isinstance(expert, Heeding)
    heard = expert.heard
    assert [{"short": 0, **actions} for actions in heard] == episode.actions
    assert any(actions["long"] != 2 for actions in heard)


def test_steps_without_label_do_not_count() -> None:
    logits = torch.randn(2, 3, 1, 4, generator=torch.Generator().manual_seed(0))
    labels = torch.tensor([[0, NO_LABEL, 2], [NO_LABEL, NO_LABEL, 3]]).unsqueeze(-1)
    changed = logits.clone()
    changed[0, 1], changed[1, :2] = 7.0, -7.0
    assert imitation_loss(logits, labels) == imitation_loss(changed, labels)


def test_actions_are_drawn_with_the_networks_probabilities_among_the_legal() -> None:
    values = torch.tensor([[0.0, 1.0, 2.0, 9.0]]).expand(20_000, 4)
    action_mask = torch.tensor([[True, True, True, False]]).expand(20_000, 4)
    counts = Counter(draw(values, action_mask, np.random.default_rng(0)).tolist())
    wanted = torch.softmax(values[0, :3], dim=0).tolist()
    assert [counts[action] / 20_000 for action in range(3)] == pytest.approx(wanted, abs=0.01) and 3 not in counts


def test_a_share_of_the_rollouts_is_played_as_in_evaluation() -> None:
    config = replace(IMITATION, envs=4, greedy_share=0.5)
    assert [config.is_greedy(4 * rollout) for rollout in range(6)] == [False, True] * 3
    assert sum(replace(config, greedy_share=0.3).is_greedy(4 * rollout) for rollout in range(100)) == 30
    assert not any(replace(config, greedy_share=0.0).is_greedy(4 * rollout) for rollout in range(100))
    values = torch.tensor([[[0.0, 1.0, 0.9, 9.0]]]).expand(50, 1, 4)
    action_mask = torch.tensor([[[True, True, True, False]]]).expand(50, 1, 4)
    silent, rng = np.full((50, 1), NO_LABEL), np.random.default_rng(0)
    assert set(expert_mixture(0.0, greedy=True)(values, action_mask, silent, rng).ravel()) == {1}
    assert set(expert_mixture(0.0)(values, action_mask, silent, rng).ravel()) == {0, 1, 2}
    told = expert_mixture(0.5, greedy=True)(values, action_mask, np.full((50, 1), 2), rng)
    assert set(told.ravel()) == {1, 2}


def test_mappo_learns_games_of_one_and_of_two_steps() -> None:
    config = replace(
        MAPPO, episodes=2_000, envs=32, buffer_size=32, batch_size=32, learning_rate=0.01, critic_learning_rate=0.02,
        critic_starts=0,
        validation_interval=2_000,
    )  # fmt: skip
    for game, best in ((partial(MatrixGame, MATRIX_GAMES["additive"]), 6.0), (TwoStepGame, 8.0)):
        agents = train(game, "mappo", config).agents
        assert play_greedily(Collector(game, 1), agents, [0])[0].episode_return == best


@settings(max_examples=30)
@given(st.lists(st.integers(1, 6), min_size=2, max_size=4), st.integers(0, 10**6))
def test_returns_are_discounted_sums_and_advantages_are_normal(lengths: list[int], seed: int) -> None:
    learner = Mappo("mappo", learner_interface_of(TwoStepGame()), replace(MAPPO, gae_lambda=1.0, gamma=0.9))
    batch = random_batch(lengths, np.random.default_rng(seed))
    rollout = learner.compute_gae(batch)
    for row, length in enumerate(lengths):
        rewards = batch.rewards[row, :length, 0].tolist()
        sums = [sum(0.9**k * reward for k, reward in enumerate(rewards[step:])) for step in range(length)]
        assert rollout.returns[row, :length].tolist() == pytest.approx(sums, abs=1e-4)
    real = rollout.advantages[batch.acted.any(dim=-1)]
    assert float(real.mean()) == pytest.approx(0, abs=1e-4)


def test_with_lambda_zero_a_return_looks_one_step_ahead() -> None:
    learner = Mappo("mappo", learner_interface_of(TwoStepGame()), replace(MAPPO, gae_lambda=0.0, gamma=0.9))
    batch = random_batch([3], np.random.default_rng(0))
    values = learner.value(batch.states)[0]
    wanted = batch.rewards[0, :, 0] + 0.9 * torch.cat([values[1:3], torch.zeros(1)])
    torch.testing.assert_close(learner.compute_gae(batch).returns[0], wanted)


def test_an_episode_that_was_cut_off_is_worth_what_the_critic_says_of_its_last_state() -> None:
    learner = Mappo("mappo", learner_interface_of(TwoStepGame()), replace(MAPPO, gae_lambda=1.0, gamma=0.5))
    ended = random_batch([2, 3], np.random.default_rng(0))
    cut = replace(ended, terminated=torch.zeros_like(ended.terminated))
    last = [float(learner.value(cut.states)[row, steps]) for row, steps in ((0, 2), (1, 3))]
    more = learner.compute_gae(cut).returns - learner.compute_gae(ended).returns
    assert more[0, :2].tolist() == pytest.approx([0.25 * last[0], 0.5 * last[0]], abs=1e-6)
    assert more[1].tolist() == pytest.approx([0.125 * last[1], 0.25 * last[1], 0.5 * last[1]], abs=1e-6)
    one_cut = ended.terminated.clone()
    one_cut[1, 2, 0] = False  # one agent has ended, the other was cut off
    assert torch.equal(
        learner.compute_gae(replace(ended, terminated=one_cut)).returns[1], learner.compute_gae(cut).returns[1]
    )


class Endless(MatrixGame):
    """Pays 1 for ever; episodes are cut after two steps, and the state does not tell the time."""

    def step(self, actions: dict[str, int]) -> tuple[Any, ...]:
        seen, rewards, ended, cut, infos = super().step(actions)
        self._at, over = 0, self.steps == 1
        self.steps += 1
        self.agents = [] if over else list(self.possible_agents)
        return seen, dict.fromkeys(rewards, 1.0), dict.fromkeys(ended, False), dict.fromkeys(cut, over), infos

    def reset(self, seed: int | None = None, options: Any = None) -> Any:
        self.steps = 0
        return super().reset(seed, options)


def test_the_critic_learns_what_an_endless_task_is_worth() -> None:
    config = replace(
        MAPPO, episodes=480, envs=16, buffer_size=16, batch_size=16, gamma=0.5, critic_learning_rate=0.02,
        max_grad_norm=10.0,
        validation_interval=480,
    )  # fmt: skip
    learner = train(partial(Endless, MATRIX_GAMES["additive"]), "mappo", config).learner
    assert isinstance(learner, Mappo)
    assert learner.value(torch.ones(1)).item() == pytest.approx(2.0, abs=0.1)  # 1 + 1/2 + 1/4 + ...; 1.25 without


@pytest.mark.parametrize(
    ("sizes", "learned"),
    [
        ({"episodes": 48, "buffer_size": 16}, [16, 16, 16]),
        ({"episodes": 40, "buffer_size": 16}, [16, 16, 8]),
        ({"episodes": 8, "buffer_size": 128}, [8]),
        ({"episodes": 6, "envs": 4, "buffer_size": 128}, [8]),
        ({"episodes": 40, "envs": 10, "buffer_size": 12}, [20, 20]),
        ({"episodes": 30, "envs": 10, "buffer_size": 12}, [20, 10]),
        ({"episodes": 40, "buffer_size": 8, "learning_starts": 24}, [24, 8, 8]),
    ],
)
def test_mappo_learns_from_every_episode_once(
    sizes: dict[str, Any], learned: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    sizes = {"envs": 8, "learning_starts": 0, **sizes}
    seen, rates = [], []
    compute_gae = Mappo.compute_gae

    def look(learner: Mappo, batch: Batch) -> Any:
        seen.append(batch.states[:, 0])
        rates.append([group["lr"] for group in learner._optimizer.param_groups])
        return compute_gae(learner, batch)

    monkeypatch.setattr(Mappo, "compute_gae", look)
    config = replace(MAPPO, **sizes, n_epochs=2)
    result = train(UnevenEnv, "mappo", config)
    assert [len(states) for states in seen] == learned
    assert len(torch.unique(torch.cat(seen), dim=0)) == sum(learned) >= sizes["episodes"]
    assert rates[0] == [config.learning_rate, config.critic_learning_rate] and min(rates[-1]) > 0
    assert result.learner.updates == sum(2 * -(-count // config.batch_size) for count in learned)


def test_too_little_memory_for_the_episodes_of_mappo_is_said() -> None:
    with pytest.raises(ValueError, match=r"memory_gib=0\.0001: holds \d+ of the 1000 episodes that mappo learns"):
        train(UnevenEnv, "mappo", replace(MAPPO, buffer_size=1_000, memory_gib=1e-4))


def test_one_step_is_enough_to_learn_from() -> None:
    game = partial(MatrixGame, MATRIX_GAMES["additive"])
    config = replace(MAPPO, episodes=8, envs=1, buffer_size=1, learning_starts=0, validation_interval=8)
    learner = train(game, "mappo", config).learner
    state = learner.state()["networks"]
    assert learner.updates == 32 and all(torch.isfinite(value).all() for value in state.values())
    start = Mappo("mappo", learner_interface_of(game()), config).state()["networks"]
    assert any(not torch.equal(value, start[name]) for name, value in state.items() if name.startswith("agents"))


def test_actors_wait_for_the_critic_only_where_they_begin_with_weights(tmp_path: Path) -> None:
    interface = learner_interface_of(UnevenEnv())
    train(UnevenEnv, "imitation", IMITATION, tmp_path, expert=EXPERT)
    imitated, first_batch = str(tmp_path / BEST), MAPPO.buffer_size
    for start, critic_starts, episodes, waits in (
        (imitated, first_batch, 8, True), (imitated, 1, 8, True), ("", first_batch, 8, False),
        (imitated, 512, 16, False),  # half of a short run
    ):  # fmt: skip
        config = replace(MAPPO, episodes=episodes, critic_starts=critic_starts, start=start)
        before = make_learner("mappo", interface, config).agents.state_dict()
        after = train(UnevenEnv, "mappo", config).agents.state_dict()
        assert all(torch.equal(value, after[name]) for name, value in before.items()) == waits


@pytest.mark.parametrize("episodes", [4, 8])
@pytest.mark.parametrize("algorithm", ["qmix", "imitation"])
def test_a_short_run_learns_after_its_last_wave(algorithm: str, episodes: int) -> None:
    kinds: dict[str, Config | DAggerConfig] = {"qmix": SMALL, "imitation": IMITATION}
    config = replace(kinds[algorithm], episodes=episodes, learning_starts=128)
    assert train(UnevenEnv, algorithm, config, expert=EXPERT).learner.updates == config.gradient_steps


def test_an_expert_of_some_agents_only_gives_finite_figures(tmp_path: Path) -> None:
    expert = partial(Constant, actions={"long": 2})
    learner = train(UnevenEnv, "imitation", IMITATION, tmp_path, expert=expert).learner
    losses = [row["train"] for row in read_rows(tmp_path / METRICS) if "train" in row]
    assert all(np.isfinite(list(row.values())).all() for row in losses) and losses[-1]["short_loss"] == 0
    assert losses[-1]["long_loss"] < losses[1]["long_loss"]
    fresh = make_learner("imitation", learner_interface_of(UnevenEnv()), IMITATION).state()["networks"]
    for name, value in learner.state()["networks"].items():
        assert torch.isfinite(value).all() and (name.startswith("long") or torch.equal(value, fresh[name]))


def random_batch(lengths: list[int], rng: np.random.Generator) -> Batch:
    """Return episodes of the two agents of a small game, which end by themselves, all padded to the longest."""
    count, steps = len(lengths), max(lengths)
    acted = torch.arange(steps).expand(count, steps) < torch.tensor(lengths).unsqueeze(1)
    ends = torch.arange(steps).expand(count, steps) == torch.tensor(lengths).unsqueeze(1) - 1
    states = torch.from_numpy(rng.normal(size=(count, steps + 1, 3)).astype(np.float32))
    reward = torch.from_numpy(rng.normal(size=(count, steps, 1)).astype(np.float32)).expand(count, steps, 2)
    names = ("first", "second")
    return Batch(
        {name: states for name in names}, {name: torch.zeros(count, steps, 1, dtype=torch.long) for name in names},
        {name: torch.ones(count, steps + 1, 1, 2, dtype=torch.bool) for name in names},
        states, reward, acted.unsqueeze(-1).expand(count, steps, 2), ends.unsqueeze(-1).expand(count, steps, 2),
    )  # fmt: skip


def test_mappo_starts_from_weights(tmp_path: Path) -> None:
    first = replace(IMITATION, graph_pool=MAPPO.graph_pool)
    train(UnevenEnv, "imitation", first, tmp_path, expert=EXPERT)
    interface = learner_interface_of(UnevenEnv())
    started = make_learner("mappo", interface, replace(MAPPO, start=str(tmp_path / BEST)))
    kept = load(tmp_path / BEST, "value")["agents"]
    assert all(torch.equal(value, kept[name]) for name, value in started.agents.state_dict().items())
    with pytest.raises(CheckpointError, match=BEST):
        make_learner("mappo", interface, replace(MAPPO, hidden=9, start=str(tmp_path / BEST)))
    with pytest.raises(CheckpointError, match="was trained with messages=None, not True"):
        check_first_weights(replace(MAPPO, start=str(tmp_path / BEST)), {"messages": True})
    check_first_weights(
        replace(MAPPO, start=str(tmp_path / BEST)), {TRAINED_IN: {"split": "generated"}, HOME: "home_1"}
    )
    train(UnevenEnv, "iql", SMALL, tmp_path / "values")
    with pytest.raises(CheckpointError, match="iql learns no policy"):
        make_learner("mappo", interface, replace(MAPPO, start=str(tmp_path / "values" / BEST)))


def test_mappo_starts_from_a_policy_of_ones_own_algorithm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    name = f"{__name__}:OWN"
    train(UnevenEnv, name, MAPPO, tmp_path)
    monkeypatch.setenv("CHMARL_TRUSTED", name)
    started = make_learner("mappo", learner_interface_of(UnevenEnv()), replace(MAPPO, start=str(tmp_path / BEST)))
    kept = load(tmp_path / BEST, "value")["agents"]
    assert all(torch.equal(value, kept[name]) for name, value in started.agents.state_dict().items())


def test_weights_to_start_from_are_of_actions_that_mean_the_same(tmp_path: Path) -> None:
    """Time limits may be others; so it is whether or not the setting is given to ``train``."""
    short = partial(chmarl_pb.parallel_env, split="val-unseen", max_steps=3)
    tiny = replace(IMITATION, episodes=4, horizon=28, graph_pool=MAPPO.graph_pool, validation_interval=4)
    train(short, "imitation", tiny, tmp_path / "first", expert=partial(make_policy, "belief"))
    kept = load(tmp_path / "first" / BEST, "value")
    assert kept["setting"]["rules"] == {"max_steps": 3} and kept["config"]["expert"] == "belief"
    started = replace(MAPPO, episodes=4, horizon=28, start=str(tmp_path / "first" / BEST))
    check_first_weights(started, setting_of(chmarl_pb.parallel_env(split="val-unseen")))
    for differs in ({"messages": False}, {"pointing": True}, {"goal": True}):
        with pytest.raises(CheckpointError, match="was trained with"):
            train(partial(short, **differs), "mappo", started)


def test_experts_are_named_in_what_is_kept() -> None:
    made: tuple[Any, ...] = (
        partial(make_policy, "search"),
        partial(make_expert, name="belief"),
        EXPERT,
        Constant,
        lambda env: None,
    )
    names = [expert_name(one) for one in made]
    own = "tests.helpers.small_runs:Constant"
    assert names[:2] == ["search", "belief"] and names[3] == own and names[2].startswith(f"{own} ")
    levels = [expert_name(partial(Constant, level)) for level in (1, 2, 2)]
    assert levels[0] != levels[1] == levels[2] and levels[0].startswith(f"{own} ")
    assert names[4].startswith(f"{__name__}:")


def test_a_run_from_before_experts_told_their_arguments_goes_on(tmp_path: Path) -> None:
    train(UnevenEnv, "imitation", IMITATION, tmp_path, expert=EXPERT)
    with pytest.raises(CheckpointError, match="expert"):
        train(UnevenEnv, "imitation", IMITATION, tmp_path, expert=partial(Constant, actions={"long": 1, "short": 1}))
    content = load(tmp_path / LAST)
    name = content["config"]["expert"].partition(" ")[0]
    kept = {key: part for key, part in content.items() if key not in ("format", "kind")}
    save(tmp_path / LAST, "run", {**kept, "config": {**content["config"], "expert": name}})
    train(UnevenEnv, "imitation", IMITATION, tmp_path, expert=EXPERT)


def test_a_run_goes_on_without_the_weights_that_it_began_with(tmp_path: Path) -> None:
    """They may be gone by then, or lie elsewhere; others are refused."""
    first = replace(IMITATION, graph_pool=MAPPO.graph_pool)
    train(UnevenEnv, "imitation", first, tmp_path / "first", expert=EXPERT)
    train(UnevenEnv, "imitation", replace(first, seed=5), tmp_path / "other", expert=EXPERT)
    begun, moved = tmp_path / "first" / BEST, tmp_path / "moved.pt"
    config = replace(MAPPO, start=str(begun))
    whole = train(UnevenEnv, "mappo", config, tmp_path / "run").agents.state_dict()
    kept = load(tmp_path / "run" / BEST)["begun_with"]
    assert kept["sha256"] == file_hash(begun) and kept["algorithm"] == "imitation"
    begun.rename(moved)
    for start in (begun, moved):
        again = train(UnevenEnv, "mappo", replace(config, start=str(start)), tmp_path / "run").agents.state_dict()
        assert all(torch.equal(value, again[name]) for name, value in whole.items())
    for start in (tmp_path / "other" / BEST, tmp_path / "missing.pt"):
        with pytest.raises(CheckpointError, match="other settings: start="):
            train(UnevenEnv, "mappo", replace(config, start=str(start)), tmp_path / "run")


def test_wrong_algorithms_and_settings_are_refused() -> None:
    interface = learner_interface_of(TwoStepGame())
    with pytest.raises(ValueError, match="use one of: iql, vdn, qmix, qtran, pqn, imitation, mappo"):
        make_learner("sarsa", interface, Config())
    with pytest.raises(ValueError, match="mappo takes a MappoConfig, not a Config"):
        make_learner("mappo", interface, Config())
    with pytest.raises(ValueError, match="needs an expert"):
        train(TwoStepGame, "imitation", IMITATION)


NODES, EDGES, WORDS = 6, 5, 8
SPACE = spaces.Dict(
    {
        "node_class": spaces.Box(0, 9, (NODES,), np.int16), "node_state": spaces.Box(0, 3, (NODES,), np.int16),
        "edges": spaces.Box(0, NODES, (EDGES, 3), np.int16), "instruction": spaces.Box(0, 20, (WORDS,), np.int16),
    }
)  # fmt: skip


def observation(classes: list[int], words: list[int], edges: list[tuple[int, int, int]] = []) -> dict[str, Any]:  # noqa: B006
    """Return a batch of one graph with an instruction."""
    arrays = {name: torch.zeros(1, *(part.shape or ()), dtype=torch.int16) for name, part in SPACE.spaces.items()}
    arrays["node_class"][0, : len(classes)] = torch.tensor(classes, dtype=torch.int16)
    arrays["node_state"][0, : len(classes)] = 1
    arrays["instruction"][0, : len(words)] = torch.tensor(words, dtype=torch.int16)
    for row, edge in enumerate(edges):
        arrays["edges"][0, row] = torch.tensor(edge, dtype=torch.int16)
    return arrays


def test_gated_pooling_does_not_see_order_or_padding() -> None:
    encode = build_encoder(SPACE, 16, graph_pool="gated")
    one = encode(observation([3, 5, 7], [4, 9], [(0, 2, 1)]))
    torch.testing.assert_close(one, encode(observation([7, 3, 5], [9, 4], [(1, 0, 1)])))
    cut = {
        name: part[:, :3] if name.startswith("node_") else part
        for name, part in observation([3, 5, 7], [4, 9], [(0, 2, 1)]).items()
    }
    torch.testing.assert_close(one, encode(cut))
    assert torch.isfinite(encode(observation([], []))).all()


def test_gated_pooling_learns_to_find_what_the_words_name() -> None:
    """Word w names class w; whether it is among the nodes is what a mean over nodes cannot tell well."""
    rng = np.random.default_rng(0)
    with torch.random.fork_rng():
        torch.manual_seed(0)
        encode = build_encoder(SPACE, 32, graph_pool="gated")
        head = torch.nn.Linear(32, 1)
    optimizer = torch.optim.Adam([*encode.parameters(), *head.parameters()], lr=3e-3)
    for _ in range(300):
        graphs = [(rng.choice(np.arange(1, 10), 4, replace=False), int(rng.integers(1, 10))) for _ in range(64)]
        parts = [observation(classes.tolist(), [word]) for classes, word in graphs]
        batch = {name: torch.cat([part[name] for part in parts]) for name in SPACE.spaces}
        there = torch.tensor([[float(word in classes)] for classes, word in graphs])
        known = head(encode(batch))
        loss = torch.nn.functional.binary_cross_entropy_with_logits(known, there)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert float(((known > 0) == (there > 0)).float().mean()) > 0.95


def test_gated_pooling_needs_an_instruction() -> None:
    graph = spaces.Dict({name: part for name, part in SPACE.spaces.items() if name != "instruction"})
    seen = observation([3], [4])
    with pytest.raises(ValueError, match="by the instruction needs its tokens"):
        build_encoder(graph, 8, graph_pool="gated")(seen)
    with pytest.raises(ValueError, match="use one of: mean, gated"):
        build_encoder(SPACE, 8, graph_pool="max")
