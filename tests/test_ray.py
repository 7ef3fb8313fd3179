"""A Ray cluster of two nodes gives what this machine gives, also when a node is lost; skipped without Ray."""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import chmarl_pb
from chmarl_pb.compiled import kernels
from chmarl_pb.data.generate import generate
from chmarl_pb.data.recipe import Recipe
from chmarl_pb.data.verify import verify
from chmarl_pb.errors import OptionError, TaskError

ray: Any = pytest.importorskip("ray", reason='needs the extra "scale": pip install -e ".[scale]"')
cluster_utils: Any = pytest.importorskip("ray.cluster_utils")
pytestmark = pytest.mark.slow

from chmarl_pb import ray_cluster  # noqa: E402
from chmarl_pb.ray_executor import RayExecutor  # noqa: E402
from tests.helpers.toy_vectors import same  # noqa: E402
from training.tables.on_ray import files_of  # noqa: E402
from training.tables.schedule import on_ray  # noqa: E402

ROOT = Path(__file__).parents[1]
IDS = [f"val-unseen-{number:03d}" for number in range(40)]
NODE = {"num_cpus": 1, "object_store_memory": 100 * 2**20}


def add_node(cluster: Any) -> Any:
    """Add a node with a folder of its own, as machines have: in one that is shared it would unpack over the others."""
    return cluster.add_node(**NODE, temp_dir=tempfile.mkdtemp(prefix="ray-", dir=cluster.folder))


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory(prefix="r", dir="/tmp") as folder:
        patch.setenv("RAY_USAGE_STATS_ENABLED", "0")
        Path("/tmp/ray").mkdir(exist_ok=True)  # where the test cluster notes its address, whatever its folder
        head = {**NODE, "include_dashboard": False, "temp_dir": folder}
        cluster = cluster_utils.Cluster(initialize_head=True, head_node_args=head)
        cluster.folder = folder
        add_node(cluster)
        yield cluster
        ray.shutdown()
        cluster.shutdown()


@pytest.fixture(scope="module")
def executor(cluster: Any) -> Iterator[RayExecutor]:
    with RayExecutor(cluster.address) as executor:
        yield executor


def where(number: int) -> tuple[int, str, str]:
    time.sleep(0.2)
    return number, ray.get_runtime_context().get_node_id(), chmarl_pb.__file__


def machine_code(number: int) -> int:
    return len(next(iter(kernels().values())))


def fail(number: int) -> int:
    raise TaskError(f"job {number} cannot be done")


def dawdle(number: int) -> tuple[int, str]:
    time.sleep(1)
    return number, ray.get_runtime_context().get_node_id()


def test_jobs_go_to_all_nodes_with_this_package(executor: RayExecutor) -> None:
    assert executor.workers == 2
    done = list(executor.map(where, range(20), ordered=True))
    assert [number for number, _, _ in done] == list(range(20))
    assert len({node for _, node, _ in done}) == 2
    assert {Path(file).resolve() == Path(chmarl_pb.__file__).resolve() for _, _, file in done} == {False}
    assert len({node for _, node, _ in executor.everywhere(where, [0])}) == 2


def test_nodes_need_not_compile(executor: RayExecutor) -> None:
    shipped = {file.name for files in kernels().values() for file in files}
    assert set(executor.everywhere(machine_code, [0])) == {len(shipped)}


def test_errors_arrive_as_they_are(executor: RayExecutor) -> None:
    with pytest.raises(TaskError, match="job 3 cannot"):
        list(executor.map(fail, [3]))


def test_evaluations_and_audits_are_equal(executor: RayExecutor, tmp_path: Path) -> None:
    here = chmarl_pb.evaluate("search", "val-unseen", seeds=[0], workers=1, tasks=IDS)
    assert chmarl_pb.evaluate("search", "val-unseen", seeds=[0], tasks=IDS, executor=executor).episodes == here.episodes
    audited = chmarl_pb.audit("val-unseen", seeds=[0], tasks=IDS[:3], executor=executor, out=tmp_path / "audit.json")
    assert audited.lines == chmarl_pb.audit("val-unseen", seeds=[0], tasks=IDS[:3], workers=1).lines


def test_data_sets_are_equal_to_the_byte(executor: RayExecutor, tmp_path: Path) -> None:
    recipe = Recipe("val-unseen", limit=6)
    there = generate(recipe, tmp_path / "there", executor=executor)
    assert there.sha256 == generate(recipe, tmp_path / "here", workers=1).sha256
    assert verify(there, executor=executor) == 6


def test_a_lost_node_costs_only_its_tasks(cluster: Any, executor: RayExecutor) -> None:
    """The node dies while it plays; its jobs are done again on the other, and each result comes once."""
    lost = add_node(cluster)
    while executor.workers < 3:
        time.sleep(0.2)
    results = executor.map(dawdle, range(16))
    first = [next(results) for _ in range(4)]
    cluster.remove_node(lost, allow_graceful=False)
    done = first + list(results)
    assert sorted(number for number, _ in done) == list(range(16))


def test_an_evaluation_survives_a_lost_node(cluster: Any, executor: RayExecutor, tmp_path: Path) -> None:
    lost = add_node(cluster)
    while executor.workers < 3:
        time.sleep(0.2)

    def kill(finished: int, total: int) -> None:
        nonlocal lost
        if finished >= 8 and lost is not None:
            cluster.remove_node(lost, allow_graceful=False)
            lost = None

    out = tmp_path / "search.json"
    there = chmarl_pb.evaluate("search", "val-unseen", tasks=IDS, executor=executor, out=out, progress=kill)
    assert lost is None and there.episodes == chmarl_pb.evaluate("search", "val-unseen", tasks=IDS, workers=1).episodes


@pytest.mark.parametrize("mode", ["SameStep", "NextStep"])
def test_vectors_are_equal(executor: RayExecutor, mode: str) -> None:
    options: dict[str, Any] = {"split": "val-unseen", "max_steps": 7, "autoreset_mode": mode}
    here = chmarl_pb.vector_env(5, workers=1, **options)
    there = chmarl_pb.vector_env(5, workers=2, backend="ray", **options)
    try:
        assert same(here.reset(seed=3), there.reset(seed=3))
        here.action_space.seed(0)
        for _ in range(30):
            actions = here.action_space.sample()
            assert same(here.step(actions), there.step(actions))
        assert there.get_attr("spec") == here.get_attr("spec")
        with pytest.raises(AttributeError):
            there.get_attr("nothing")
        with pytest.raises(OptionError, match="processors"):
            chmarl_pb.vector_env(50, workers=50, backend="ray", **options)
    finally:
        here.close()
        there.close()


def test_nobody_at_an_address_is_an_error_at_once() -> None:
    with pytest.raises(OSError, match="refused"):
        ray_cluster._knock("127.0.0.1:1")


def test_what_is_shipped_is_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own" / "meshes").mkdir(parents=True)
    for name in ("own/cabin.urdf", "own/meshes/a.obj", "my_policy.py", "secret.txt"):
        (tmp_path / name).write_text(name)
    with ray_cluster.shipped(["own/cabin.urdf", "my_policy.py"]) as folder:
        assert (folder / "own/meshes/a.obj").read_text() == "own/meshes/a.obj"
        assert (folder / "my_policy.py").is_file() and not (folder / "secret.txt").exists()
        assert (folder / "chmarl_pb/_assets/scenes/home_1.urdf").is_file()
    for wrong in (tmp_path / "my_policy.py", os.devnull, "missing.urdf"):
        with pytest.raises(OptionError, match="machines"), ray_cluster.shipped([wrong]):
            pass


def test_folders_and_files_of_a_step_travel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run" / "deep").mkdir(parents=True)
    for name in ("run/last.pt", "run/deep/a.json", "run/out.txt", "start.pt"):
        (tmp_path / name).write_text(name)
    found = files_of([Path("run"), Path("start.pt")])
    assert found == {Path(name): name.encode() for name in ("run/last.pt", "run/deep/a.json", "start.pt")}


def test_a_step_of_a_table_runs_on_a_node(cluster: Any, tmp_path: Path) -> None:
    shutil.copytree(ROOT / "training", tmp_path / "training")
    settings = ["--observation", "scene_graph", "--seed", "0", "--episodes", "8", "--out", "runs/vdn"]
    command = on_ray(cluster.address, ["training.train", "--algo", "vdn", *settings])
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])}
    read, write = os.pipe()  # a step ends when its standard input does
    try:
        ended = subprocess.run(command, cwd=tmp_path, env=env, stdin=read, capture_output=True, text=True, check=False)
    finally:
        os.close(read)
        os.close(write)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert (tmp_path / "runs/vdn/metrics.jsonl").is_file() and list((tmp_path / "runs/vdn").glob("*.pt"))
