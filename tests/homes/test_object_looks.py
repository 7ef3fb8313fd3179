"""Looks of objects: other colours and sizes in other homes, the same classes, the same in any process."""

import hashlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import chmarl_pb
from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.homes.export import export_urdf
from chmarl_pb.homes.home import load_home
from chmarl_pb.homes.object_looks import SETS, with_looks

SETS_OF_LOOKS = [with_looks(BENCHMARK, number) for number in range(SETS)]


@pytest.fixture(scope="module")
def homes(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The same home with three sets of looks."""
    folder = tmp_path_factory.mktemp("looks")
    text = export_urdf(load_home("home_1"), folder / "home.urdf").read_text()
    files = []
    for number in (0, 1, 2):
        link = f'<link name="object_looks_{number}"/><joint name="looks" type="fixed"><parent link="home"/>'
        files.append(folder / f"home_{number}.urdf")
        files[-1].write_text(text.replace("</robot>", f'{link}<child link="object_looks_{number}"/></joint></robot>'))
    return [str(file) for file in files]


def test_every_class_has_at_least_three_looks() -> None:
    for name in BENCHMARK.graspables:
        assert len({catalog.graspables[name].model for catalog in SETS_OF_LOOKS}) >= 3, name


def test_ids_names_and_states_stay() -> None:
    for catalog in SETS_OF_LOOKS:
        assert catalog.class_ids == BENCHMARK.class_ids and catalog.state_ids == BENCHMARK.state_ids
        assert [row.names for row in catalog.rows] == [row.names for row in BENCHMARK.rows]
        assert catalog != BENCHMARK
    assert with_looks(BENCHMARK, 1) == with_looks(BENCHMARK, SETS + 1)


def test_looks_are_the_same_in_any_process() -> None:
    code = (
        "import hashlib; from chmarl_pb.catalog import BENCHMARK; from chmarl_pb.homes.object_looks import with_looks;"
        "models = [row.model for row in with_looks(BENCHMARK, 2).rows];"
        "print(hashlib.sha256(repr(models).encode()).hexdigest())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    models = [row.model for row in with_looks(BENCHMARK, 2).rows]
    assert done.stdout.strip() == hashlib.sha256(repr(models).encode()).hexdigest()


def test_objects_differ_in_size_and_stand_on_their_bottoms(homes: list[str]) -> None:
    sizes = []
    for home in homes:
        env = chmarl_pb.parallel_env(home=home)
        env.reset(seed=1)
        world = env.world
        sizes.append([world.size(name) for name in world.physics.objects])
        for name in world.objects:
            support = world.supports[name]
            assert world.pose(name)[0][2] == pytest.approx(support.height, abs=0.01)
        env.close()
    assert (np.ptp(sizes, axis=0) > 0.001).any(axis=1).mean() > 0.5


def test_both_renderers_draw_them_alike_and_no_two_sets_look_the_same(homes: list[str]) -> None:
    pictures = []
    for home in homes[:2]:
        found = []
        for renderer in ("fast", "tiny"):
            env = chmarl_pb.parallel_env(observation="visual", home=home, renderer=renderer, image_size=64)
            env.reset(seed=4)
            observations, *_ = env.step({"humanoid": 0, "drone": 0})
            found.append(np.stack([observations[name]["image"] for name in env.possible_agents]))
            env.close()
        fast, tiny = found
        np.testing.assert_array_equal(fast, tiny)
        pictures.append(fast)
    assert (pictures[0] != pictures[1]).any()


def test_the_planner_solves_tasks_with_them(homes: list[str]) -> None:
    env = chmarl_pb.parallel_env(home=homes[2])
    policy = chmarl_pb.make_policy("planner", env)
    for seed in range(4):
        assert chmarl_pb.rollout(env, policy, seed=seed).success
    env.close()


def test_a_home_without_the_link_has_the_usual_objects() -> None:
    assert load_home(Path("home_1")).catalog is BENCHMARK
