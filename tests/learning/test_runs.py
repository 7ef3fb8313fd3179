"""Replay, collecting, checkpoints and whole runs, on small environments."""

import json
import pickle
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium.spaces import Box, Dict, Discrete, MultiBinary, MultiDiscrete

from chmarl_pb.errors import ResultError
from chmarl_pb.learning import train
from chmarl_pb.learning.algorithms.dagger import DAggerConfig
from chmarl_pb.learning.algorithms.mappo import Mappo, MappoConfig
from chmarl_pb.learning.algorithms.registry import Algorithm
from chmarl_pb.learning.algorithms.value import ValueLearner
from chmarl_pb.learning.benchmark_env import benchmark
from chmarl_pb.learning.config import TRAINED_IN, amount, count
from chmarl_pb.learning.networks.parts import FlatEncoder
from chmarl_pb.learning.policies.cloned import CloningConfig
from chmarl_pb.learning.rollouts.collect import Collector, epsilon_after, epsilon_greedy
from chmarl_pb.learning.rollouts.replay_buffer import ReplayBuffer
from chmarl_pb.learning.runs.lock import run_lock
from chmarl_pb.learning.runs.logger import METRICS, read_rows
from chmarl_pb.learning.runs.loop import expert_name
from chmarl_pb.learning.runs.run import BEST, LAST, Run
from chmarl_pb.learning.runs.validation import by_return, by_tasks
from chmarl_pb.learning.spaces import LearnerInterface, learner_interface_of, spaces_of
from chmarl_pb.learning.storage.checkpoint import FORMAT, RENAMED, CheckpointError, load, save
from chmarl_pb.tasks.splits import SPLITS
from tests.helpers.small_runs import CONFIGS, EXPERT, MAPPO, PQN, SMALL, VALUE
from tests.helpers.uneven_env import UnevenEnv
from training.games import MATRIX_GAMES, MatrixGame

NEW = {"encoder", "mixer"}  # settings that earlier versions did not have
torch.set_num_threads(1)  # these networks are too small for more


@pytest.fixture
def collector() -> Collector:
    return Collector(UnevenEnv, 3)


def learner(collector: Collector) -> ValueLearner:
    return ValueLearner("vdn", collector.interface, SMALL)


def test_interface_of_uneven_agents(collector: Collector) -> None:
    interface = collector.interface
    assert interface.actions == {"long": 3, "short": 2}
    assert not interface.has_state and interface.state_size == 4 + 10 + 3
    assert learner_interface_of(MatrixGame(MATRIX_GAMES["additive"])).has_state


def test_collected_steps_know_who_acted_and_who_ended(collector: Collector) -> None:
    episode = collector.play(learner(collector).agents, epsilon_greedy(1.0), np.random.default_rng(0), [0, 1, 2])[0]
    assert np.array(episode.acted).tolist() == [[True, True], [True, True], [True, False], [True, False]]
    assert np.array(episode.terminated).tolist() == [[False, False], [False, True], [False, False], [False, False]]
    assert len(episode.observations) == len(episode.states) == 5
    assert float(np.abs(episode.observations[4]["short"]["noise"]).sum()) == 0
    assert not np.array_equal(episode.observations[0]["short"]["noise"], episode.observations[1]["short"]["noise"])


def test_collecting_is_a_function_of_seeds(collector: Collector) -> None:
    agents = learner(collector).agents
    first = collector.play(agents, epsilon_greedy(0.5), np.random.default_rng(3), [5, 6])
    collector.play(agents, epsilon_greedy(0.5), np.random.default_rng(9), [1, 2, 3])
    second = collector.play(agents, epsilon_greedy(0.5), np.random.default_rng(3), [5, 6])
    assert [episode.actions for episode in first] == [episode.actions for episode in second]
    assert [episode.episode_return for episode in first] == [episode.episode_return for episode in second]


def test_environments_of_the_endless_split_stay_in_their_homes(collector: Collector, tmp_path: Path) -> None:
    def seeds(rollouts: int) -> list[int]:
        config, cpu = replace(SMALL, envs=3), torch.device("cpu")
        run = Run(collector, lambda *_: [], "vdn", config, None, lambda *_: {}, {}, cpu)
        run.episodes = 3 * rollouts
        return run._seeds()

    assert len(set(seeds(0))) == 3
    collector.episodes_in_a_home = 100
    homes = [[seed // 100 for seed in seeds(rollouts)] for rollouts in (0, 1, 99, 100)]
    assert homes[0] == homes[1] == homes[2] != homes[3] and len(set(homes[0])) == 3
    assert [seed % 100 for seed in seeds(142)] == [42] * 3, "an environment plays the same task again in its home"
    assert seeds(7) == seeds(7), "a run that goes on enters other homes"


def test_replay_gives_back_what_it_got(collector: Collector) -> None:
    replay = ReplayBuffer(collector.interface, SMALL.horizon, 10, 1.0)
    episodes = collector.play(learner(collector).agents, epsilon_greedy(1.0), np.random.default_rng(0), [0, 1, 2])
    for episode in episodes:
        replay.add(episode)
    batch = replay.sample(99, np.random.default_rng(0))
    assert batch.rewards.shape == (3, 4, 2) and batch.states.shape == (3, 5, 17)  # cut from the horizon 5 to 4 steps
    gains = sorted(batch.rewards.mul(batch.acted).sum(dim=(1, 2)).tolist())
    assert gains == pytest.approx(sorted(float(np.sum(episode.rewards)) for episode in episodes), rel=1e-5)
    assert batch.observations["short"]["time"].dtype == torch.int64
    assert batch.action_mask["long"][0, 0].tolist() == [[False, True, True]]


def test_replay_forgets_the_oldest_and_leaves_no_trace_of_it() -> None:
    collector = Collector(partial(UnevenEnv, 5), 1)
    agents, rng = learner(collector).agents, np.random.default_rng(0)
    replay = ReplayBuffer(collector.interface, 5, 2, 1.0)
    for seed in range(2):
        replay.add(collector.play(agents, epsilon_greedy(1.0), rng, [seed])[0])
    short = Collector(partial(UnevenEnv, 3), 1)
    for seed in range(2):
        replay.add(short.play(agents, epsilon_greedy(1.0), rng, [seed])[0])
    batch = replay.sample(2, rng)
    assert len(replay) == 2 and batch.rewards.shape[1] == 3
    assert not replay._kept["acted"][:, 3:].any()


def test_replay_is_bounded(collector: Collector) -> None:
    wide = ReplayBuffer(collector.interface, 5, 10**6, memory_gib=0.001)
    assert wide.capacity == int(0.001 * 2**30 / wide.episode_bytes) < 10**6
    with pytest.raises(ValueError, match="memory_gib"):
        ReplayBuffer(collector.interface, 5, 10, memory_gib=1e-9)
    episode = collector.play(learner(collector).agents, epsilon_greedy(1.0), np.random.default_rng(0), [0])[0]
    with pytest.raises(ValueError, match="horizon=3"):
        ReplayBuffer(collector.interface, 3, 10, 1.0).add(episode)


@pytest.mark.parametrize(("algorithm", "overlap"), [*((name, False) for name in VALUE), ("qmix", True)])
def test_learns_an_additive_game(algorithm: str, overlap: bool) -> None:
    config = replace(SMALL, episodes=320, envs=16, horizon=1, gradient_steps=10, batch_size=32, learning_rate=1e-2)
    config = replace(config, overlap=overlap)
    result = train(partial(MatrixGame, MATRIX_GAMES["additive"]), algorithm, config)
    assert result.best_score == 6


@pytest.mark.parametrize("scores", [[0.0, 0.0, 0.0], [0.1, 0.3, 0.3], [0.3, 0.2, 0.1]])
def test_of_equal_validations_the_last_weights_are_kept(scores: list[float], tmp_path: Path) -> None:
    stream = iter(scores)
    config = replace(SMALL, episodes=12, envs=4, validation_interval=4)
    train(UnevenEnv, "vdn", config, tmp_path, validate=lambda *_: {"score": next(stream)})
    best = max(place for place, score in enumerate(scores) if score == max(scores))
    assert load(tmp_path / "best.pt")["episodes"] == 4 * (best + 1)


SCORES: list[float] = []


def by_scores(*_: Any) -> dict[str, float]:
    score = SCORES.pop(0)
    if score < 0:
        raise KeyboardInterrupt
    return {"score": score}


def test_best_weights_that_are_gone_are_written_again_or_missed(tmp_path: Path) -> None:
    config = replace(SMALL, episodes=12, envs=4, validation_interval=4)
    go_on = partial(train, UnevenEnv, "vdn", config, tmp_path, by_scores)
    SCORES[:] = [0.5, -1.0]
    with pytest.raises(KeyboardInterrupt):
        go_on()
    (tmp_path / BEST).unlink()
    SCORES[:] = [0.2, 0.1]
    assert go_on().best_score == 0.2 and load(tmp_path / BEST)["episodes"] == 8
    (tmp_path / BEST).unlink()
    with pytest.raises(CheckpointError, match=rf"{BEST}: the best weights are gone, and the run is over"):
        go_on()


@pytest.mark.parametrize("given", [1.0, {"x": 1.0}, None, {"score": "high"}])
def test_validations_without_a_score_are_refused(given: Any) -> None:
    with pytest.raises(ValueError, match=r"validate returns .*; let it return a dict of numbers with one of the name"):
        train(UnevenEnv, "vdn", SMALL, validate=lambda *_: given)


def test_a_score_that_is_no_number_ends_a_run_with_a_word(tmp_path: Path) -> None:
    for figures in ({"score": float("nan")}, {"score": 1.0, "success": float("inf")}):
        *_, (name, value) = figures.items()
        with pytest.raises(ValueError, match=f"validation after 16 episodes has the {name} {value}"):
            train(UnevenEnv, "vdn", SMALL, tmp_path, validate=lambda *_, found=figures: found)
    train(UnevenEnv, "vdn", SMALL, tmp_path)  # by another validation it goes on
    assert (tmp_path / BEST).is_file()


@pytest.mark.parametrize("algorithm", CONFIGS)
def test_killed_run_ends_with_the_same_numbers(algorithm: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = CONFIGS[algorithm]
    whole = train(UnevenEnv, algorithm, config, tmp_path / "whole", expert=EXPERT)
    advance, rollouts = Run.advance, iter(range(10))

    def dies(run: Run, logger: Any) -> None:
        if next(rollouts) == 9:
            raise KeyboardInterrupt
        advance(run, logger)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(Run, "advance", dies)
        train(UnevenEnv, algorithm, config, tmp_path / "killed", expert=EXPERT)
    resumed = train(UnevenEnv, algorithm, config, tmp_path / "killed", expert=EXPERT)
    one, other = whole.learner.state()["networks"], resumed.learner.state()["networks"]
    assert one.keys() == other.keys() and all(torch.equal(one[key], other[key]) for key in one)
    rows = [[{**row, "speed": 0} for row in read_rows(tmp_path / name / METRICS)] for name in ("whole", "killed")]
    assert rows[0] == rows[1] and len(rows[0]) == 6
    best = [load(tmp_path / name / BEST)["agents"] for name in ("whole", "killed")]
    assert all(torch.equal(best[0][key], best[1][key]) for key in best[0])


@pytest.mark.parametrize("change", [{"envs": 0}, {"episodes": -5}, {"seed": -1}, {"validation_interval": 0}])
def test_settings_that_cannot_be_are_refused(change: dict[str, Any]) -> None:
    (name,) = change
    with pytest.raises(ValueError, match=f"{name}=.*must be"):
        replace(SMALL, **change)


def test_zeros_are_settings_and_shares_have_bounds() -> None:
    replace(SMALL, exploration_final_eps=0)
    MappoConfig(ent_coef=0)
    DAggerConfig(beta=0)
    for name, value in (("gamma", 5.0), ("learning_rate", float("nan")), ("max_grad_norm", float("inf"))):
        change: dict[str, Any] = {name: value}
        with pytest.raises(ValueError, match=name):
            replace(SMALL, **change)
    with pytest.raises(ValueError, match="batch_size=0"):
        CloningConfig(batch_size=0)


def test_random_actions_fall_linearly_from_first_to_last_share() -> None:
    for config in (SMALL, PQN):
        half: Any = replace(config, episodes=100, exploration_fraction=0.5, exploration_final_eps=0.0)
        assert [epsilon_after(episodes, half) for episodes in (0, 25, 50, 99)] == [1.0, 0.5, 0.0, 0.0]
        assert epsilon_after(0, replace(half, exploration_fraction=0.0)) == 0


def test_only_one_process_trains_in_a_folder(tmp_path: Path) -> None:
    with run_lock(tmp_path, LAST, BEST), pytest.raises(CheckpointError, match="another process trains here"):
        train(UnevenEnv, "vdn", SMALL, tmp_path)
    assert not (tmp_path / LAST).exists()
    train(UnevenEnv, "vdn", SMALL, tmp_path)


def test_an_endless_episode_is_cut_with_a_word() -> None:
    with pytest.raises(ValueError, match="horizon=5"):
        train(partial(UnevenEnv, 10**9), "vdn", SMALL)


@pytest.mark.parametrize("name", ["agent.0", "values", "type"])
def test_names_that_torch_keeps_for_itself_are_refused(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    env = UnevenEnv()
    env.possible_agents = [name]
    for space in ("action_space", "observation_space"):
        monkeypatch.setattr(env, space, lambda agent: Discrete(2))
    with pytest.raises(ValueError, match=f"named '{name}'"):
        spaces_of(env)


def test_a_discrete_observation_may_start_anywhere() -> None:
    encoder = FlatEncoder(Discrete(3, start=5))
    assert encoder(torch.tensor([5, 7, 0])).tolist() == [[1, 0, 0], [0, 0, 1], [0, 0, 0]]  # 0: the agent is gone


def test_multi_discrete_and_multi_binary_observations_are_learned_from(monkeypatch: pytest.MonkeyPatch) -> None:
    counts, bits = MultiDiscrete([3, 2], start=[1, 0]), MultiBinary([2, 2])
    assert FlatEncoder(counts)(torch.tensor([[1, 1], [3, 0]])).tolist() == [[1, 0, 0, 0, 1], [0, 0, 1, 1, 0]]
    assert FlatEncoder(bits)(torch.ones(3, 2, 2, dtype=torch.int8)).shape == (3, 4)
    env, seen = UnevenEnv(), Dict({"counts": counts, "bits": bits})
    monkeypatch.setattr(UnevenEnv, "observation_space", lambda self, agent: seen)
    spaces = spaces_of(env)[0]
    interface = LearnerInterface(spaces, dict.fromkeys(spaces, 2), 0, False)
    assert len(interface.state(env, {name: seen.sample() for name in spaces})) == 9 * len(spaces)


class LateEnv(UnevenEnv):
    """The short agent comes after the first step."""

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        super().reset(seed)
        self.agents = ["long"]
        return self._observe(), self._infos()

    def step(self, actions: dict[str, int]) -> tuple[Any, ...]:
        observations, *rest, infos = super().step(actions)
        if self._time == 1:
            self.agents = ["long", "short"]
            observations, infos = self._observe(), self._infos()
        return observations, *rest, infos


def test_agents_that_join_later_are_refused() -> None:
    with pytest.raises(ValueError, match="'short' acts in step 2 of an episode and not in the step before"):
        train(LateEnv, "vdn", SMALL)


def observing(space: Any, *values: Any) -> type[UnevenEnv]:
    """Return an environment whose long agent has a space, and observes values in turn."""

    class Env(UnevenEnv):
        def observation_space(self, agent: str) -> Any:
            return space if agent == "long" else super().observation_space(agent)

        def _observe(self) -> dict[str, Any]:
            seen = super()._observe()
            return seen | ({"long": values[min(self._time, len(values) - 1)]} if "long" in seen else {})

    return Env


SHORT, KEYED = Box(0, 1, (2,), np.int8), Dict({"bits": Box(0, 1, (2,), np.uint8)})


@pytest.mark.parametrize(
    ("space", "values", "words"),
    [
        (SHORT, [[1, 0, 1]], r"observation of 'long' has the shape \(2,\) .* shape \(3,\)"),
        (SHORT, [[1, 0], [1]], r"observation of 'long' has the shape \(2,\) .* shape \(1,\)"),
        (KEYED, [{"bit": [0, 1]}], r"'long', key 'bits', has the shape \(2,\) .* nothing of that kind"),
        (KEYED, [[0, 1]], r"'long', key 'bits', has the shape \(2,\) .* nothing of that kind"),
        (SHORT, [{"bits": [0, 1]}], r"'long' has the shape \(2,\) .* nothing of that kind"),
        (SHORT, [[0, 1], [400, -5]], "'long' is of int8 .* int64 from -5 to 400"),
        (KEYED, [{"bits": [0.0, 0.5]}], r"'long', key 'bits', is of uint8 .* float64 from 0\.0 to 0\.5"),
        (KEYED, [{"bits": [0.0, np.nan]}], "'long', key 'bits', is of uint8 .* float64"),
    ],
)
def test_observations_that_are_not_of_their_space_are_refused(space: Any, values: list[Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        train(observing(space, *values), "vdn", SMALL)


@pytest.mark.parametrize(
    ("space", "value"), [(SHORT, [0, 1]), (KEYED, {"bits": [True, False]}), (KEYED, {"bits": [1.0, 0]})]
)
def test_lists_that_fit_are_observations(space: Any, value: Any) -> None:
    env = observing(space, value)
    collector = Collector(env, 1)
    replay = ReplayBuffer(collector.interface, 5, 1, 1.0)
    replay.add(collector.play(learner(collector).agents, epsilon_greedy(1.0), np.random.default_rng(0), [0])[0])
    kept = replay.sample(1, np.random.default_rng(0)).observations["long"]
    kept, value = (kept["bits"], value["bits"]) if isinstance(value, dict) else (kept, value)
    assert kept[0, -1].tolist() == [int(number) for number in value]


@pytest.mark.parametrize(
    ("lengths", "words"), [((0,), r"state\(\) is empty"), ((2, 3), r"state\(\) has 3 numbers, and 2")]
)
def test_a_state_has_one_length(lengths: tuple[int, ...], words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def state(env: UnevenEnv) -> np.ndarray:
        return np.zeros(lengths[min(env._time, len(lengths) - 1)])

    monkeypatch.setattr(UnevenEnv, "state", state)
    with pytest.raises(ValueError, match=words):
        train(UnevenEnv, "qmix", SMALL)


def test_text_is_no_checkpoint(tmp_path: Path) -> None:
    for text in ("hello", "RRR"):
        (tmp_path / "text.pt").write_text(text)
        with pytest.raises(CheckpointError, match=r"text\.pt: not a whole checkpoint"):
            load(tmp_path / "text.pt")
    torch.save({"format": FORMAT}, tmp_path / "text.pt")
    with pytest.raises(CheckpointError, match="kind None"):
        load(tmp_path / "text.pt")


def test_run_of_other_settings_is_refused(tmp_path: Path) -> None:
    train(UnevenEnv, "vdn", SMALL, tmp_path)
    with pytest.raises(CheckpointError, match=rf"{LAST}.*algorithm"):
        train(UnevenEnv, "iql", SMALL, tmp_path)
    with pytest.raises(CheckpointError, match=r"gamma=0\.97, not 0\.5"):
        train(UnevenEnv, "vdn", replace(SMALL, gamma=0.5), tmp_path)
    with pytest.raises(CheckpointError, match="settings: messages=None, not True; go on"):
        train(UnevenEnv, "vdn", SMALL, tmp_path, setting={"messages": True})


def test_a_run_whose_weights_were_chosen_by_other_scores_is_refused(tmp_path: Path) -> None:
    def by_length(collector: Collector, agents: Any) -> dict[str, float]:
        return {"score": 1.0}

    train(UnevenEnv, "vdn", SMALL, tmp_path, by_return())
    train(UnevenEnv, "vdn", SMALL, tmp_path, by_return())
    with pytest.raises(CheckpointError, match=r"chosen by another one.*the same arguments"):
        train(UnevenEnv, "vdn", SMALL, tmp_path, by_return(4))
    with pytest.raises(CheckpointError, match=r"chosen by mean_return, not by .*by_length"):
        train(UnevenEnv, "vdn", SMALL, tmp_path, by_length)
    older = load(tmp_path / LAST)
    del older["validated_by"]
    save(tmp_path / LAST, "run", {key: part for key, part in older.items() if key not in ("format", "kind")})
    train(UnevenEnv, "vdn", SMALL, tmp_path, by_length)


def test_run_of_another_split_is_refused_but_an_older_one_does_not_tell(tmp_path: Path) -> None:
    def go_on(**options: Any) -> None:
        train(UnevenEnv, "vdn", SMALL, tmp_path, setting=benchmark("scene_graph", **options)[1])

    go_on()
    go_on(split="train")
    for options, words in (
        ({"split": "generated"}, "split='train', not 'generated'"), ({"task": "tidy"}, "task=None, not 'tidy'"),
        ({"execution": "simulated"}, "execution=None, not 'simulated'"),
        ({"max_steps": 9}, "rules=None, not {'max_steps': 9}"),
        ({"robots": ("humanoid", "humanoid")}, "robots=None, not "), ({"home": "home_1"}, "home=None, not 'home_1'"),
    ):  # fmt: skip
        with pytest.raises(CheckpointError, match=rf"other settings: .*{words}"):
            go_on(**options)
    content = load(tmp_path / LAST)
    assert load(tmp_path / BEST)["setting"].pop(TRAINED_IN) == content["setting"].pop(TRAINED_IN) == {"split": "train"}
    save(tmp_path / LAST, content.pop("kind"), content)
    go_on(split="generated")


def test_finished_run_is_loaded_and_keeps_no_replay(tmp_path: Path) -> None:
    first = train(UnevenEnv, "vdn", SMALL, tmp_path)
    assert load(tmp_path / LAST)["replay"] is None
    again = train(UnevenEnv, "vdn", SMALL, tmp_path)
    assert again.best_score == first.best_score
    assert again.learner.updates == first.learner.updates


def test_checkpoint_errors_name_the_file(tmp_path: Path) -> None:
    path = tmp_path / "x.pt"
    with pytest.raises(CheckpointError, match=r"x\.pt: no such checkpoint"):
        load(path)
    save(path, "value", {"weights": torch.ones(1000)})
    assert load(path)["weights"].sum() == 1000
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(CheckpointError, match=r"x\.pt: not a whole checkpoint"):
        load(path)
    torch.save({"format": "other"}, path)
    with pytest.raises(CheckpointError, match="'other'"):
        load(path)
    save(path, "bc", {})
    with pytest.raises(CheckpointError, match="kind 'bc', not 'value'"):
        load(path, "value")


class Evil:
    """Runs code when it is unpickled."""

    def __reduce__(self) -> Any:
        return exec, ("raise SystemExit('code ran')",)


def test_checkpoint_runs_no_code(tmp_path: Path) -> None:
    torch.save({"format": Evil()}, tmp_path / "evil.pt")
    (tmp_path / "plain.pt").write_bytes(pickle.dumps(Evil()))
    for name in ("evil.pt", "plain.pt"):
        with pytest.raises(CheckpointError, match=name):
            load(tmp_path / name)


def test_other_architecture_is_refused(tmp_path: Path) -> None:
    train(UnevenEnv, "vdn", SMALL, tmp_path)
    content = load(tmp_path / LAST)
    other = ValueLearner("vdn", learner_interface_of(UnevenEnv()), replace(SMALL, hidden=9))
    with pytest.raises(CheckpointError, match=r"last\.pt: its weights do not fit"):
        other.restore(content["learner"], tmp_path / LAST)


def test_settings_in_checkpoints_are_plain(tmp_path: Path) -> None:
    train(UnevenEnv, "qmix", SMALL, tmp_path, setting={"messages": False})
    content = load(tmp_path / BEST)
    assert json.loads(json.dumps(content["setting"])) == {"messages": False}
    assert content["config"]["hidden"] == SMALL.hidden


def as_before(path: Path) -> None:
    """Write a checkpoint's settings by the names of earlier versions, without those that have come since then."""
    content, old = load(path), {new: name for name, new in RENAMED.items()}
    config = {old.get(name, name): value for name, value in content["config"].items() if name not in NEW}
    save(path, content.pop("kind"), content | {"config": config})


@pytest.mark.parametrize("algorithm", ["qmix", "imitation", "mappo"])
def test_runs_and_weights_of_earlier_versions_are_used(algorithm: str, tmp_path: Path) -> None:
    config = CONFIGS[algorithm]
    first = train(UnevenEnv, algorithm, config, tmp_path, expert=EXPERT)
    for name in (BEST, LAST):
        as_before(tmp_path / name)
        stored = torch.load(tmp_path / name, weights_only=True)["config"]
        assert "gradient_clip" in stored and not NEW & stored.keys()
        own: dict[str, Any] = {"expert": expert_name(EXPERT)} if algorithm == "imitation" else {}
        assert type(config)(**load(tmp_path / name)["config"]) == replace(config, **own)
    again = train(
        UnevenEnv, algorithm, config, tmp_path, expert=EXPERT
    )  # goes on, which here means that it is finished
    assert again.learner.updates == first.learner.updates


@dataclass(frozen=True)
class OwnConfig(MappoConfig):
    """Settings of somebody's own, with names that other algorithms had once."""

    epochs: int = count(1)
    clip: float = amount(0.2)


OWN = Algorithm(Mappo, OwnConfig)


def test_own_settings_keep_their_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    name, config = f"{__name__}:OWN", OwnConfig(**asdict(MAPPO), epochs=3)
    monkeypatch.setenv("CHMARL_TRUSTED", name)
    first = train(UnevenEnv, name, config, tmp_path)
    assert load(tmp_path / BEST)["config"]["epochs"] == 3
    assert train(UnevenEnv, name, config, tmp_path).learner.updates == first.learner.updates


@pytest.mark.parametrize("size", [None, 2**40], ids=["no file", "endless"])
def test_metrics_that_cannot_be_read_are_one_error(size: int | None, tmp_path: Path) -> None:
    train(UnevenEnv, "vdn", SMALL, tmp_path)
    (tmp_path / METRICS).unlink()
    if size is None:
        (tmp_path / METRICS).symlink_to("/dev/zero")
    else:
        with (tmp_path / METRICS).open("wb") as file:
            file.truncate(size)  # with no room on the disk
    for use in (partial(train, UnevenEnv, "vdn", SMALL, tmp_path), partial(read_rows, tmp_path / METRICS)):
        with pytest.raises(ResultError, match=r"regular file|bytes; at most"):
            use()


@pytest.mark.parametrize("split", [split for split in SPLITS if "test" in split])
def test_no_checkpoint_is_chosen_on_a_test_split(split: str) -> None:
    with pytest.raises(ValueError, match="test split"):
        by_tasks(("val-unseen", split))
