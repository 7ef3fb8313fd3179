"""Data sets: the same for any number of processes, plain Minari, resumable, verifiable, with the planner's labels."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

pytest.importorskip("minari")  # none for Python 3.10

import h5py
import minari

from chmarl_pb.cli import main
from chmarl_pb.data import generate as generation
from chmarl_pb.data import statistics
from chmarl_pb.data.generate import generate
from chmarl_pb.data.read import Dataset, find_datasets
from chmarl_pb.data.recipe import Recipe
from chmarl_pb.data.record import Arrays, NoisyPlanner, make_env, record, replay
from chmarl_pb.data.store import dataset_folder, is_whole, parts_folder
from chmarl_pb.data.verify import chosen, first_difference, verify
from chmarl_pb.envs.rollout import rollout
from chmarl_pb.errors import BusyError, DatasetError, OptionError, WriteError
from chmarl_pb.files import Lock, file_hash
from chmarl_pb.policies.policy import core_of
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.tasks.splits import load_tasks
from chmarl_pb.tasks.task import Task
from tests.helpers.disk import full_disk

RECIPE = Recipe("test-unseen", noise=0.3, limit=3)
PLAIN = Recipe("test-unseen")


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one small data set, made by two processes."""
    folder = tmp_path_factory.mktemp("datasets")
    generate(RECIPE, folder, workers=2)
    return folder


@pytest.fixture
def dataset(root: Path, tmp_path: Path) -> Dataset:
    """A copy of that data set, to be damaged."""
    shutil.copytree(root, tmp_path, dirs_exist_ok=True)
    return find_datasets(tmp_path)[0]


@pytest.fixture(scope="module")
def joint() -> Iterator[gymnasium.Env]:
    env = make_env(PLAIN)
    yield env
    env.close()


def test_a_data_set_of_the_endless_split(tmp_path: Path) -> None:
    """Its tasks are drawn, and drawn again when it is verified."""
    recipe = Recipe("generated", limit=2)
    dataset = generate(recipe, tmp_path, workers=1)
    assert dataset.dataset_id == "chmarl/scene-graph-generated-v0" and find_datasets(tmp_path)[0].episodes == 2
    assert {dataset.episode(number)[1]["options/task/id"] for number in (0, 1)} == {task.id for task in recipe.tasks}
    assert verify(dataset, 1.0, 1, lambda _: None) == 2
    assert starts(dataset) == recipe.tasks


def starts(dataset: Dataset) -> list[Task]:
    """Return the tasks of the episodes that the stored seeds and options begin, in an environment that Minari makes."""
    data = minari.MinariDataset(dataset.folder / "data")
    env, begun = data.recover_environment(), []
    for row in data.storage.get_episode_metadata(range(dataset.episodes)):
        env.reset(seed=row["seed"], options=row["options"])
        begun.append(core_of(env).task)
    env.close()
    return begun


@pytest.mark.parametrize("name", ["my cabin", "2nd", "a-b.v2", "haus"])
def test_a_data_set_of_an_own_home(
    name: str, tmp_path: Path, small_home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It has a name for Minari, and is the same from wherever it is looked at."""
    home, data, elsewhere = tmp_path / f"{name}.urdf", tmp_path / "data", tmp_path / "elsewhere"
    small_home.rename(home)
    elsewhere.mkdir()
    monkeypatch.chdir(tmp_path)
    dataset = generate(Recipe(home=home.name, limit=1), data, 1)
    monkeypatch.chdir(elsewhere)
    assert minari.dataset.minari_dataset.parse_dataset_id(dataset.dataset_id)[0] == "chmarl"
    (found,) = find_datasets(data)
    assert verify(found, 1.0, 1) == 1 and starts(found) == Recipe(home=str(home), limit=1).tasks
    assert generate(Recipe(home=f"../{home.name}", limit=1), data, 1).sha256 == dataset.sha256
    assert "drawn for the home" in dataset.metadata["description"]


def test_a_data_set_of_limited_layouts(tmp_path: Path) -> None:
    """The planner solves its tasks in as many steps as they tell, and any number of processes makes the same bytes."""
    recipe = Recipe("train-limited", limit=3)
    dataset = generate(recipe, tmp_path / "one", workers=1)
    assert dataset.dataset_id == "chmarl/scene-graph-train-limited-v0"
    for number, task in enumerate(recipe.tasks):
        metadata = dataset.episode(number)[1]
        assert metadata["success"] and metadata["total_steps"] == task.optimal_steps
    assert generate(recipe, tmp_path / "two", workers=2).sha256 == dataset.sha256
    assert verify(dataset, 1.0, 1, lambda _: None) == 3


def rewrite(dataset: Dataset) -> None:
    """Make the checksum fit to a file that has been changed."""
    path = dataset.main.with_name("metadata.json")
    path.write_text(json.dumps({**dataset.metadata, "sha256": file_hash(dataset.main)}))


# Names and options


@pytest.mark.parametrize(
    ("recipe", "name"),
    [
        (Recipe(), "chmarl/scene-graph-train-v0"),
        (Recipe("val-seen", "visual"), "chmarl/visual-val-seen-v0"),
        (Recipe("train", noise=0.05), "chmarl/scene-graph-train-noise5-v0"),
    ],
)
def test_ids(recipe: Recipe, name: str) -> None:
    assert recipe.dataset_id == name


def test_names_of_the_package_are_no_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("humanoid", "drone", "home_6"):
        (tmp_path / name).touch()
    recipe = Recipe(home="home_6")
    assert recipe.home == "home_6" and recipe.dataset_id == "chmarl/scene-graph-train-home_6-v0"


@pytest.mark.parametrize(
    "options",
    [{"split": "tests"}, {"observation": "both"}, {"noise": 1.5}, {"noise": 0.123}, {"seed": -1}, {"limit": 0}],
)
def test_recipe_refuses(options: dict[str, Any]) -> None:
    with pytest.raises(OptionError):
        Recipe(**options)


def test_share_is_spread_evenly() -> None:
    assert chosen(10, 1) == list(range(10))
    assert chosen(11, 0.3) == [0, 5, 10]
    assert chosen(5, 0.01) == [0]
    with pytest.raises(OptionError):
        chosen(10, 0)


# Making


def test_one_process_makes_the_same_file(root: Path, tmp_path: Path) -> None:
    assert generate(RECIPE, tmp_path, workers=1).sha256 == find_datasets(root)[0].sha256


def test_complete_data_set_is_left_alone(root: Path) -> None:
    before = find_datasets(root)[0].main.stat().st_mtime_ns
    done: list[int] = []
    assert generate(RECIPE, root, progress=done.append).main.stat().st_mtime_ns == before
    assert done == [3]


def test_other_recipe_does_not_overwrite(root: Path) -> None:
    with pytest.raises(DatasetError, match="made from another "):
        generate(Recipe("test-unseen", noise=0.3, limit=2), root)


def test_killed_generation_goes_on(root: Path, tmp_path: Path) -> None:
    options = ["--split", "test-unseen", "--noise", "0.3", "--limit", "3", "--workers", "1", "--out", str(tmp_path)]
    command = [sys.executable, "-m", "chmarl_pb.cli", "dataset", "generate", *options]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    parts = parts_folder(tmp_path, RECIPE)
    other = parts.with_name(f"{parts.name[:-12]}{'0' * 12}")  # left by another version of the code
    other.mkdir(parents=True)
    deadline = time.monotonic() + 120
    while not list(parts.glob("*.hdf5")) and time.monotonic() < deadline:
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    finished = list(parts.glob("*.hdf5"))
    assert finished and not find_datasets(tmp_path)
    for name in ("joined", f"joined.{os.getpid()}"):  # of processes that were killed while they joined
        (parts / name / "data").mkdir(parents=True)
    finished[0].with_name("test-unseen-002.hdf5").write_bytes(b"cut")  # as after a loss of power
    done: list[int] = []
    assert generate(RECIPE, tmp_path, 1, done.append).sha256 == find_datasets(root)[0].sha256
    assert done[0] >= 1 and sum(done) == 3
    assert not parts.exists() and not other.exists()


def test_damaged_episode_of_an_unfinished_data_set_is_played_again(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(generation, "join_parts", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        generate(RECIPE, tmp_path, 1)
    monkeypatch.undo()
    parts = sorted(parts_folder(tmp_path, RECIPE).glob("*.hdf5"))
    assert len(parts) == 3 and all(map(is_whole, parts))
    flip(parts[0], 0.7)
    flip(parts[2], 0.0)
    done: list[int] = []
    assert generate(RECIPE, tmp_path, 1, done.append).sha256 == find_datasets(root)[0].sha256
    assert done == [1, 1, 1]


def test_only_one_process_makes_a_data_set(root: Path, tmp_path: Path) -> None:
    folder = dataset_folder(tmp_path, RECIPE.dataset_id)
    with Lock(folder):
        with pytest.raises(BusyError, match="scene-graph-test-unseen-noise30-v0: another process"):
            generate(RECIPE, tmp_path)
        with pytest.raises(BusyError):  # it has the same name, and would remove the other's episodes
            generate(Recipe("test-unseen", noise=0.3, limit=2), tmp_path)
        shutil.copytree(root / RECIPE.dataset_id, folder)
        assert generate(RECIPE, tmp_path).episodes == 3  # to read what is complete takes no lock


def test_full_disk_leaves_no_data_set(tmp_path: Path) -> None:
    with full_disk(5_000), pytest.raises(WriteError, match=r"test-unseen-00\d\.hdf5: cannot be written"):
        generate(RECIPE, tmp_path, 1)
    with full_disk(500_000), pytest.raises(WriteError, match=r"noise30-v0: cannot be written"):
        generate(RECIPE, tmp_path, 1)
    assert not find_datasets(tmp_path) and not list(tmp_path.rglob("*.tmp"))
    assert generate(RECIPE, tmp_path, 1).episodes == 3


# Reading


def test_plain_minari_reads_it(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(root))
    data = minari.load_dataset("chmarl/scene-graph-test-unseen-noise30-v0")
    assert list(minari.list_local_datasets()) == [data.id]
    assert data.total_episodes == 3 and data.spec.env_spec.id == "CHMARL/SceneGraph-v0"
    for task, episode in zip(RECIPE.tasks, data, strict=True):
        steps = len(episode)
        assert episode.actions.shape == (steps, 2) and episode.rewards.shape == (steps,)
        assert (episode.terminations | episode.truncations).tolist() == [False] * (steps - 1) + [True]
        assert {len(values) for values in episode.observations.values()} == {steps + 1}
        for step in range(steps + 1):
            assert data.observation_space.contains({name: row[step] for name, row in episode.observations.items()})
        assert all(data.action_space.contains(action) for action in episode.actions)
        assert np.allclose(np.diff(episode.infos["potential"]), episode.rewards)
        assert len(set(map(len, episode.infos["state_hash"]))) == 1
        metadata = next(iter(data.storage.get_episode_metadata([episode.id])))
        assert metadata["options"] == {"task": task.id} and metadata["optimal_steps"] == task.optimal_steps


def test_metadata_repeats_an_episode(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(root))
    data = minari.load_dataset("chmarl/scene-graph-test-unseen-noise30-v0")
    env = gymnasium.make(data.spec.env_spec)
    metadata = next(iter(data.storage.get_episode_metadata([1])))
    observation, info = env.reset(seed=metadata["seed"], options=metadata["options"])
    for step, action in enumerate(data[1].actions, start=1):
        observation, reward, *_, info = env.step(action)
        assert reward == data[1].rewards[step - 1]
        assert all(np.array_equal(values, data[1].observations[name][step]) for name, values in observation.items())
        assert " ".join(info["drone"]["visible"]).encode() == data[1].infos["drone"]["visible"][step]
        assert info["humanoid"]["feedback"].encode() == data[1].infos["humanoid"]["feedback"][step]
    env.close()


def part_of(arrays: Arrays, *keys: str) -> np.ndarray:
    """Return the array at a place."""
    found: Arrays | np.ndarray = arrays
    for key in keys:
        assert isinstance(found, dict)
        found = found[key]
    assert isinstance(found, np.ndarray)
    return found


def test_pictures_are_stored_without_loss(
    joint: gymnasium.Env, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recipe = Recipe("test-unseen", "visual", limit=1)
    generate(recipe, tmp_path, workers=1)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    episode = minari.load_dataset(recipe.dataset_id)[0]
    env = make_env(recipe)
    again = replay(env, episode.actions, recipe.tasks[0]).arrays
    env.close()
    stored = episode.observations["humanoid_image"]
    assert stored.shape[1:] == (128, 128, 3)
    assert np.array_equal(stored, part_of(again, "observations", "humanoid_image"))
    graphs = record(joint, NoisyPlanner(core_of(joint), 0, 0), recipe.tasks[0])
    assert np.array_equal(part_of(graphs.arrays, "infos", "state_hash"), episode.infos["state_hash"])


# Verifying


def test_verify_passes(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["dataset", "verify", "--out", str(root), "--share", "0.7", "--workers", "1"]) == 0
    assert "2 of 3 episodes replayed" in capsys.readouterr().out


@pytest.mark.parametrize("change", [{"noise": "x"}, {"limit": "3"}, {"home": 5}, {"robots": 5}, {"seed": []}], ids=str)
def test_verify_refuses_a_recipe_of_another_kind(change: dict[str, Any], root: Path) -> None:
    (dataset,) = find_datasets(root)
    dataset.recipe = dataset.recipe | change
    with pytest.raises(DatasetError, match="its recipe is damaged"):
        verify(dataset, 1.0, 1)


def test_verify_knows_no_other_splits(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["dataset", "verify", "--out", str(root), "--split", "foo"]) == 2
    assert "unknown split 'foo'" in capsys.readouterr().err


def flip(path: Path, where: float) -> None:
    """Change a bit of a file, at a share of its length."""
    content = bytearray(path.read_bytes())
    content[int(where * len(content))] ^= 1
    path.write_bytes(content)


@pytest.mark.parametrize("where", [0.1, 0.5, 0.9])
def test_changed_byte_is_found(dataset: Dataset, where: float, capsys: pytest.CaptureFixture[str]) -> None:
    dataset.episode(0)  # whole, and known to be so
    flip(dataset.main, where)
    for read in (verify, statistics.dataset_statistics, lambda damaged: damaged.episode(0)):
        with pytest.raises(DatasetError, match=r"main_data\.hdf5: corrupted or cut"):
            read(dataset)
    assert main(["dataset", "stats", "--out", str(dataset.folder.parents[1])]) == 2
    assert f"{dataset.main}: corrupted" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["total_episodes", "total_steps"])
def test_metadata_that_do_not_fit_are_found(dataset: Dataset, name: str) -> None:
    dataset.metadata[name] -= 1
    rewrite(dataset)
    with pytest.raises(DatasetError, match=r"main_data\.hdf5: has 3 episodes of .* but its metadata\.json tells of"):
        statistics.dataset_statistics(Dataset(dataset.folder))


def test_cut_file_is_found(dataset: Dataset, capsys: pytest.CaptureFixture[str]) -> None:
    dataset.main.write_bytes(dataset.main.read_bytes()[:-1000])
    with pytest.raises(DatasetError, match=r"main_data\.hdf5: corrupted or cut"):
        dataset.episode(0)
    assert main(["dataset", "verify", "--out", str(dataset.folder.parents[1])]) == 2
    assert str(dataset.main) in capsys.readouterr().err


def test_endless_files_and_files_that_are_none_are_found(dataset: Dataset) -> None:
    os.truncate(dataset.main, 10**13)  # no block of it is written, but all of it would be summed up
    with pytest.raises(DatasetError, match=r"main_data\.hdf5: corrupted or cut, its size has changed"):
        Dataset(dataset.folder).check()
    for path, what in ((dataset.main, "main_data"), (dataset.main.with_name("metadata.json"), "metadata")):
        path.unlink()
        os.mkfifo(path)
        with pytest.raises(DatasetError, match=rf"{what}\.\w+: .*regular file"):
            Dataset(dataset.folder).check()


def test_missing_and_damaged_metadata_are_found(dataset: Dataset) -> None:
    path = dataset.main.with_name("metadata.json")
    path.write_text(path.read_text()[:-20])
    with pytest.raises(DatasetError, match=r"metadata\.json: damaged"):
        Dataset(dataset.folder)
    path.unlink()
    with pytest.raises(DatasetError, match=r"metadata\.json: missing"):
        Dataset(dataset.folder)


def test_changed_action_is_found_by_the_replay(dataset: Dataset) -> None:
    with h5py.File(dataset.main, "a") as file:
        actions = file["episode_1/actions"]
        actions[0] = (actions[0] + 1) % (10, 9)
    rewrite(dataset)
    with pytest.raises(DatasetError, match=r"main_data\.hdf5: episode 1 \(test-unseen-001\): the replay differs in"):
        verify(Dataset(dataset.folder), workers=1)


@pytest.mark.parametrize(
    ("name", "value"),
    [("infos/planner_action", None), ("success", False), ("seed", 1), ("optimal_steps", 1), ("target", "bed")],
)
def test_changed_label_or_fact_is_found_by_the_replay(dataset: Dataset, name: str, value: Any) -> None:
    with h5py.File(dataset.main, "a") as file:
        if value is None:
            file[f"episode_1/{name}"][...] = 8
        else:
            file["episode_1"].attrs[name] = value
    rewrite(dataset)
    with pytest.raises(DatasetError, match=rf"main_data\.hdf5: episode 1 .*{name}"):
        verify(Dataset(dataset.folder), workers=1)


def test_data_set_of_other_homes_is_refused(dataset: Dataset) -> None:
    dataset.metadata["recipe"]["homes_sha256"]["home_7"] = "0"
    rewrite(dataset)
    with pytest.raises(DatasetError, match="another homes_sha256"):
        verify(Dataset(dataset.folder))


def test_data_set_of_an_earlier_version_is_used_and_verified(dataset: Dataset) -> None:
    dataset.metadata["recipe"]["version"] = "0.1.0"  # as that version wrote it
    rewrite(dataset)
    assert verify(Dataset(dataset.folder), share=0.3, workers=1) == 1
    assert generate(RECIPE, dataset.folder.parents[1]).sha256 == dataset.sha256


def test_difference_is_named() -> None:
    stored: Arrays = {"infos": {"potential": np.zeros(3)}, "rewards": np.zeros(2)}
    assert first_difference(stored, {"infos": {"potential": np.zeros(3)}, "rewards": np.zeros(2)}) is None
    changed: Arrays = {"infos": {"potential": np.array([0, 0, 1.0])}, "rewards": np.zeros(2)}
    assert first_difference(stored, changed) == "infos/potential at step 2"
    assert "rewards" in (first_difference(stored, {"infos": {"potential": np.zeros(3)}}) or "")


# Labels and cooperation


def test_without_noise_the_planner_acts(joint: gymnasium.Env) -> None:
    task = load_tasks("test-unseen")[0]
    arrays = record(joint, NoisyPlanner(core_of(joint), 0, 0), task).arrays
    actions = part_of(arrays, "actions")
    assert np.array_equal(part_of(arrays, "infos", "planner_action")[:-1], actions)
    assert len(actions) == task.optimal_steps


def test_noisy_labels_are_optimal_actions(joint: gymnasium.Env) -> None:
    """In every state, also after random actions, the label shortens the plan of the humanoid by one step."""
    core, task = core_of(joint), load_tasks("test-unseen")[3]
    arrays = record(joint, NoisyPlanner(core, 0.4, 1), task).arrays
    actions, labels = part_of(arrays, "actions"), part_of(arrays, "infos", "planner_action")
    assert (actions != labels[:-1]).any()
    for step in range(len(actions)):
        core.reset(options={"task": task})
        for humanoid, drone in actions[:step]:
            core.step({"humanoid": humanoid, "drone": drone})
        left = len(core.simulation.oracle.plan(core.setting.goal))
        core.step({"humanoid": labels[step, 0], "drone": labels[step, 1]})
        assert len(core.simulation.oracle.plan(core.setting.goal)) == left - 1


def test_noise_depends_on_the_seed_alone(joint: gymnasium.Env) -> None:
    task = load_tasks("test-unseen")[1]
    first, again, other = (record(joint, NoisyPlanner(core_of(joint), 0.5, seed), task).arrays for seed in (0, 0, 1))
    assert first_difference(first, again) is None
    assert first_difference(first, other) is not None


def test_planner_tells_of_both_before_they_are_needed(joint: gymnasium.Env) -> None:
    """The drone, not only the humanoid, finds X and Y, and its words come before Pick and Place."""
    core = core_of(joint)
    drone_first, flown = 0, 0
    for task in load_tasks("test-unseen")[:10]:
        episode = rollout(core, make_policy("planner", core), task=task)
        stay, pick = core.action_names["drone"].index("stay"), core.action_names["humanoid"].index("pick")
        picked = [step["humanoid"] for step in episode.actions].index(pick)
        flown += sum(step["drone"] != stay for step in episode.actions)
        assert episode.observations[picked]["humanoid"]["messages"][0].any()
        assert episode.observations[len(episode) - 1]["humanoid"]["messages"][1].any()
        sights = [[task.item in info[robot]["visible"] for info in episode.infos] for robot in ("drone", "humanoid")]
        drone_first += any(sights[0]) and sights[0].index(True) < sights[1].index(True)
    assert drone_first >= 2 and flown >= 5
