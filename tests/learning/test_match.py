"""Grounding: instructions teach which classes they name, attention goes to those nodes, and numbers go past."""

from collections.abc import Iterator
from contextlib import closing
from functools import partial
from typing import Any, cast

import numpy as np
import pytest
import torch
from gymnasium import spaces

import chmarl_pb
from chmarl_pb import catalog
from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.learning import Config, train
from chmarl_pb.learning.algorithms.losses import grounding
from chmarl_pb.learning.algorithms.registry import ALGORITHMS, make_learner
from chmarl_pb.learning.networks import DictEncoder, build_encoder
from chmarl_pb.learning.networks.agents import Agent, make_agents
from chmarl_pb.learning.networks.match import ROOMS, Match, named_by
from chmarl_pb.learning.networks.tables import class_table, shared_map, word_table
from chmarl_pb.learning.rollouts.collect import Collector, greedy
from chmarl_pb.learning.rollouts.replay_buffer import ReplayBuffer
from chmarl_pb.tasks import language
from chmarl_pb.tasks.language.vectors import class_vectors
from chmarl_pb.tasks.splits import load_tasks

MUG, SOFA = BENCHMARK.class_ids["mug"], BENCHMARK.class_ids["sofa"]


@pytest.fixture(scope="module")
def env() -> Iterator[HouseholdEnv]:
    """The grounded track, with the goal."""
    env = HouseholdEnv(track="grounded", goal=True)
    yield env
    env.close()


def batch(space: spaces.Dict, *observations: dict[str, np.ndarray]) -> dict[str, torch.Tensor]:
    return {key: torch.from_numpy(np.stack([one[key] for one in observations])) for key in space.spaces}


def empty(space: spaces.Dict, text: str) -> dict[str, np.ndarray]:
    """Return an observation of nothing, with an instruction."""
    seen = {key: np.zeros_like(value) for key, value in space.sample().items()}
    return {**seen, "instruction": language.tokenize(text, len(seen["instruction"]), attributes=True)}


def likely(encode: DictEncoder, observation: dict[str, torch.Tensor]) -> torch.Tensor:
    """Return how likely an encoder holds the classes (B, X and Y) that instructions name."""
    tokens = observation["instruction"].flatten(0, -2)
    wanted = encode._asked("node_class", {"instruction": tokens}).wanted
    assert wanted is not None
    named = torch.from_numpy(np.stack([named_by(row)[0] for row in tokens.numpy()]))
    return wanted.classes.gather(2, named[..., None])[..., 0].detach()


def test_labels_are_what_instructions_name() -> None:
    red, bathroom = catalog.COLOUR_IDS["red"], 1 + ROOMS.index(BENCHMARK.class_ids["bathroom"])
    for where, room in (("", 0), (" in the washroom", bathroom)):
        tokens = language.tokenize(f"Put the red mug on the couch{where}.", 24, attributes=True)
        assert named_by(tokens).tolist() == [[MUG, SOFA], [red, -100], [room, -100]]
    assert (named_by(np.zeros(24, np.int16)) < 0).all()
    assert (named_by(language.tokenize("Put the mug away.", 24)) < 0).all()


@pytest.mark.parametrize("word_vectors", [False, True])
def test_classes_and_colours_are_learned_from_instructions(env: HouseholdEnv, word_vectors: bool) -> None:
    space = env.observation_space("humanoid")
    with torch.random.fork_rng():
        torch.manual_seed(0)
        encode = build_encoder(space, 16, graph_pool="grounded", word_vectors=word_vectors)
    assert isinstance(encode, DictEncoder)
    texts = [f"Put the {colour} {x} on the {y}." for colour, x, y in
             (("red", "mug", "bed"), ("blue", "apple", "sofa"), ("green", "towel", "desk"))]  # fmt: skip
    seen = batch(space, *(empty(space, text) for text in texts))
    optimizer = torch.optim.Adam(encode.parameters(), 0.01)
    before = likely(encode, seen)
    for _ in range(30):
        optimizer.zero_grad()
        encode.grounding_loss(seen).backward()
        optimizer.step()
    assert before.max() < 0.5 and likely(encode, seen).min() > 0.8


def test_attention_goes_to_x_of_the_colour_that_is_named(env: HouseholdEnv) -> None:
    """Where X is in the picture is among the features, whichever node it is; a lookalike's place is not."""
    space = env.observation_space("humanoid")
    seen = empty(space, "Put the red mug on the sofa.")
    seen["node_class"][:2] = MUG
    seen["node_state"][:2] = 1
    seen["node_color"][:2] = catalog.COLOUR_IDS["red"], catalog.COLOUR_IDS["blue"]
    red, blue = dict(seen), dict(seen)
    for place, one in ((0, red), (1, blue)):
        one["node_view"] = np.zeros_like(seen["node_view"])
        one["node_view"][place] = 0.9, 0.9, 0.1
    with torch.random.fork_rng():
        torch.manual_seed(0)
        encode = build_encoder(space, 16, graph_pool="grounded", word_vectors=True)
    assert isinstance(encode, DictEncoder)
    optimizer = torch.optim.Adam(encode.parameters(), 0.01)
    for _ in range(40):
        optimizer.zero_grad()
        encode.grounding_loss(batch(space, seen)).backward()
        optimizer.step()
    flat = batch(space, red, blue)
    part = encode.parts[encode.keys.index("node_class")]
    keys = ("node_class", "node_state", "edges", "node_color", "node_view")
    features = part(*(flat[key] for key in keys), asked=encode._asked("node_class", flat))
    of_x = features[:, 64 + 2 :].unflatten(1, (2, -1))[:, 0, -3:]
    torch.testing.assert_close(of_x[0], torch.tensor([0.9, 0.9, 0.1]), atol=0.1, rtol=0)
    assert of_x[1].abs().max() < 0.1


@pytest.mark.parametrize("pool", ["mean", "gated", "grounded"])
def test_colours_and_places_of_nodes_count(env: HouseholdEnv, pool: str) -> None:
    space = env.observation_space("humanoid")
    encode = build_encoder(space, 16, graph_pool=pool)
    assert isinstance(encode, DictEncoder) and not {"node_color", "node_view", "goal_attributes"} & {*encode.keys}
    seen = env.reset(seed=0)[0]["humanoid"]
    node = int(np.argmax(seen["node_class"] > 0))
    assert seen["node_class"][node]
    for key, value in (("node_color", 3), ("node_view", 0.7)):
        other = {**seen, key: seen[key].copy()}
        other[key][node] += value
        one, two = encode(batch(space, seen, other))
        assert not torch.equal(one, two)


@pytest.mark.parametrize(
    ("option", "named"),
    [("taught", "grounding_coef"), ("word_vectors",) * 2, ("numbers_past",) * 2, ("cells_past",) * 2],
)
def test_options_about_words_and_graphs_need_them(option: str, named: str) -> None:
    given: Any = {named: 1.0 if option == "taught" else True}
    config = Config(features=8, hidden=8, **given)
    plain: dict[str, spaces.Space[Any]] = {"b": spaces.Dict({"range": spaces.Box(0, 1, (3,))})}
    with pytest.raises(ValueError, match=f"^{named}"):
        make_agents(plain, {"b": 2}, config)
    if option in ("word_vectors", "numbers_past"):  # one that has it is enough: agents share their settings
        with closing(chmarl_pb.parallel_env()) as env:
            make_agents({"a": env.observation_space("humanoid"), "b": spaces.Box(0, 1, (3,))}, {"a": 2, "b": 2}, config)


@pytest.mark.parametrize("algorithm", ["qmix", "pqn", "mappo", "imitation"])
def test_every_learner_teaches_the_names_of_classes(algorithm: str) -> None:
    make = partial(chmarl_pb.parallel_env, split="val-unseen", max_steps=3)
    config = ALGORITHMS[algorithm].config(
        episodes=2, envs=2, batch_size=2, horizon=3, learning_starts=0, features=8, hidden=8, graph_pool="grounded",
        grounding_coef=1.0, numbers_past=True, word_vectors=True,
    )  # fmt: skip
    expert = partial(chmarl_pb.make_policy, "search")
    learner = train(make, algorithm, config, expert=expert).learner
    with closing(Collector(make, 2)) as collector:
        first = make_learner(algorithm, collector.interface, config)
        replay = ReplayBuffer(collector.interface, 3, 2, 1.0)
        for episode in collector.play(learner.agents, greedy, np.random.default_rng(0), [0, 1]):
            replay.add(episode)
    batch = replay.sample(2, np.random.default_rng(0))
    before, after = (
        [
            likely(cast(DictEncoder, agent.encoder), batch.observations[name]).mean()
            for name, agent in one.agents.items()
        ]
        for one in (first, learner)
    )
    assert sum(after) > sum(before) and not grounding(learner.agents, batch, 0.0)


def test_words_that_training_never_shows_are_read_by_what_lies_near() -> None:
    """Instructions of training teach most held-out names, too, and no receptacle is read as an object."""
    with torch.random.fork_rng():
        torch.manual_seed(0)
        meaning = shared_map()
        words, classes = word_table(language.vocabulary_size(), meaning), class_table(len(class_vectors()), meaning)
        match = Match(len(classes.weight), colours=False)
    optimizer = torch.optim.Adam([*match.parameters(), *meaning.parameters()], 0.005)
    taught, rng = instructions("train"), np.random.default_rng(0)
    for _ in range(80):
        optimizer.zero_grad()
        match.loss(taught[rng.integers(len(taught), size=48)], words, classes).backward()
        optimizer.step()
    asked = instructions("val-seen", "held-out")
    read = match(asked, words, classes).classes.argmax(dim=-1).numpy()
    named = np.stack([named_by(row)[0] for row in asked.numpy()])
    right = (read == named).all(axis=1)
    assert right.mean() > 0.8
    assert set(read[:, 1]) <= {BENCHMARK.class_ids[name] for name in BENCHMARK.receptacles}


def test_the_noise_of_the_loss_follows_from_its_count_alone() -> None:
    """As ``RunConfig`` says of ``seed``: two agents, or two runs, of the same weights hear the same noise."""
    losses = list[list[float]]()
    for seed in (0, 1):
        with torch.random.fork_rng():
            torch.manual_seed(7)
            meaning = shared_map()
            words, classes = word_table(language.vocabulary_size(), meaning), class_table(len(class_vectors()), meaning)
            match = Match(len(classes.weight), colours=False)
            torch.manual_seed(seed)
            losses.append([float(match.loss(instructions("val-seen"), words, classes).detach()) for _ in range(2)])
    assert losses[0] == losses[1] and losses[0][0] != losses[0][1]


def instructions(split: str, wording: str = "") -> torch.Tensor:
    """Return the token ids of a split's instructions, perhaps of one wording."""
    texts = [language.instruction(task) for task in load_tasks(split)]
    chosen = [text for text in texts if wording in ("", language.wording_of(text))]
    return torch.from_numpy(np.stack([language.tokenize(text, 32) for text in chosen]))


class Untaught(torch.nn.Module):
    """An encoder of one's own that nothing can teach."""

    def __init__(self, space: spaces.Dict, size: int, *names: str, **options: bool):
        super().__init__()
        self.inner = build_encoder(space, size)

    def forward(self, observation: dict[str, torch.Tensor]) -> torch.Tensor:
        features: torch.Tensor = self.inner(observation)
        return features


def test_an_encoder_that_cannot_be_taught_says_so(env: HouseholdEnv) -> None:
    config = ALGORITHMS["vdn"].config(encoder=f"{__name__}:Untaught", grounding_coef=1.0)
    with pytest.raises(ValueError, match=r"the encoder Untaught has no grounding_loss\(observation\)"):
        Agent(env.observation_space("humanoid"), (4,), config)


def test_a_pool_is_a_class_of_its_kind(env: HouseholdEnv) -> None:
    with pytest.raises(ValueError, match="is no pool; derive a class from GraphEncoder"):
        build_encoder(env.observation_space("humanoid"), 16, graph_pool=f"{__name__}:Untaught")


def test_settings_are_numbers() -> None:
    with pytest.raises(ValueError, match="envs='2': must be a number"):
        ALGORITHMS["vdn"].config(envs="2")  # type: ignore[arg-type]
