"""Learners in the grounded track: what they see and say, and the rules that their checkpoints remember."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

pytest.importorskip("torch")
import torch

import chmarl_pb
from chmarl_pb.cli.train import Play, main, parse, run_name
from chmarl_pb.envs.options import Options
from chmarl_pb.learning import Config, train
from chmarl_pb.learning.algorithms.dagger import DAggerConfig
from chmarl_pb.learning.algorithms.mappo import MappoConfig
from chmarl_pb.learning.algorithms.registry import make_learner
from chmarl_pb.learning.benchmark_env import benchmark, recorded_rules
from chmarl_pb.learning.networks.agents import Agent
from chmarl_pb.learning.rollouts.collect import Collector
from chmarl_pb.learning.runs.run import BEST, LAST
from chmarl_pb.learning.runs.validation import by_tasks
from chmarl_pb.learning.storage.checkpoint import CheckpointError, load
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.policies.sources import find_policy
from chmarl_pb.tasks.messages import Board
from chmarl_pb.tasks.symbols import Symbols
from tests.helpers.stopping import in_pieces

torch.set_num_threads(1)  # these networks are too small for more
SIZES: dict[str, Any] = {
    "episodes": 4, "horizon": 4, "envs": 2, "batch_size": 2, "learning_starts": 2, "features": 8, "hidden": 8,
    "graph_pool": "grounded", "word_vectors": True, "grounding_coef": 1.0, "numbers_past": True,
}  # fmt: skip
RULES: dict[str, Any] = {"track": "grounded", "split": "val-unseen", "max_steps": 4}
TASKS = ["val-unseen-000", "val-unseen-008"]
CONFIGS = {
    "qmix": Config(**SIZES), "imitation": DAggerConfig(**SIZES), "mappo": MappoConfig(**SIZES, buffer_size=2),
}  # fmt: skip


def run(algorithm: str, folder: Path, **changes: Any) -> dict[str, torch.Tensor]:
    """Train for a moment in the grounded track, and return the weights."""
    env_fn, setting = benchmark("scene_graph", **(RULES | changes))
    expert, validate = partial(make_policy, "belief"), by_tasks(("val-unseen",), 2)
    agents = train(env_fn, algorithm, CONFIGS[algorithm], folder, validate, setting, expert=expert).agents
    return dict(agents.state_dict())


@pytest.mark.parametrize("algorithm", CONFIGS)
def test_a_checkpoint_plays_by_the_rules_of_its_training(algorithm: str, tmp_path: Path) -> None:
    weights = run(algorithm, tmp_path)
    assert weights["humanoid.head.weight"].shape[0] == 26 + 16 and weights["drone.head.weight"].shape[0] == 9 + 16
    assert {"track": "grounded", "max_steps": 4} == find_policy(str(tmp_path / BEST)).rules
    report = chmarl_pb.evaluate(str(tmp_path / BEST), "val-unseen", seeds=[0], workers=1, tasks=TASKS[:1])
    assert (report.track, report.settings["options"]["max_steps"]) == ("grounded", 4)
    assert report.settings["options"]["messages"] == "symbols" and report.settings["options"]["feedback"] is False
    env = chmarl_pb.parallel_env(track="grounded", split="val-unseen", max_steps=4)
    policy = find_policy(str(tmp_path / BEST)).make
    first, second = (chmarl_pb.rollout(env, policy(env), 0, TASKS[1]) for _ in range(2))
    assert first.actions == second.actions and first.said == second.said and len(first.said) == 4
    env.close()


def test_other_rules_are_refused_in_one_sentence(tmp_path: Path) -> None:
    run("qmix", tmp_path)
    for other, words in (
        ({"track": "paper"}, "pointing, lookalikes, own words"), ({"pointing": False}, r"\(pointing\)"),
        ({"messages": True}, r"\(own words\)"),
    ):  # fmt: skip
        with pytest.raises(CheckpointError, match=rf"trained by other rules.*{words}.*track='grounded'"):
            chmarl_pb.evaluate(str(tmp_path / BEST), "val-unseen", workers=1, tasks=TASKS[:1], **other)
    longer = chmarl_pb.evaluate(
        str(tmp_path / BEST), "val-unseen", seeds=[0], workers=1, tasks=TASKS[:1], max_steps=5, templates=1
    )
    assert longer.settings["options"]["max_steps"] == 5, "what means the same may be changed"
    with pytest.raises(CheckpointError, match=LAST):
        run("qmix", tmp_path, pointing=False)


class Flipped(Board):
    """The board, misread at times."""

    def __init__(self, flips: float):
        self.flips = flips

    def hear(self, messages: Any, robot: str, rng: np.random.Generator) -> Any:
        return messages ^ (rng.random(messages.shape) < self.flips).astype(np.int8)


def test_own_words_of_another_size_are_played_again(tmp_path: Path) -> None:
    words = Symbols(vocabulary=8)
    train(partial(chmarl_pb.parallel_env, messages=words, max_steps=4), "qmix", CONFIGS["qmix"], tmp_path)
    given: dict[str, Any] = {"seeds": [0], "workers": 1, "tasks": ["val-unseen-000"]}
    assert chmarl_pb.evaluate(str(tmp_path / BEST), "val-unseen", messages=words, **given).episodes
    with pytest.raises(CheckpointError, match=r"other rules \(own words\).*messages='.*Symbols\(vocabulary=8"):
        chmarl_pb.evaluate(str(tmp_path / BEST), "val-unseen", messages=True, **given)


def test_a_run_goes_on_with_the_objects_that_it_was_begun_with(tmp_path: Path) -> None:
    def begin(channel: Any) -> Any:
        return train(partial(chmarl_pb.parallel_env, messages=channel, max_steps=4), "qmix", CONFIGS["qmix"], tmp_path)

    begin(Flipped(0.1))
    begin(Flipped(0.1))
    with pytest.raises(CheckpointError, match="what messages holds="):
        begin(Flipped(0.9))


def test_each_rule_is_remembered_and_the_papers_need_no_word() -> None:
    for given, kept in (
        ({}, {}), ({"messages": False, "feedback": False}, {}), ({"pointing": True}, {"pointing": True}),
        ({"messages": "symbols"}, {"messages": "symbols"}), ({"feedback": "planner"}, {"feedback": "planner"}),
        ({"track": "grounded"}, {"track": "grounded"}),
        ({"track": "grounded", "messages": True, "feedback": True, "pointing": False},
         {"track": "grounded", "messages": True, "feedback": True, "pointing": False}),
    ):  # fmt: skip
        options = Options(**given)
        assert recorded_rules(options) == kept
        again, silent = Options(**kept), options.track == "paper"
        assert all(getattr(again, name) == getattr(options, name) for name in ("pointing", "lookalikes", "templates"))
        assert silent or (again.messages, again.feedback) == (options.messages, options.feedback)


def test_graphs_colours_places_and_symbols_reach_the_networks() -> None:
    env_fn, _ = benchmark("scene_graph", **RULES)
    collector = Collector(env_fn, 1)
    env = collector.envs[0]
    agents = make_learner("qmix", collector.interface, CONFIGS["qmix"]).agents
    observations, _ = env.reset(options={"task": TASKS[1]})
    seen = observations["drone"]
    assert seen["node_color"].any() and seen["node_view"].any()

    def features(changed: dict[str, np.ndarray]) -> torch.Tensor:
        tensors = {key: torch.from_numpy(np.array(part))[None] for key, part in (seen | changed).items()}
        encoded: torch.Tensor = cast(Agent, agents["drone"]).encoder(tensors)
        return encoded

    heard = np.zeros_like(seen["messages"])
    heard[0, 7] = 1
    plain = features({})
    for changed in (
        {"node_color": seen["node_color"] * 0}, {"node_view": seen["node_view"] * 0.5}, {"messages": heard},
    ):  # fmt: skip
        assert not torch.allclose(features(changed), plain), changed.keys()
    collector.close()


@pytest.mark.parametrize("algorithm", ["imitation", "mappo"])
def test_an_interrupted_run_equals_an_uninterrupted_one(
    algorithm: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = run(algorithm, tmp_path / "whole")
    pieces, stopped = in_pieces(partial(run, algorithm, tmp_path / "pieces"), 13, monkeypatch)
    assert stopped and all(torch.equal(part, pieces[name]) for name, part in whole.items())


@pytest.mark.slow
def test_an_interrupted_run_in_generated_homes_equals_an_uninterrupted_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = run("imitation", tmp_path / "whole", split="generated")
    pieces, stopped = in_pieces(partial(run, "imitation", tmp_path / "pieces", split="generated"), 13, monkeypatch)
    assert stopped and all(torch.equal(part, pieces[name]) for name, part in whole.items())


def test_rules_are_flags_as_of_evaluate(capsys: pytest.CaptureFixture[str]) -> None:
    words = "--algo qmix --track grounded --no-pointing --feedback planner --messages --max-steps 40 --templates 1"
    command = parse([*words.split(), "--episodes", "7"])
    assert isinstance(command, Play) and command.config.episodes == 7
    options = command.env.options
    assert (options.track, options.split) == ("grounded", "generated")
    assert (options.pointing, options.lookalikes) == (False, True)
    assert (options.messages, options.feedback, options.max_steps, options.templates) == (True, "planner", 40, 1)
    other = parse(["--algo", "qmix", "--track", "grounded", "--split", "train"])
    assert isinstance(other, Play) and other.env.options.split == "train"
    names = {
        "--track grounded": "qmix-scene_graph-grounded-messages-seed0",
        "--track grounded --no-pointing": "qmix-scene_graph-grounded-messages-pointing-false-seed0",
        "--symbols --feedback": "qmix-scene_graph-messages-feedback-messages-symbols-seed0",
        "--messages --feedback --track paper": "qmix-scene_graph-messages-feedback-seed0",
    }
    for words, name in names.items():
        assert run_name(parse(["--algo", "qmix", *words.split()])) == name
    with pytest.raises(SystemExit):
        main(["--algo", "qmix", "--help"])
    assert "--no-pointing" in capsys.readouterr().out
    assert main(["--algo", "bc", "--track", "grounded"]) == 2
    assert "bc learns from stored episodes of the paper's rules" in capsys.readouterr().err


def test_the_horizon_follows_the_time_limit(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from chmarl_pb.cli import train as command

    trained: list[Any] = []
    monkeypatch.setattr(command, "train", lambda env_fn, *arguments, **options: trained.append(arguments))
    words = ["--algo", "imitation", "--track", "grounded", "--max-steps", "40", "--out", str(tmp_path)]
    assert main(words) == 0
    _, config, _, _, setting = trained[0][:5]
    assert config.horizon == 40 and setting["rules"] == {"track": "grounded", "max_steps": 40}
    assert config == replace(DAggerConfig(image_encoder="resnet18"), horizon=40)


def test_weights_of_another_track_are_no_start(tmp_path: Path) -> None:
    run("imitation", tmp_path)
    assert load(tmp_path / BEST)["setting"]["rules"]["track"] == "grounded"
    env_fn, setting = benchmark("scene_graph", split="val-unseen", max_steps=4)
    with pytest.raises(CheckpointError, match="was trained with"):
        train(env_fn, "mappo", replace(CONFIGS["mappo"], start=str(tmp_path / BEST)), setting=setting)  # type: ignore[call-arg]
