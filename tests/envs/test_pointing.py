"""Pointing: Pick and Place act on what the named cell of the picture shows, right or wrong."""

import copy
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

import chmarl_pb
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import OptionError
from chmarl_pb.evaluation.episode_file import load_episode, record_episode, replay_episode, save_episode
from chmarl_pb.evaluation.golden import digest
from chmarl_pb.policies.policy import Actions
from chmarl_pb.policies.registry import BUILT_IN, make_policy
from chmarl_pb.rendering.renderer import VISIBILITY_SIZE
from chmarl_pb.robots.pointing import CELLS, VERBS, cell_of, named, pointing_actions, verb_of
from chmarl_pb.tasks.splits import load_tasks
from tests.helpers.playing import DRONE_ACTIONS, HUMANOID_ACTIONS, play

TASKS = load_tasks("val-unseen")[::6]


@pytest.fixture(scope="module")
def env() -> Iterator[HouseholdEnv]:
    env = chmarl_pb.parallel_env(split="val-unseen", pointing=True)
    yield env
    env.close()


def do(env: HouseholdEnv, action: str) -> None:
    """Let the humanoid do something while the drone stays."""
    names = env.action_names
    env.step({"humanoid": names["humanoid"].index(action), "drone": names["drone"].index("stay")})


def shown_in(env: HouseholdEnv, cell: tuple[int, int], names: set[str]) -> str | None:
    """Return what of some things has most pixels in a cell of the humanoid's picture, counted one by one."""
    renderer, best = env.simulation.renderer, (0, "")
    picture = renderer.picture("humanoid", VISIBILITY_SIZE).segmentation
    for name in names & set(env.outcome.seen["humanoid"]):
        number, pixels = renderer.names.index(name), 0
        for row, column in np.argwhere(picture == number).tolist():
            middle = (row + 0.5) / VISIBILITY_SIZE, (column + 0.5) / VISIBILITY_SIZE
            pixels += (int(3 * middle[0]), int(3 * middle[1])) == cell
        best = max(best, (pixels, name), key=lambda found: found[0])
    return best[1] or None


def wrong_pick(env: HouseholdEnv) -> str | None:
    """Turn until something else than X can be picked, and pick it; return its name."""
    for _ in range(12):
        pointer, x = env.simulation.pointer, env.setting.goal.item
        assert pointer is not None
        for action, thing in pointer.shown("humanoid", "pick").items():
            if thing != x:
                do(env, action)
                if env.world.held == thing:
                    return thing
        do(env, "turn_left")
    return None


def test_names_say_row_and_column(env: HouseholdEnv) -> None:
    names = env.action_names["humanoid"]
    assert len(names) == 8 + 18 and len(set(names)) == 26 and env.action_names["drone"] == DRONE_ACTIONS
    assert names[4:13] == tuple(f"pick_{row}_{column}" for row, column in product(range(3), repeat=2))
    assert names[13:22] == tuple(f"place_{row}_{column}" for row, column in product(range(3), repeat=2))
    assert tuple(dict.fromkeys(map(verb_of, names))) == HUMANOID_ACTIONS
    assert pointing_actions(DRONE_ACTIONS) == DRONE_ACTIONS
    assert cell_of("pick_0_2") == (0, 2) and cell_of("pick") is cell_of("goto_bedroom_2") is None


def test_what_the_cell_shows_is_what_moves(env: HouseholdEnv) -> None:
    rng, counts = np.random.default_rng(0), {"pick": 0, "place": 0, "failed": 0}
    objects, receptacles = set(env.world.physics.objects), set(env.world.home.receptacles)
    for task in TASKS:
        env.reset(options={"task": task})
        while env.agents:
            verb = VERBS[env.world.held is not None]
            cell = CELLS[rng.integers(9)]
            action = named(verb, cell) if rng.random() < 0.6 else str(rng.choice(env.action_names["humanoid"]))
            held, before, target = env.world.held, env.world.state, None
            if verb_of(action) == verb:
                target = shown_in(env, cell_of(action) or cell, objects if verb == "pick" else receptacles)
            do(env, action)
            if verb_of(action) not in VERBS:
                continue
            moved = {n for n, pose in env.world.state.objects.poses.items() if pose != before.objects.poses[n]}
            if env.world.held == held:
                counts["failed"] += 1
                assert not moved and env.world.state.robots["humanoid"] is before.robots["humanoid"]
            elif verb == "pick":
                counts["pick"] += 1
                assert env.world.held == target and moved == {target}
            else:
                counts["place"] += 1
                assert held is not None and env.world.supports[held].receptacle == target and moved == {held}
    assert min(counts.values()) > 5, counts


def test_a_wrong_object_counts_for_nothing_and_can_be_put_anywhere(env: HouseholdEnv) -> None:
    env.reset(options={"task": TASKS[0]})
    wrong, x = wrong_pick(env), env.setting.goal.item
    assert wrong is not None and env.outcome.potential <= 2 and not env.outcome.success and x in env.world.supports
    for _ in range(12):
        pointer = env.simulation.pointer
        assert pointer is not None
        for action, receptacle in pointer.shown("humanoid", "place").items():
            do(env, action)
            if env.world.held is None:
                assert env.world.supports[wrong].receptacle == receptacle and not env.outcome.success
                return
        do(env, "turn_left")
    pytest.fail("it could not be put down")


def test_nodes_say_where_they_are(env: HouseholdEnv) -> None:
    observations, infos = env.reset(seed=2)
    for robot, seen in observations.items():
        assert env.observation_space(robot).contains(seen)
        picture = env.simulation.renderer.picture(robot, VISIBILITY_SIZE).segmentation
        names, views = env.simulation.renderer.names, seen["node_view"]
        count = len(infos[robot]["visible"])
        for name, (u, v, share) in zip(infos[robot]["visible"], views.tolist(), strict=False):
            rows, columns = np.nonzero(picture == names.index(name))
            assert share == pytest.approx(len(rows) / picture.size) and share > 0
            assert (u, v) == pytest.approx(((columns.mean() + 0.5) / 128, (rows.mean() + 0.5) / 128), abs=1e-6)
        assert count and not views[count:].any()


def test_only_graphs_say_it_and_only_with_the_option() -> None:
    plain, pictures = chmarl_pb.parallel_env(), chmarl_pb.parallel_env("visual", pointing=True)
    for other in (plain, pictures):
        assert "node_view" not in other.observation_space("humanoid").spaces
        other.close()
    assert plain.action_names["humanoid"] == HUMANOID_ACTIONS
    with pytest.raises(OptionError, match="pointing=2 is not known"):
        chmarl_pb.parallel_env(pointing=2)


def test_the_planner_takes_the_steps_that_it_says_and_names_the_right_cell(env: HouseholdEnv) -> None:
    policy = make_policy("planner", env)
    for task in TASKS:
        env.reset(options={"task": task})
        plan = env.simulation.solve(task)
        episode = chmarl_pb.rollout(env, policy, 0, task)
        assert episode.success and len(episode) == plan.steps >= task.optimal_steps
        assert not plan.proven or plan.steps <= 4


def test_the_planner_waits_until_a_cell_names_x(env: HouseholdEnv) -> None:
    """Where its plan is longer than the paper's, the paper's Pick or Place would have come too early."""
    longer = 0
    for task in load_tasks("val-unseen")[::3]:
        env.reset(options={"task": task})
        plan = next(iter(env.simulation.solve(task).plans.values())).actions
        if len(plan) == task.optimal_steps:
            continue
        longer += 1
        env.reset(options={"task": task})
        oracle = env.simulation.oracle
        for action in plan:
            works = set(oracle.useful(env.setting.goal))
            assert (action in works) == bool(works), "it waits although a cell would do, or acts in vain"
            do(env, action)
        assert env.outcome.success
    assert longer >= 2


def test_the_planner_puts_a_wrong_object_away_first(env: HouseholdEnv) -> None:
    policy, solved = make_policy("planner", env), 0
    for task in TASKS[:5]:
        observations, infos = env.reset(options={"task": task})
        policy.reset(0)
        if wrong_pick(env) is None:
            continue
        names = env.action_names
        stay: Actions = {robot: names[robot].index("stay") for robot in names}
        if not env.agents:
            continue
        observations, _, _, _, infos = env.step(stay)
        while env.agents:
            observations, _, _, _, infos = env.step(policy.act(observations, infos))
        solved += env.outcome.success
    assert solved >= 2


@pytest.mark.parametrize("style", ["paper", "planner"])
def test_feedback_tells_of_wrong_cells(style: str) -> None:
    env = chmarl_pb.parallel_env(split="val-unseen", pointing=True, feedback=style)
    told = 0
    for task in TASKS:
        env.reset(options={"task": task})
        for action in next(iter(env.simulation.solve(task).plans.values())).actions:
            useful = set(env.simulation.oracle.useful(env.setting.goal))
            if not useful:
                do_and_hear(env, action)
                continue
            bad = next(named(verb_of(action), cell) for cell in CELLS if named(verb_of(action), cell) not in useful)
            assert do_and_hear(env, bad), "it says nothing of a wrong cell"
            told += 1
            break
    assert told == len(TASKS)
    env.reset(options={"task": TASKS[0]})
    for action in next(iter(env.simulation.solve(TASKS[0]).plans.values())).actions:
        assert not do_and_hear(env, action), "it complains of the planner"
    env.close()


def do_and_hear(env: HouseholdEnv, action: str) -> str:
    """Let the humanoid do something; return the feedback."""
    names = env.action_names
    results = env.step({"humanoid": names["humanoid"].index(action), "drone": names["drone"].index("stay")})
    return str(results[-1]["humanoid"]["feedback"])


@pytest.mark.parametrize("observation", ["scene_graph", "visual"])
def test_every_policy_plays(observation: str) -> None:
    env = chmarl_pb.parallel_env(observation, split="val-unseen", pointing=True, image_size=64)
    for name in BUILT_IN:
        for task in TASKS[:2]:
            episode = chmarl_pb.rollout(env, make_policy(name, env), 0, task)
            assert len(episode) and (episode.success or name != "planner"), name
    env.close()


def test_search_points_by_the_graph(env: HouseholdEnv) -> None:
    policy = make_policy("search", env)
    solved = [chmarl_pb.rollout(env, policy, 1, task).success for task in TASKS]
    assert sum(solved) > 0.4 * len(solved), solved


def test_equal_seeds_give_equal_episodes_in_copies_and_by_the_plain_renderer(env: HouseholdEnv) -> None:
    twin = copy.deepcopy(env)
    assert play(env, 3) == play(twin, 3)
    twin.close()
    plain = chmarl_pb.parallel_env(split="val-unseen", pointing=True, renderer="tiny")
    assert play(env, 4, 6) == play(plain, 4, 6)
    plain.close()


def test_gymnasium_and_vectors_take_it() -> None:
    joint = gymnasium.make("CHMARL/SceneGraph-v0", pointing=True, split="val-unseen")
    assert joint.action_space == spaces.MultiDiscrete([26, 9])
    joint.reset(seed=0)
    joint.step(joint.action_space.sample())
    joint.close()
    single = gymnasium.make("CHMARL/SceneGraphHumanoid-v0", pointing=True, split="val-unseen")
    assert single.action_space == spaces.Discrete(26)
    single.close()
    vector = chmarl_pb.vector_env(2, workers=0, pointing=True, split="val-unseen")
    observations, _ = vector.reset(seed=0)
    assert observations["humanoid_node_view"].shape == (2, 96, 3)
    vector.close()


def test_episode_files_keep_it(env: HouseholdEnv, tmp_path: Path) -> None:
    file = record_episode(env, make_policy("planner", env), "planner", 0, TASKS[1])
    save_episode(file, tmp_path / "episode.json")
    again = load_episode(tmp_path / "episode.json")
    assert again.options["pointing"] is True and again.success and replay_episode(again) is None


def test_results_stand_apart_and_have_their_own_optimum() -> None:
    report = chmarl_pb.evaluate("planner", "val-unseen", tasks=TASKS[:3], workers=1, pointing=True)
    assert report.settings["options"]["pointing"] is True and report.changed == "pointing"
    assert report.plw == 1.0 and report.cooperation is None
    assert all(episode.optimum is not None for episode in report.episodes)


def test_cells_do_not_depend_on_the_size_of_pictures(env: HouseholdEnv) -> None:
    small = chmarl_pb.parallel_env("visual", split="val-unseen", pointing=True, image_size=32)
    small.reset(options={"task": TASKS[0]})
    env.reset(options={"task": TASKS[0]})
    pointers = env.simulation.pointer, small.simulation.pointer
    assert all(pointers)
    found = [digest(pointer.shown("humanoid", "place")) for pointer in pointers if pointer]
    assert found[0] == found[1]
    small.close()
