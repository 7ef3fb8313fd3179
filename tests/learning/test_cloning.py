"""Cloning: learns what it is shown, goes on after an interruption with the same numbers, and plays its checkpoints."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

pytest.importorskip("minari")

from chmarl_pb.data.generate import generate
from chmarl_pb.data.recipe import Recipe
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.rollout import rollout
from chmarl_pb.errors import DatasetError
from chmarl_pb.learning.algorithms.gradient import DivergedError
from chmarl_pb.learning.cloning import bc as cloning
from chmarl_pb.learning.cloning.bc import clone
from chmarl_pb.learning.cloning.demonstrations import read_demonstrations
from chmarl_pb.learning.config import CATALOG
from chmarl_pb.learning.networks.agents import NO_ACTION
from chmarl_pb.learning.policies.cloned import BCPolicy, CloningConfig, make_actors
from chmarl_pb.learning.policies.load import load_policy
from chmarl_pb.learning.rollouts.batched import BatchOfOne
from chmarl_pb.learning.runs.logger import METRICS, Logger, read_rows
from chmarl_pb.learning.storage.checkpoint import CheckpointError, load, save
from chmarl_pb.tasks.splits import load_tasks
from tests.helpers.stopping import in_pieces

EPISODES = 4
EXAMINE = cloning.Examiner.examine
SMALL = CloningConfig(epochs=2, batch_size=2, features=32, hidden=32, validation_interval=1, validation_tasks=1)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("datasets")
    generate(Recipe("train", limit=EPISODES), folder, workers=1)
    return folder


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Validation tasks are played in tests of policies alone."""
    figures = iter(range(100))
    monkeypatch.setattr(cloning.Examiner, "examine", lambda *_: {"score": next(figures) / 100})


@pytest.mark.parametrize(
    ("split", "others"), [("train", ["val-seen", "val-unseen"]), ("train-limited", ["val-limited"])]
)
def test_the_best_epoch_is_chosen_in_layouts_like_those_of_the_data(split: Any, others: list[str]) -> None:
    config = replace(SMALL, split=split)
    examiner = cloning.Examiner(config)
    figures = EXAMINE(examiner, make_actors(examiner.env, config, None))
    examiner.close()
    assert [task.id.rpartition("-")[0] for tasks in examiner.tasks.values() for task in tasks] == others
    assert figures["score"] == pytest.approx(np.mean([figures[f"{name}_plw"] for name in others]), abs=1e-4)


def test_clones_of_limited_layouts_learn_from_their_own_data_set(data: Path, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="scene-graph-train-limited-v0"):
        clone(replace(SMALL, split="train-limited"), tmp_path, data)
    own = generate(Recipe("train-limited", limit=2), tmp_path / "data", workers=1)
    clone(replace(SMALL, split="train-limited"), tmp_path, tmp_path / "data")
    assert load(tmp_path / "last.pt")["data"] == own.sha256


def weights(folder: Path, name: str = "best.pt") -> dict[str, Any]:
    actors: dict[str, Any] = torch.load(folder / name, weights_only=True)["actors"]
    return actors


def test_batches_hold_whole_episodes(data: Path) -> None:
    shown = read_demonstrations(data, Recipe("train"), SMALL)
    batch = shown.batch(torch.tensor([2, 0]))
    assert batch.mask.sum(dim=1).tolist() == shown.lengths[[2, 0]].tolist()
    assert (batch.last[:, 0] == NO_ACTION).all()
    first = int(shown.starts[2])
    length = int(shown.lengths[2])
    assert torch.equal(batch.labels[0, :length], shown.labels[first : first + length])
    assert torch.equal(batch.last[0, 1:length], shown.actions[first : first + length - 1])
    assert not batch.observation["humanoid_node_class"][~batch.mask].any()
    assert sum(len(one.labels) for one in shown.batches(3, (0, 1))) == EPISODES
    silent = read_demonstrations(data, Recipe("train"), replace(SMALL, messages=False))
    assert not any(key.endswith("messages") for key in silent.observations)


@pytest.mark.parametrize("centralized", [False, True])
def test_an_interrupted_run_ends_with_the_same_numbers(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, centralized: bool
) -> None:
    config = replace(SMALL, centralized=centralized, dropout=0.1)
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    clone(config, whole, data)

    def stop(logger: Logger, epochs: int) -> None:
        if epochs == 2:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(Logger, "advance", stop)  # the epoch's row is written, the checkpoint is that of the first
        clone(config, cut, data)
    clone(config, cut, data)
    for one, other in zip(weights(whole).values(), weights(cut).values(), strict=True):
        assert torch.equal(one, other)
    rows = [[row["humanoid_loss"] for row in read_rows(folder / METRICS)] for folder in (whole, cut)]
    assert rows[0] == rows[1] and len(rows[0]) == config.epochs
    with pytest.raises(CheckpointError, match="other settings: seed=0, not 1;"):
        clone(replace(config, seed=1), cut, data)
    save(cut / "last.pt", "bc-unfinished", load(cut / "last.pt") | {"data": "another"})
    with pytest.raises(CheckpointError, match="other settings: data='another'"):
        clone(config, cut, data)


def test_data_sets_are_of_splits_to_learn_from() -> None:
    with pytest.raises(ValueError, match="split='val-seen': data sets are of train or train-limited"):
        CloningConfig(split="val-seen")  # type: ignore[arg-type]


@pytest.mark.parametrize("damaged", [False, True])
def test_best_weights_that_are_gone_are_written_again_or_missed(
    damaged: bool, data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def examine(*_: Any) -> dict[str, float]:
        score = next(scores)
        if score < 0:
            raise KeyboardInterrupt
        return {"score": score}

    monkeypatch.setattr(cloning.Examiner, "examine", examine)
    scores = iter([0.5, -1.0])
    with pytest.raises(KeyboardInterrupt):
        clone(SMALL, tmp_path, data)
    if damaged:
        (tmp_path / "best.pt").write_bytes((tmp_path / "best.pt").read_bytes()[:-9])
    else:
        (tmp_path / "best.pt").unlink()
    scores = iter([0.3])
    assert clone(SMALL, tmp_path, data)["score"] == load(tmp_path / "best.pt")["figures"]["score"] == 0.3
    (tmp_path / "best.pt").unlink()
    with pytest.raises(CheckpointError, match="the best weights are gone"):
        clone(SMALL, tmp_path, data)


@pytest.mark.parametrize("dropout", [0.0, 0.3])
def test_a_run_that_is_asked_to_end_goes_on_from_its_last_batch(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, dropout: float
) -> None:
    config = replace(SMALL, epochs=3, dropout=dropout)
    clone(config, tmp_path / "whole", data)
    _, times = in_pieces(lambda: clone(config, tmp_path / "pieces", data), 2, monkeypatch)
    assert times >= 4
    for one, other in zip(weights(tmp_path / "whole").values(), weights(tmp_path / "pieces").values(), strict=True):
        assert torch.equal(one, other)
    rows = [[row["drone_loss"] for row in read_rows(tmp_path / name / METRICS)] for name in ("whole", "pieces")]
    assert rows[0] == rows[1] and len(rows[0]) == config.epochs


def test_clones_repeat_what_they_have_seen(data: Path, tmp_path: Path) -> None:
    config = replace(SMALL, epochs=60, learning_rate=5e-3)
    clone(config, tmp_path, data)
    factory = load_policy(tmp_path / "best.pt")
    assert getattr(factory, "deterministic", False)
    env = HouseholdEnv()
    task = load_tasks("train")[0]
    episode = rollout(env, factory(env), task.seed, task)
    env.close()
    assert episode.success and len(episode) == task.optimal_steps


def test_silent_clones_do_not_hear(data: Path, tmp_path: Path) -> None:
    clone(replace(SMALL, messages=False, epochs=1), tmp_path, data)
    env = HouseholdEnv()
    observations, infos = env.reset(seed=0)
    policy = load_policy(tmp_path / "best.pt")(env)
    assert isinstance(policy, BatchOfOne) and isinstance(policy.batched, BCPolicy)
    said = {name: {**seen, "messages": np.ones_like(seen["messages"])} for name, seen in observations.items()}
    logits = []
    for heard in (observations, said):
        policy.reset(0)
        policy.act(heard, infos)
        logits.append(torch.cat([part.flatten() for part in policy.batched._hidden]))
    env.close()
    assert torch.equal(*logits)


def test_weights_that_are_no_numbers_are_not_kept(data: Path, tmp_path: Path) -> None:
    with pytest.raises(DivergedError, match="lower learning_rate"):
        clone(replace(SMALL, learning_rate=1e30), tmp_path, data)
    assert not (tmp_path / "best.pt").exists()


def test_drawn_actions_follow_the_seed(data: Path, tmp_path: Path) -> None:
    clone(replace(SMALL, epochs=1, temperature=1.0), tmp_path, data)
    factory = load_policy(tmp_path / "best.pt")
    assert not getattr(factory, "deterministic", True)
    env = HouseholdEnv(max_steps=5)
    policy, task = factory(env), load_tasks("train")[0]
    played = [rollout(env, policy, seed, task).actions for seed in (1, 1, 2)]
    env.close()
    assert played[0] == played[1] != played[2]


def test_a_checkpoint_of_something_else_is_refused(data: Path, tmp_path: Path) -> None:
    clone(replace(SMALL, epochs=1), tmp_path, data)
    with pytest.raises(CheckpointError, match="kind"):
        load_policy(tmp_path / "last.pt")
    env = HouseholdEnv(observation="visual")
    with pytest.raises((CheckpointError, KeyError)):
        load_policy(tmp_path / "best.pt")(env)
    env.close()
    save(tmp_path / "other.pt", "bc", load(tmp_path / "best.pt") | {CATALOG: "of another catalogue"})
    env = HouseholdEnv()
    load_policy(tmp_path / "best.pt")(env)
    with pytest.raises(CheckpointError, match="other classes of things"):
        load_policy(tmp_path / "other.pt")(env)
    env.close()
    env = HouseholdEnv(lookalikes=True)
    with pytest.raises(CheckpointError, match="other rules"):
        load_policy(tmp_path / "best.pt")(env)
    env.close()
    env = HouseholdEnv(observation="visual", image_size=64)
    with pytest.raises(CheckpointError, match="pictures of 128 pixels, not 64"):
        load_policy(tmp_path / "best.pt")(env)
    env.close()
