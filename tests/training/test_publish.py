"""A finished run becomes weights that come with the package, and its row is played again by its name."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import torch

import chmarl_pb
from chmarl_pb.cli import main as chmarl_main
from chmarl_pb.errors import ChmarlError, OptionError, ResultError
from chmarl_pb.evaluation import plan
from chmarl_pb.learning import Config, train
from chmarl_pb.policies import weights
from chmarl_pb.policies.weights import read_manifest
from chmarl_pb.tasks.splits import load_tasks
from training.publish import main, publish
from training.score import score

torch.set_num_threads(1)  # these networks are too small for more
TINY = Config(
    episodes=4, envs=1, horizon=4, gradient_steps=1, batch_size=2, learning_starts=2, buffer_size=4, features=8,
    hidden=8,
)  # fmt: skip
TASKS = load_tasks("val-unseen")[:3]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run without feedback, with scores on three tasks."""
    folder: Path = tmp_path_factory.mktemp("run")
    setting = {"messages": True, "feedback": False}
    train(lambda: chmarl_pb.parallel_env(split="val-unseen", max_steps=4, feedback=False), "qmix", TINY, folder,
          setting=setting)  # fmt: skip
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plan, "sample_of", lambda split, tasks: TASKS)
        score(folder / "best.pt", "scene_graph", folder, ["val-unseen"], feedback=False)
    return folder


def test_a_published_run_is_played_by_its_name(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [str(run), "tiny-graphs", "--by", "python -m training.train --algo qmix", "--folder", str(tmp_path)]
    assert main(words) == 0
    row = read_manifest(tmp_path)["tiny-graphs"]
    assert (row.observation, row.track, row.options) == ("scene_graph", "paper", {"feedback": False})
    monkeypatch.setenv("CHMARL_WEIGHTS", str(tmp_path))
    monkeypatch.setattr(plan, "sample_of", lambda split, tasks: TASKS)
    capsys.readouterr()
    out = tmp_path / "again.json"
    assert chmarl_main(["evaluate", "--policy", "tiny-graphs", "--split", "val-unseen", "--workers", "1",
                        "--out", str(out)]) == 0  # fmt: skip
    again = json.loads(out.read_text())
    figures = {name: round(again["summary"][name]["mean"], 6) for name in ("success_rate", "plw")}
    assert figures == row.published["val-unseen"] and again["settings"]["options"]["feedback"] is False
    assert "published: " in capsys.readouterr().out
    assert chmarl_main(["evaluate", "--policy", "tiny-graphs", "--split", "val-unseen", "--workers", "1",
                        "--max-steps", "3"]) == 0  # fmt: skip
    assert "published: " not in capsys.readouterr().out, "it was measured by other rules"
    with pytest.raises(OptionError, match="tiny-graphs"):
        chmarl_pb.load_policy("tiny")


@pytest.mark.parametrize(
    "when", [(0, "val-unseen"), (3, "val-unseen"), (0, "test-unseen"), (3, "test-unseen")], ids=str
)
def test_scores_are_those_of_one_checkpoint(
    when: tuple[int, str], run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    checkpoint = Path(shutil.copyfile(run / "best.pt", tmp_path / "best.pt"))
    monkeypatch.setattr(plan, "sample_of", lambda split, tasks: tasks[:3])

    def show(split: str, done: int, all: int) -> None:
        if (done, split) == when:
            train(lambda: chmarl_pb.parallel_env(split="val-unseen", max_steps=4, feedback=False), "qmix",
                  replace(TINY, seed=1), tmp_path / "other", setting={"messages": True, "feedback": False})  # fmt: skip
            (tmp_path / "other" / "best.pt").replace(checkpoint)

    monkeypatch.setattr("training.score._show", show)
    with pytest.raises(ChmarlError, match=r"best\.pt: changed while it was evaluated; copy it, or evaluate again"):
        score(checkpoint, "scene_graph", tmp_path / "out", ["val-unseen", "test-unseen"], feedback=False)
    assert not (tmp_path / "out" / "scores.json").exists()


def test_a_checkpoint_that_is_refused_leaves_no_file(run: Path, tmp_path: Path) -> None:
    with pytest.raises(ChmarlError, match="other observations"):
        score(run / "best.pt", "visual", tmp_path / "out", ["val-unseen"], feedback=False)
    with pytest.raises(ChmarlError, match=r"none\.pt: no such file"):
        score(tmp_path / "none.pt", "visual", tmp_path / "out", ["val-unseen"])
    assert list(tmp_path.rglob("*")) == [tmp_path / "out"]


def test_publishing_again_replaces_the_row(run: Path, tmp_path: Path) -> None:
    first, second = (publish(run, "tiny", by=by, folder=tmp_path) for by in ("once", "twice"))
    assert read_manifest(tmp_path) == {"tiny": second} and first.sha256 == second.sha256


def test_no_file_of_the_row_that_was_replaced_is_left(run: Path, tmp_path: Path) -> None:
    row = publish(run, "tiny", folder=tmp_path)
    (tmp_path / row.file).rename(tmp_path / "tiny.zip")  # as if it had been a model of Stable-Baselines3
    weights.write_manifest(tmp_path, {"tiny": replace(row, file="tiny.zip")})
    publish(run, "tiny", folder=tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["manifest.json", "tiny.pt"]


def test_a_file_that_is_gone_is_named(run: Path, tmp_path: Path) -> None:
    (tmp_path / publish(run, "other", folder=tmp_path).file).unlink()
    with pytest.raises(OptionError, match=r"other\.pt: the weights 'other' of the manifest beside it are not there"):
        publish(run, "tiny", folder=tmp_path)


@pytest.mark.parametrize(("name", "words"), [("search", "built-in"), ("../a", "letters"), ("", "letters")])
def test_names_that_cannot_be_are_refused(name: str, words: str, run: Path, tmp_path: Path) -> None:
    with pytest.raises(OptionError, match=words):
        publish(run, name, folder=tmp_path)


def test_what_does_not_belong_to_the_weights_is_refused(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = tmp_path / "other.json"
    content = json.loads((run / "scores.json").read_text())
    del content["crc32"]
    content["checkpoint"]["sha256"] = "0" * 64
    other.write_text(json.dumps(content))
    with pytest.raises(ResultError, match="other weights"):
        publish(run, "tiny", other, folder=tmp_path)
    with pytest.raises(ResultError, match="no such result"):
        publish(run, "tiny", tmp_path / "none.json", folder=tmp_path)
    with pytest.raises(ResultError, match=r"not the result of these weights: is not a regular file; put one there"):
        publish(run, "tiny", run, folder=tmp_path)
    with pytest.raises(OptionError, match="has 0 of"):
        publish(tmp_path, "tiny", folder=tmp_path)
    monkeypatch.setattr("training.publish.MOST_BYTES", 10)
    with pytest.raises(ChmarlError, match="more than 10"):
        publish(run, "tiny", folder=tmp_path)
    assert not (tmp_path / weights.MANIFEST).exists()
