"""The command `chmarl-pb train`: its flags; and what a run writes for TensorBoard."""

import argparse
import shlex
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("torch")
pytest.importorskip("tyro")

from chmarl_pb.cli.evaluate import add, evaluate_command
from chmarl_pb.cli.sb3 import main as main_sb3
from chmarl_pb.cli.train import COMMANDS, check_used, main, parse, run_name
from chmarl_pb.envs.options import Options
from chmarl_pb.learning.algorithms.registry import ALGORITHMS
from chmarl_pb.learning.algorithms.value import Config
from chmarl_pb.learning.policies.cloned import CloningConfig
from chmarl_pb.learning.runs.logger import METRICS, Logger, read_rows
from chmarl_pb.learning.runs.run import BEST, LAST

ALL = ("bc", *ALGORITHMS, "dagger-mappo")


@pytest.mark.parametrize("algo", ALL)
def test_every_setting_of_a_learner_is_a_flag_with_its_default(algo: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert parse(["--algo", algo]) == COMMANDS[algo]
    with pytest.raises(SystemExit) as caught:
        main(["--algo", algo, "--help"])
    assert caught.value.code == 0
    text = capsys.readouterr().out
    for field in fields(COMMANDS[algo].config):
        assert f"--{field.name.replace('_', '-')}" in text


@pytest.mark.parametrize("kind", list(dict.fromkeys(type(COMMANDS[algo].config) for algo in ALL)))
def test_every_setting_is_described(kind: type[Any]) -> None:
    texts = " ".join(base.__doc__ or "" for base in kind.__mro__)
    assert all(f" {field.name}: " in texts for field in fields(kind))


def test_flags_are_typed_and_belong_to_their_learner(capsys: pytest.CaptureFixture[str]) -> None:
    first = parse(["--algo", "qmix", "--episodes", "7", "--gamma", "0.5", "--no-messages"])
    assert first == parse(["--gamma", "0.5", "--no-messages", "--episodes=7", "--algo=qmix"])
    assert first == parse(["qmix", "--gamma", "0.5", "--episodes", "7", "--no-messages"])
    config, cloning = first.config, parse(["--algo", "bc", "--no-past-actions", "--epochs", "2"]).config
    assert isinstance(config, Config) and isinstance(cloning, CloningConfig)
    assert (config.episodes, config.gamma, run_name(first)) == (7, 0.5, "qmix-scene_graph-feedback-seed0")
    assert cloning.past_actions is False
    for wrong in (["--algo", "bc", "--episodes", "3"], ["--algo", "iql", "--epochs", "3"]):
        with pytest.raises(SystemExit) as caught:
            parse(wrong)
        assert caught.value.code == 2
    capsys.readouterr()
    for wrong in (["--algo", "sarsa"], ["--algo"], [], ["--seed", "3"]):
        with pytest.raises(ValueError, match=r"--algo .*: use one of: bc, iql, "):
            parse(wrong)


def test_folders_are_named_after_what_makes_a_row_of_the_tables() -> None:
    names = {
        ("--algo", "bc", "--centralized", "--no-feedback"): "bc-scene_graph-centralized-messages-seed0",
        ("--algo", "iql", "--observation", "visual", "--seed", "3"): "iql-visual-messages-feedback-seed3",
        ("--algo", "dagger-mappo", "--no-messages"): "dagger-mappo-scene_graph-feedback-seed0",
        ("--algo", "qmix", "--split", "generated"): "qmix-scene_graph-messages-feedback-generated-seed0",
        ("--algo", "qmix", "--robots", "humanoid"): "qmix-scene_graph-messages-feedback-humanoid-seed0",
        ("--algo", "qmix", "--observation", "visual", "--image-size", "64"): "qmix-visual-messages-feedback-64px-seed0",
        ("--algo", "iql", "--home", "my/flat.urdf"): "iql-scene_graph-messages-feedback-flat-seed0",
        (
            "--algo",
            "iql",
            "--home",
            "home_2",
            "--catalog",
            "mine.toml",
        ): "iql-scene_graph-messages-feedback-home_2-mine-seed0",
    }
    for words, name in names.items():
        assert run_name(parse(words)) == name


@pytest.mark.parametrize(
    ("words", "known"),
    [
        (["--algo", "dqn"], "--algo dqn: use one of"),
        (["--algo", "qmix", "--gamma", "5"], "gamma=5.0: must be from 0 to 1"),
        (["--algo", "iql", "--envs", "0"], "envs=0: must be at least 1"),
        (["--algo", "bc", "--batch-size", "0"], "batch_size=0: must be at least 1"),
        (["--algo", "qmix", "--threads", "0"], "threads=0: must be at least 1"),
        (["--algo", "qmix", "--device", "abacus"], "device='abacus'"),
        (["--algo", "qmix", "--mixer", "magic"], "mixer='magic' is not known"),
        (["--algo", "iql", "--mixer", "qmix"], "mixer='qmix': that makes another algorithm of iql; use qmix"),
        (
            ["--algo", "qmix", "--mixer", "torch.nn:Linear"],
            "mixer='torch.nn:Linear': makes torch.nn.modules.linear.Linear;",
        ),
        (["--algo", "vdn", "--observation", "visual", "--image-encoder", "vgg"], "image_encoder='vgg' is not known"),
        (["--algo", "mappo", "--start", "no.pt"], "no.pt: no such checkpoint"),
        (["--algo", "dagger-mappo", "--imitation.numbers-past"], "Unrecognized options: --imitation.numbers-past"),
        (["--algo", "dagger-mappo", "--start", "a.pt"], "--start: dagger-mappo begins with its own imitator"),
        (["--algo", "qmix", "--seed", "4294967296"], "seed=4294967296: must be from 0 to 4294967295"),
        (["--algo", "qmix", "--learning-rate", "inf"], "learning_rate=inf: must be at least 0, and finite"),
        (["--algo", "qmix", "--device", "meta"], "device='meta': it keeps no numbers"),
    ],
)
def test_bad_values_give_one_sentence(
    words: list[str], known: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code: str | int | None
    try:
        code = main([*words, "--out", str(tmp_path / "run")])
    except SystemExit as stop:
        code = stop.code
    shown = capsys.readouterr()
    assert code == 2 and known in " ".join(shown.err.split()) and "episodes" not in shown.err


@pytest.mark.parametrize(
    ("words", "option"),
    [
        ("iql --embedding 8", "--embedding"),
        ("vdn --standardize-state", "--standardize-state"),
        ("qmix --joint-units 7", "--joint-units"),
        ("qtran --embedding 8", "--embedding"),
        ("pqn --embedding 8", "--embedding"),
        ("imitation --reward-scale 2", "--reward-scale"),
        ("mappo --critic-starts 2", "--critic-starts"),
        ("qmix --home-rollouts 3", "--home-rollouts"),
        ("qmix --track grounded --home villa.urdf --home-rollouts 3", "--home-rollouts"),
        ("qmix --image-encoder detector", "--image-encoder"),
        ("bc --image-encoder detector", "--image-encoder"),
        ("qmix --image-size 64", "--image-size"),
        ("qmix --home villa.urdf --split generated", "--split"),
        ("dagger-mappo --imitation.reward-scale 2", "--imitation.reward-scale"),
        ("dagger-mappo --imitation.home-rollouts 5", "--imitation.home-rollouts"),
        ("qmix --observation visual --graph-pool grounded", "--graph-pool"),
        ("qmix --observation visual --image-encoder detector --graph-pool gated", "--graph-pool"),
    ],
)
def test_an_option_that_the_run_would_not_use_is_refused(words: str, option: str) -> None:
    with pytest.raises(ValueError, match=f"^{option}: .*; leave it out$"):
        check_used(parse(["--algo", *words.split()]))


def test_options_that_are_used_where_they_belong_are_taken() -> None:
    for words in (
        "qmix --embedding 8 --standardize-state", "qtran --joint-units 7", "pqn --mixer qmix --embedding 8",
        "mappo --start best.pt --critic-starts 2", "qmix --split generated --home-rollouts 3",
        "qmix --track grounded --home-rollouts 3", "qmix --observation visual --image-encoder cnn --image-size 64",
        "bc --observation visual --image-encoder detector --graph-pool grounded", "dagger-mappo --critic-starts 2",
        "qmix --observation visual --encoder mine:Encoder --graph-pool gated",
        "qmix --observation visual --encoder mine:Encoder --image-encoder detector --graph-pool gated",
        "qmix --observation visual --image-encoder detector --graph-pool parsed",
    ):  # fmt: skip
        check_used(parse(["--algo", *words.split()]))


def test_a_run_that_was_begun_with_an_idle_option_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from chmarl_pb.cli import train as command

    monkeypatch.setattr(command, "train", lambda *arguments, **options: None)
    words = ["--algo", "qmix", "--joint-units", "7", "--quiet", "--out", str(tmp_path)]
    assert main(words) == 2 and "--joint-units: qmix does not use it" in capsys.readouterr().err
    (tmp_path / LAST).touch()
    assert main(words) == 0


@pytest.mark.parametrize("option", ["--features 3", "--word-vectors", "--graph-pool parsed", "--image-size 64"])
def test_a_preset_of_few_numbers_takes_no_options_of_encoders(
    option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main_sb3(["--algo", "ppo", *option.split(), "--out", str(tmp_path)]) == 2
    assert f"{option.split()[0]}: preset 'goal' reads a few numbers" in capsys.readouterr().err


def test_feedback_is_no_option_where_nobody_reads_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--algo", "ppo", "--no-feedback", "--out", str(tmp_path)]
    for options in ([], ["--humanoid-only"]):
        assert main_sb3([*words, *options]) == 2
        assert "--feedback: preset 'goal' reads none" in capsys.readouterr().err


def test_dagger_mappo_is_two_trainings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from chmarl_pb.cli import train as command

    trained = []
    monkeypatch.setattr(command, "train", lambda env_fn, *arguments, **options: trained.append(arguments))
    words = ["--algo", "dagger-mappo", "--seed", "4", "--imitation.episodes", "5", "--episodes", "6"]
    assert main([*words, "--out", str(tmp_path)]) == 0
    (first, imitation, begun), (second, mappo, folder) = (arguments[:3] for arguments in trained)
    assert (first, imitation.seed, imitation.episodes, begun) == ("imitation", 4, 5, tmp_path / "imitation")
    assert (second, mappo.seed, mappo.episodes, folder) == ("mappo", 4, 6, tmp_path)
    assert mappo.start == str(tmp_path / "imitation" / "best.pt")


def test_dagger_mappo_goes_on_without_the_imitator_that_it_has_begun_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from chmarl_pb.cli import train as command

    trained = []
    monkeypatch.setattr(command, "train", lambda env_fn, algorithm, *arguments, **options: trained.append(algorithm))
    (tmp_path / LAST).touch()
    assert main(["--algo", "dagger-mappo", "--out", str(tmp_path)]) == 0
    assert trained == ["mappo"]


def test_a_finished_run_without_its_best_weights_is_not_announced(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--algo", "vdn", "--episodes", "1", "--envs", "1", "--features", "8", "--hidden", "8", "--max-steps", "1"]
    words += ["--home", "home_1", "--out", str(tmp_path)]
    assert main(words) == 0
    assert "Evaluate them with" in capsys.readouterr().out
    (tmp_path / BEST).unlink()
    assert main(words) != 0
    shown = capsys.readouterr()
    assert shown.out == "" and f"{BEST}: the best weights are gone" in shown.err


def test_events_of_tensorboard_are_the_metrics(tmp_path: Path) -> None:
    events = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    logger = Logger(tmp_path, total=20, quiet=True)
    logger.write({"episodes": 10, "train": {"success": 0.25}})
    logger.write({"episodes": 20, "train": {"success": 0.5}, "validation": {"score": 0.125}})
    logger.close()
    board = events.EventAccumulator(str(tmp_path / "tensorboard"))
    board.Reload()
    known = {name: [(event.step, event.value) for event in board.Scalars(name)] for name in board.Tags()["scalars"]}
    assert known["train/success"] == [(10, 0.25), (20, 0.5)] and known["validation/score"] == [(20, 0.125)]
    assert [row["train"]["success"] for row in read_rows(tmp_path / METRICS)] == [0.25, 0.5]


def test_the_time_limit_is_not_the_horizon(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["--algo", "vdn", "--horizon", "10", "--out", str(tmp_path / "run")]) == 2
    assert "--horizon 10: the time limit of episodes is 28; give --max-steps instead" in capsys.readouterr().err


def test_the_command_that_is_printed_can_be_run() -> None:
    options = Options("visual", track="grounded", goal=True)
    words = shlex.split(evaluate_command(Path("my runs/best.pt"), options, "humanoid,drone"))
    wanted = "evaluate --split generated-test --track grounded --observation visual --goal --policy"
    assert words[0] == "chmarl-pb" and set(words[1:]) == {*wanted.split(), "my runs/best.pt"}
    parser = argparse.ArgumentParser()
    add(parser)
    assert str(parser.parse_args(words[2:]).policy) == "my runs/best.pt"
