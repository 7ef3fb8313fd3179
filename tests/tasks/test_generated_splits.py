"""Splits in generated homes: which homes and tasks they have, and that the same seed plays the same in any process."""

import hashlib
import json
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from chmarl_pb.catalog import ROOM_KINDS
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import HomeError, TaskError
from chmarl_pb.homes.generate.names import seed_of
from chmarl_pb.homes.generate.rooms import rooms_of
from chmarl_pb.homes.home import home_names, load_home
from chmarl_pb.tasks import simulation, source, splits
from chmarl_pb.tasks.generated_homes import EPISODES_IN_A_HOME, SEEDS, HomeStream, fits, numbered_homes
from chmarl_pb.tasks.kinds import REARRANGE
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.simulations import Simulations
from chmarl_pb.tasks.source import TaskSource
from chmarl_pb.tasks.splits import GENERATED_HOMES, HOMES_FILE, STREAM, check_fixed, fixed_homes, homes_of, load_tasks
from chmarl_pb.tasks.task import Task

PLAY = """
import hashlib, json, sys
from chmarl_pb.envs.parallel import HouseholdEnv
from tests.tasks.test_generated_splits import facts
env = HouseholdEnv(split="generated")
print(json.dumps(facts(env, int(sys.argv[1]))))
"""


def facts(env: HouseholdEnv, seed: int) -> list[list[str]]:
    """Return what identifies three episodes, the first one reset with a seed."""
    found = []
    for number in range(3):
        observations, _ = env.reset(seed=seed if number == 0 else None)
        seen = b"".join(observations[robot][key].tobytes() for robot in observations for key in observations[robot])
        found.append([env.task.id, env.task.home, hashlib.sha256(seen).hexdigest()])
    return found


@pytest.fixture(scope="module")
def stream() -> Iterator[HouseholdEnv]:
    env = HouseholdEnv(split=STREAM)
    yield env
    env.close()


def unmade(home: str) -> Simulation:
    """Stand in for the simulation of a home where nobody looks at it."""
    return cast(Simulation, None)


@pytest.fixture
def no_solving(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tasks are drawn for homes that nobody makes."""
    monkeypatch.setattr(
        source,
        "draw_solvable",
        lambda sim, home, rng, kind: Task("t", home, "mug", "bed", "desk", int(rng.integers(9))),
    )


def test_seeds_of_the_splits_lie_apart() -> None:
    ranges = sorted(SEEDS.values(), key=lambda seeds: seeds.start)
    assert all(one.stop <= other.start for one, other in pairwise(ranges))
    assert ranges[0].start >= 1_000_000, "small seeds are left to those who look at homes"
    homes = {split: set(homes_of(split)) for split in GENERATED_HOMES}
    for split, own in homes.items():
        assert len(own) == GENERATED_HOMES[split] and all(seed_of(home) in SEEDS[split] for home in own)
    assert not homes["generated-val"] & homes["generated-test"]
    drawn = {next(numbered_homes(number)) for number in range(200)}
    assert len(drawn) == 200 and all(seed_of(home) in SEEDS[STREAM] for home in drawn)


def test_homes_have_the_rooms_of_the_benchmark() -> None:
    for split in GENERATED_HOMES:
        seeds = [seed for home in homes_of(split) if (seed := seed_of(home)) is not None]
        assert all(fits(seed) for seed in seeds)
        left_out = set(range(SEEDS[split].start, max(seeds))) - set(seeds)
        assert not any(fits(seed) for seed in left_out), "they are not the first that fit"
    assert load_home(homes_of("generated-val")[0]).goto_rooms == ROOM_KINDS


def test_more_than_half_of_all_seeds_fit() -> None:
    share = np.mean([fits(seed) for seed in range(4000)])
    assert share == pytest.approx(11 / 20, abs=0.02)
    assert not fits(next(seed for seed in range(100) if "bedroom_2" in rooms_of(seed)))


@pytest.mark.parametrize(("split", "each"), [("generated-val", 10), ("generated-test", 20)])
def test_fixed_tasks(split: str, each: int) -> None:
    tasks = load_tasks(split)
    assert Counter(task.home for task in tasks) == dict.fromkeys(homes_of(split), each)
    assert [home for home, _ in Counter(task.home for task in tasks).items()] == list(homes_of(split))
    assert all(task.home == other.home for task, other in zip(tasks[::each], tasks[each - 1 :: each], strict=True))
    assert (splits.FOLDER / f"{split}.csv").stat().st_size < 200_000


def test_the_planner_solves_fixed_tasks_in_as_many_steps() -> None:
    simulations = Simulations(Simulation, 1)
    for task in load_tasks("generated-val")[::125]:
        assert simulations.enter(task.home).solve(task).steps == task.optimal_steps
    simulations.close()


def test_homes_of_fixed_tasks_are_recorded() -> None:
    assert list(fixed_homes()) == [home for split in GENERATED_HOMES for home in homes_of(split)]
    home = homes_of("generated-test")[-1]
    assert load_home(home).content == fixed_homes()[home]


def test_a_home_that_comes_out_otherwise_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    name = homes_of("generated-val")[0]
    home = replace(load_home(name), content="0" * 64)
    with pytest.raises(HomeError, match=rf"{name} that tasks were made in.*generator has changed; remove .*generated-"):
        check_fixed(name, home)
    check_fixed(str(home.path), home)  # a file of the user's, whatever its name
    check_fixed("generated-3", home)
    monkeypatch.setattr(simulation, "load_home", lambda *arguments: home)
    with pytest.raises(HomeError, match="generator has changed"):
        Simulation(name)


def test_a_damaged_list_of_homes_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(splits, "HOMES_FILE", tmp_path / HOMES_FILE.name)
    assert splits.fixed_homes.__wrapped__() == {}, "without it tasks are built anew"
    splits.HOMES_FILE.write_text("0123  generated-1\nbroken\n")
    with pytest.raises(TaskError, match=r"generated-homes\.sha256.*restore the file"):
        splits.fixed_homes.__wrapped__()


def test_spaces_are_those_of_the_benchmark(stream: HouseholdEnv, env: HouseholdEnv) -> None:
    fixed = HouseholdEnv(split="generated-val")
    for other in (stream, fixed):
        assert other.rooms == env.rooms and other.action_names == env.action_names
        assert other.observation_spaces == env.observation_spaces and other.action_spaces == env.action_spaces
        assert other.state_space == env.state_space
    fixed.close()


def test_a_seed_decides_home_and_task_in_any_process(stream: HouseholdEnv) -> None:
    mine = facts(stream, 4321)
    facts(stream, 1234)
    assert facts(stream, 4321) == mine, "what was played before matters"
    done = subprocess.run(
        [sys.executable, "-c", PLAY, "4321"], capture_output=True, text=True, cwd=Path(__file__).parents[2]
    )
    assert json.loads(done.stdout.splitlines()[-1]) == mine, done.stderr
    assert len({home for _, home, _ in mine}) == 1 and len({task for task, _, _ in mine}) == 3


def test_an_environment_stays_in_a_home_for_some_episodes(no_solving: None) -> None:
    def homes(seed: int, count: int) -> list[str]:
        tasks, rng = TaskSource(STREAM, None, REARRANGE), np.random.default_rng(seed)
        tasks.begin(seed)
        return [tasks.draw(rng, unmade).home for _ in range(count)]

    played = homes(250, 3 * EPISODES_IN_A_HOME)
    assert list(Counter(played).values()) == [EPISODES_IN_A_HOME] * 3
    assert played == homes(250, 3 * EPISODES_IN_A_HOME), "the same seed leads through other homes"
    assert homes(299, 1) == homes(200, 1) == played[:1] != homes(300, 1), "seeds of a hundred share a home"


def test_without_a_seed_homes_are_random(no_solving: None) -> None:
    found = {TaskSource(STREAM, None, REARRANGE).draw(np.random.default_rng(n), unmade).home for n in (1, 2)}
    assert len(found) == 2


def test_a_home_without_solvable_tasks_is_skipped(monkeypatch: pytest.MonkeyPatch) -> None:
    homes = numbered_homes(0)
    first, second, third = next(homes), next(homes), next(homes)
    refused = {first: HomeError("too wide"), second: TaskError("no way")}

    def draw(simulation: None, home: str, rng: object, kind: object) -> Task:
        if home in refused:
            raise refused[home]
        return Task("t", home, "mug", "bed", "desk", 0)

    monkeypatch.setattr(source, "draw_solvable", draw)
    tasks = TaskSource(STREAM, None, REARRANGE)
    tasks.begin(7)
    assert [tasks.draw(np.random.default_rng(0), unmade).home for _ in range(3)] == [third] * 3
    refused |= {home: TaskError("no way") for home in (third, *(next(homes) for _ in range(20)))}
    tasks.begin(7)
    with pytest.raises(TaskError, match="no way"):
        tasks.draw(np.random.default_rng(0), unmade)


def test_a_stream_goes_on_from_the_home_that_took_another_s_place() -> None:
    stream, rng = HomeStream(), np.random.default_rng(0)
    stream.begin(0)
    left = stream.next(rng)
    taken = stream.skip()
    assert left != taken == stream.next(rng)


def test_few_simulations_are_kept() -> None:
    made: list[str] = []
    closed: list[str] = []

    class Fake(Simulation):
        def __init__(self, home: str):
            made.append(home)
            self.name, self.rooms = home, ("kitchen",)

        def close(self) -> None:
            closed.append(self.name)

    simulations = Simulations(Fake, 2)
    first, _ = simulations.enter("a"), simulations.enter("b")
    assert simulations.enter("a") is first and made == ["a", "b"]
    simulations.enter("c")
    assert closed == ["b"], "the one that was left longest ago gives way"
    assert simulations.enter("a") is first and simulations.enter("b") and made == ["a", "b", "c", "b"]
    simulations.close()
    assert sorted(closed) == ["a", "b", "b", "c"]


def test_environments_keep_the_homes_of_the_benchmark_and_one_of_the_stream(
    stream: HouseholdEnv, env: HouseholdEnv
) -> None:
    assert stream._simulations._most == 1 and env._simulations._most == len(home_names()) == 7
    for seed in (0, 100):
        stream.reset(seed=seed)
    assert len(stream._simulations._kept) == 1
    stream.step(dict.fromkeys(stream.agents, 0))
