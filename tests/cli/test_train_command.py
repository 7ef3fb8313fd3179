"""The command `python -m training.train`: its flags; and what a run writes for TensorBoard."""

from dataclasses import fields
from pathlib import Path

import pytest

pytest.importorskip("torch")
from chmarl_pb.cli.flags import descriptions
from chmarl_pb.cli.train import _SHARED, main, parse
from chmarl_pb.learning.config import CONFIGS
from chmarl_pb.learning.policies.cloned import CloningConfig
from chmarl_pb.learning.runs.logger import Logbook, read_metrics

ALGORITHMS = {"bc": CloningConfig, **CONFIGS}


@pytest.mark.parametrize(("algo", "kind"), ALGORITHMS.items())
def test_every_setting_of_a_learner_is_a_flag_with_its_default(algo: str, kind: type) -> None:
    options, settings = parse(["--algo", algo])
    assert settings == {field.name: field.default for field in fields(kind) if field.name not in _SHARED}
    assert options.image_encoder == "resnet18" and options.messages and options.feedback


@pytest.mark.parametrize("kind", list(dict.fromkeys(ALGORITHMS.values())))
def test_every_setting_is_described(kind: type) -> None:
    assert {field.name for field in fields(kind)} <= set(descriptions(kind))
    assert all(text and "\n" not in text for text in descriptions(kind).values())


def test_flags_are_typed_and_belong_to_their_learner(capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        parse(["--algo", "qmix", "--episodes", "7", "--gamma", "0.5"])[1] | {"episodes": 7, "gamma": 0.5}
        == (parse(["--gamma", "0.5", "--episodes=7", "--algo=qmix"])[1])
    )
    assert parse(["--algo", "bc", "--no-past-actions", "--epochs", "2"])[1]["past_actions"] is False
    for wrong in (["--algo", "bc", "--episodes", "3"], ["--algo", "iql", "--epochs", "3"], ["--algo", "sarsa"], []):
        with pytest.raises(SystemExit):
            parse(wrong)
    capsys.readouterr()


def test_help_lists_the_settings_of_the_learner(capsys: pytest.CaptureFixture[str]) -> None:
    for algo, flag in (("mappo", "--critic-rate"), ("bc", "--weight-decay")):
        with pytest.raises(SystemExit):
            main(["--algo", algo, "--help"])
        assert flag in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["--help"])
    assert "lists all settings" in capsys.readouterr().out


def test_events_of_tensorboard_are_the_metrics(tmp_path: Path) -> None:
    events = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    logbook = Logbook(tmp_path, total=20, quiet=True)
    logbook.write({"episodes": 10, "train": {"success": 0.25}})
    logbook.write({"episodes": 20, "train": {"success": 0.5}, "validation": {"score": 0.125}})
    logbook.close()
    board = events.EventAccumulator(str(tmp_path / "tensorboard"))
    board.Reload()
    told = {name: [(event.step, event.value) for event in board.Scalars(name)] for name in board.Tags()["scalars"]}
    assert told["train/success"] == [(10, 0.25), (20, 0.5)] and told["validation/score"] == [(20, 0.125)]
    assert [row["train"]["success"] for row in read_metrics(tmp_path)] == [0.25, 0.5]
