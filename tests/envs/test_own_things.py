"""Own objects and furniture: tasks, pictures, scene graphs, words and policies know them; the benchmark stays."""

import pickle
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest
from gymnasium.spaces import Box

import chmarl_pb
from chmarl_pb.catalog import BENCHMARK, class_of
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import AssetError, TaskError
from chmarl_pb.evaluation.drawn import draw_tasks
from chmarl_pb.evaluation.episode_file import load_episode, record_episode, replay_episode, save_episode
from chmarl_pb.tasks import language
from chmarl_pb.tasks.task import Task
from tests.helpers.own_things import write_things
from tests.helpers.small_homes import SMALL_HOME, home_text

HOME = {**SMALL_HOME, "livingroom/workbench_1": ((1.2, 0.6, 0.8), (-1.4, 0, 0.4))}
OWN = ("striped_crate", "post")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    """A home with an own piece of furniture, and the catalogue file that says what it is."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "home.urdf").write_text(home_text(HOME))
    return str(folder / "home.urdf"), str(write_things(folder))


@pytest.fixture(scope="module")
def env(files: tuple[str, str]) -> HouseholdEnv:
    home, catalog = files
    return chmarl_pb.parallel_env(("scene_graph", "visual"), home=home, catalog=catalog, image_size=64, goal=True)


def own_task(env: HouseholdEnv, item: str, seed: int = 0) -> Task:
    return Task(f"own-{seed}", str(env.options.home), item, "workbench", "sofa", seed)


@pytest.mark.parametrize("item", OWN)
def test_both_renderers_agree_on_own_things(env: HouseholdEnv, item: str) -> None:
    tiny = chmarl_pb.parallel_env(**{**vars(env.options), "renderer": "tiny"})
    task, policy, seen = own_task(env, item), chmarl_pb.make_policy("planner", env), False
    episode = chmarl_pb.rollout(env, policy, task=task)
    assert episode.success
    observations = [one.reset(options={"task": task})[0] for one in (env, tiny)]
    for actions in episode.actions:
        for robot, first in observations[0].items():
            for key, value in first.items():
                assert np.array_equal(value, observations[1][robot][key]), (robot, key)
        observations = [one.step(dict(actions))[0] for one in (env, tiny)]
        seen |= f"{item}_1" in env.outcome.seen["humanoid"]
    assert seen
    tiny.close()


@pytest.mark.parametrize("name", ["search", "reactive", "open-loop", "blind", "instruction-blind", "search-alone"])
def test_every_policy_plays_own_tasks(env: HouseholdEnv, name: str) -> None:
    task = Task("own-1", str(env.options.home), "striped_crate", "sofa", "workbench", 1)
    episode = chmarl_pb.rollout(env, chmarl_pb.make_policy(name, env), seed=0, task=task)
    assert episode.success == (name != "open-loop"), "no tour is for a class of one's own"


def test_drawn_tasks_are_of_own_things_too_and_can_be_solved(env: HouseholdEnv) -> None:
    drawn = []
    for seed in range(12):
        env.reset(seed=seed)
        drawn.append(env.task)
        assert env.task.optimal_steps > 0
    assert any("workbench" in (task.source, task.target) for task in drawn)
    rng, space = np.random.default_rng(0), env.simulation.space
    tasks = [env.options.kind.sample(space, "home", rng) for _ in range(400)]
    assert {task.graspable for task in tasks} == set(env.catalog.graspables)
    assert all(
        {task.source, task.target} <= {"desk", "workbench", "sofa"} for task in tasks if task.graspable == "post"
    )


def test_observations_show_own_ids_within_their_spaces(env: HouseholdEnv) -> None:
    env.reset(options={"task": own_task(env, "striped_crate")})
    space = env.observation_space("humanoid")
    classes = space["node_class"]
    assert isinstance(classes, Box)
    assert classes.high.max() == len(env.catalog.rows) == len(BENCHMARK.rows) + 4
    graphs = env.simulation.graphs
    graph = graphs.graph(env.world.state, ("livingroom/workbench_1", "striped_crate_1"), env.setting.states)
    ids = [env.catalog.class_ids[class_of(name)] for name in graph.names]
    assert graph.node_class[: len(ids)].tolist() == ids and ids[:2] == [
        len(BENCHMARK.rows) + 3,
        len(BENCHMARK.rows) + 1,
    ]
    assert graph.states[1] in ("sealed", "open")
    observations, _, _, _, _ = env.step(dict.fromkeys(env.agents, 0))
    assert all(space.contains(observation) for observation in observations.values())
    assert observations["humanoid"]["goal"][:2].tolist() == [ids[1], env.catalog.class_ids["sofa"]]
    assert env.state().shape == env.state_space.shape


def test_language_names_own_things(env: HouseholdEnv) -> None:
    words = language.vocabulary(env.catalog)
    fixed = language.vocabulary()
    assert list(words)[: len(fixed)] == list(fixed) and {"striped", "crate", "post"} <= words.keys() - fixed.keys()
    for seed in range(20):
        task = own_task(env, "striped_crate", seed)
        text = language.instruction(task, env.catalog)
        assert language.parse_instruction(text, env.catalog) == ("striped_crate", "sofa") and "slatted" not in text
        assert language.UNKNOWN not in language.tokenize(text, language.INSTRUCTION_LENGTH, env.catalog)
    tested = [Task(f"val-seen-{number}", "home", "striped_crate", "bed", "sofa", number) for number in range(40)]
    held_out = [language.instruction(task, env.catalog) for task in tested]
    assert any("slatted crate" in text for text in held_out)


def test_two_catalogues_live_in_one_process(env: HouseholdEnv, files: tuple[str, str]) -> None:
    plain = chmarl_pb.parallel_env(home=files[0])
    observation = plain.reset(seed=3)[0]["humanoid"]
    env.reset(seed=3)
    assert "striped_crate_1" not in plain.world.physics.objects and "striped_crate_1" in env.world.physics.objects
    assert "livingroom/workbench_1" not in plain.simulation.home.receptacles
    assert observation["node_class"].max() <= len(BENCHMARK.rows)
    with pytest.raises(TaskError, match="unknown graspable 'striped_crate'; own classes need catalog"):
        plain.reset(options={"task": own_task(env, "striped_crate")})
    with pytest.raises(TaskError, match="unknown graspable 'postt'; did you mean 'post'"):
        env.reset(options={"task": own_task(env, "postt")})
    plain.close()


def test_benchmark_s_tasks_play_as_ever(files: tuple[str, str]) -> None:
    envs = [chmarl_pb.parallel_env(split="val-unseen", catalog=catalog) for catalog in (None, files[1])]
    task = "val-unseen-003"
    observations = [env.reset(options={"task": task})[0] for env in envs]
    assert envs[0].world.state.objects == envs[1].world.state.objects or (
        envs[0].world.state.objects.poses == envs[1].world.state.objects.poses
    )
    for robot in envs[0].agents:
        for key in ("node_class", "node_state", "edges", "instruction"):
            assert np.array_equal(observations[0][robot][key], observations[1][robot][key])
    for env in envs:
        env.close()


def test_copies_and_the_environment_variable(
    env: HouseholdEnv, files: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for again in (deepcopy(env), pickle.loads(pickle.dumps(env))):
        assert again.catalog == env.catalog and again.observation_spaces == env.observation_spaces
        first, _ = env.reset(seed=5)
        second, _ = again.reset(seed=5)
        assert again.task == env.task
        assert all(np.array_equal(first[robot][key], second[robot][key]) for robot in first for key in first[robot])
        again.close()
    monkeypatch.setenv("CHMARL_CATALOG", files[1])
    named = chmarl_pb.parallel_env(home=files[0])
    monkeypatch.delenv("CHMARL_CATALOG")
    copy = deepcopy(named)
    assert named.catalog == copy.catalog == env.catalog and named.options.recorded()["catalog"] == files[1]
    named.close()
    copy.close()


def test_results_and_episode_files_know_the_catalogue(files: tuple[str, str], tmp_path: Path) -> None:
    home, catalog = files
    tasks = draw_tasks(home, 2, catalog=catalog)
    report = chmarl_pb.evaluate("search", tasks=tasks, seeds=[0], workers=1, catalog=catalog)
    env = chmarl_pb.parallel_env(home=home, catalog=catalog)
    assert report.settings["catalog_sha256"] == env.catalog.content
    assert "catalog" not in chmarl_pb.parallel_env(home=home).options.recorded()
    file = record_episode(env, chmarl_pb.make_policy("planner", env), "planner", 0, tasks[0])
    save_episode(file, tmp_path / "episode.json")
    assert replay_episode(load_episode(tmp_path / "episode.json")) is None and file.success


def test_missing_catalogue_is_said_at_once(files: tuple[str, str]) -> None:
    with pytest.raises(AssetError, match=r"none\.toml: does not exist"):
        chmarl_pb.parallel_env(home=files[0], catalog="none.toml")
