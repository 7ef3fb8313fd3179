"""Pretraining of ResNet-18: labels, figures, and the same weights after an interruption."""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from rich.progress import Progress

from chmarl_pb import catalog
from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.errors import ChmarlError
from chmarl_pb.homes.lookalikes import colours_of
from chmarl_pb.learning.algorithms.gradient import DivergedError
from chmarl_pb.learning.networks import (
    classifier,
    pyramid,
    residual,
)
from chmarl_pb.learning.networks.detection_metrics import average_precision
from chmarl_pb.learning.networks.detections import LABELS, THINGS
from chmarl_pb.learning.networks.frozen import frozen_encoder
from chmarl_pb.learning.networks.int8 import RANGES
from chmarl_pb.learning.networks.labelled_views import (
    GRID,
    Job,
    Views,
    _chosen_tasks,
    labels_of,
    layout_views,
    read_views,
)
from chmarl_pb.learning.networks.view_parts import batch_of
from chmarl_pb.learning.storage.checkpoint import CheckpointError
from chmarl_pb.learning.storage.seal import is_sealed
from chmarl_pb.tasks.generated_homes import numbered_homes
from tests.helpers.damage import flipped
from tests.helpers.stopping import in_pieces
from training import pretrain as command
from training.pretrain import NETWORKS, pretrain

COUNT = 16


def test_labels_say_what_is_where() -> None:
    segmentation = np.full((128, 128), len(LABELS))
    segmentation[:2, 126:] = 5  # four pixels, in the corner at the top right
    segmentation[64, 64:67] = 7  # three pixels: not visible
    cells, present, centres = labels_of(segmentation)
    assert np.flatnonzero(present).tolist() == [5]
    assert np.argwhere(cells).tolist() == [[5, 0, GRID - 1]]
    np.testing.assert_allclose(centres[5], (1, -1), atol=0.02)


def test_average_precision_is_that_of_the_order() -> None:
    present = np.array([True, False, True, False])
    assert average_precision(np.array([4.0, 3.0, 2.0, 1.0]), present) == pytest.approx((1 + 2 / 3) / 2)
    assert average_precision(np.array([4.0, 1.0, 3.0, 2.0]), present) == 1


def test_average_precision_of_equal_scores_does_not_depend_on_the_order_of_views() -> None:
    scores = np.array([0.0, 2.0, 0.0, 0.0, 2.0])
    for present in ([True, True, False, False, False], [False, False, False, True, True]):
        assert average_precision(scores, np.array(present)) == pytest.approx((1 / 2 + 2 / 5) / 2)


@pytest.mark.parametrize("split", ["generated", "val-unseen"])
def test_views_among_lookalikes_know_their_colours(split: str) -> None:
    views = layout_views(Job(split, 3, 3, lookalikes=True))
    graspable = views.labels < len(BENCHMARK.graspables)
    assert graspable.any() and views.colours[graspable].all() and not views.colours[~graspable].any()
    for name in LABELS[: len(BENCHMARK.graspables)]:
        seen = set(views.colours[views.labels == LABELS.index(name)].tolist())
        assert seen <= {catalog.COLOUR_IDS[colour] for colour in colours_of(BENCHMARK.graspables[name])}


def test_views_show_the_other_robot_and_never_their_own_body() -> None:
    seen = [layout_views(Job("train", task, task)).present[:, THINGS:].reshape(-1, 2, 2) for task in range(6)]
    assert LABELS[THINGS:] == ("humanoid", "drone")
    assert np.concatenate(seen).any(axis=0).tolist() == [[False, True], [True, False]]  # by each, of each


def test_views_of_the_endless_split_are_in_ever_new_homes() -> None:
    assert _chosen_tasks("generated", 3, 0) == [0, 1, 2]
    homes = {next(numbered_homes(task // 2)) for seed in (0, 1) for task in _chosen_tasks("generated", 4, seed)}
    assert len(homes) == 4


class Stopped(Exception):
    """A training was interrupted."""


class Bar(Progress):
    """Stops at a batch."""

    def __init__(self, stop: int):
        super().__init__(disable=True)
        self.left = stop

    def update(self, *_: Any, **__: Any) -> None:
        self.left -= 1
        if self.left == 0:
            raise Stopped


@pytest.fixture
def views(monkeypatch: pytest.MonkeyPatch) -> Views:
    """Noise, for a narrow network and small batches."""
    monkeypatch.setattr(residual, "WIDTH", 8)
    monkeypatch.setattr(classifier, "FEATURES", 64)
    monkeypatch.setattr(pyramid, "WIDTHS", (8,) * 5)
    for network in NETWORKS.values():
        monkeypatch.setattr(network, "batch", COUNT // 2)
    rng = np.random.default_rng(0)
    return Views(
        rng.integers(0, 256, (COUNT, 128, 128, 3), dtype=np.uint8),
        rng.integers(0, len(LABELS) + 1, (COUNT, 128, 128), dtype=np.uint8),
        rng.random((COUNT, len(LABELS), GRID, GRID)) < 0.2,
        rng.random((COUNT, len(LABELS))) < 0.8,
        rng.random((COUNT, len(LABELS), 2)).astype(np.float16),
        rng.integers(0, 12, (COUNT, 128, 128), dtype=np.uint8),
    )


def test_batches_hold_whole_views_or_parts_that_show_objects(views: Views) -> None:
    rows = np.arange(len(views))
    pictures = views.images.reshape(len(views), -1).astype(int).sum(axis=1)
    whole = batch_of(views, rows, np.random.default_rng(0), whole=True)
    assert (whole[0].reshape(len(rows), -1).astype(int).sum(axis=1) == pictures).all()
    assert 0 < (whole[0] == views.images).all(axis=(1, 2, 3)).sum() < len(rows)  # some are mirrored
    views.labels[:] = len(LABELS)
    views.present[:] = False
    views.labels[:, 3:5, 120:122], views.present[:, 5] = 5, True
    kinds = set()
    for seed in range(8):
        images, labels, colours = batch_of(views, rows, np.random.default_rng(seed), whole=False)
        assert images.shape[1:3] == labels.shape[1:] == colours.shape[1:] == (64, 64)
        shown = (labels == 5).sum(axis=(1, 2))
        kinds.add(bool((shown == 1).all()))  # every second row and column of what is 2 x 2
        assert shown.all()
    assert kinds == {True, False}


@pytest.mark.parametrize("name", NETWORKS)
@pytest.mark.parametrize("stop", [2, 5])  # in the first epoch, with small pictures; in the last, with whole ones
def test_pretraining_goes_on_after_an_interruption(tmp_path: Path, views: Views, stop: int, name: str) -> None:
    whole = pretrain(name, tmp_path / "whole.pt", views, {"home_6": views}, 3, 0, Bar(99))
    with pytest.raises(Stopped):
        pretrain(name, tmp_path / "cut.pt", views, {"home_6": views}, 3, 0, Bar(stop))
    assert not (tmp_path / "cut.pt").exists()
    assert pretrain(name, tmp_path / "cut.pt", views, {"home_6": views}, 3, 0, Bar(99)) == whole
    assert sorted(os.listdir(tmp_path)) == ["cut.pt", "whole.pt"]
    assert frozen_encoder(name, str(tmp_path / "cut.pt")).fingerprint == whole["fingerprint"]
    assert (torch.load(tmp_path / "cut.pt", weights_only=True)[RANGES] > 0).all()
    assert 0 < whole["home_6"]["mean_average_precision"] <= 1
    assert is_sealed(tmp_path / "cut.pt")


def test_pretraining_that_is_asked_to_end_goes_on_from_its_last_batch(
    tmp_path: Path, views: Views, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = pretrain("resnet18", tmp_path / "whole.pt", views, {"home_6": views}, 3, 0, Bar(99))
    again, times = in_pieces(
        lambda: pretrain("resnet18", tmp_path / "cut.pt", views, {"home_6": views}, 3, 0, Bar(99)), 2, monkeypatch
    )
    assert times == 3 and again == whole and sorted(os.listdir(tmp_path)) == ["cut.pt", "whole.pt"]


def test_weights_that_are_no_numbers_are_not_kept(
    tmp_path: Path, views: Views, monkeypatch: pytest.MonkeyPatch
) -> None:
    network = NETWORKS["resnet18"]
    monkeypatch.setattr(network, "loss", lambda self, *_: sum(w.sum() for w in self.parameters()) * float("nan"))
    with pytest.raises(DivergedError):
        pretrain("resnet18", tmp_path / "own.pt", views, {}, 3, 0, Bar(99))
    assert not os.listdir(tmp_path)


def test_an_unfinished_training_of_other_settings_is_not_lost(tmp_path: Path, views: Views) -> None:
    with pytest.raises(Stopped):
        pretrain("resnet18", tmp_path / "cut.pt", views, {}, 3, 0, Bar(5))
    kept = (tmp_path / "cut.unfinished").read_bytes()
    with pytest.raises(CheckpointError, match="seed=0, not 1"):
        pretrain("resnet18", tmp_path / "cut.pt", views, {}, 3, 1, Bar(99))
    assert (tmp_path / "cut.unfinished").read_bytes() == kept


def test_counting_colours_anew_leaves_an_unfinished_training_alone(tmp_path: Path, views: Views) -> None:
    pretrain("detector", tmp_path / "first.pt", views, {}, 3, 0, Bar(99))
    with pytest.raises(Stopped):
        pretrain("detector", tmp_path / "cut.pt", views, {}, 3, 0, Bar(5))
    kept = (tmp_path / "cut.unfinished").read_bytes()
    pretrain("detector", tmp_path / "cut.pt", views, {}, 3, 0, Bar(99), start=tmp_path / "first.pt")
    assert (tmp_path / "cut.unfinished").read_bytes() == kept


def test_measuring_trained_weights_gives_the_figures_of_their_training(
    tmp_path: Path, views: Views, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command, "_checked", lambda *_: {"home_6": views})
    trained = pretrain("detector", tmp_path / "detector.pt", views, {"home_6": views}, 3, 0, Bar(99))
    figures = tmp_path / "figures.json"
    words = ["--network", "detector", "--measure", "--out", str(tmp_path / "detector.pt"), "--figures", str(figures)]
    assert command.main(words) == 0
    found, name = json.loads(figures.read_text()), "mean_average_precision"
    assert found["fingerprint"] == trained["fingerprint"] and found["home_6"][name] == trained["home_6"][name]
    with pytest.raises(SystemExit):
        command.main([*words, "--epochs", "3"])
    assert "--epochs: nothing is trained" in capsys.readouterr().err


@pytest.mark.parametrize("option", ["--figures", "--views", "--seed", "--workers"])
def test_options_that_an_onnx_file_does_not_need_are_refused(option: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        command.main(["--network", "detector", "--onnx", "detector.onnx", option, "7"])
    assert f"{option}: no views are drawn for --onnx; leave it out" in capsys.readouterr().err


def test_a_bad_start_is_refused_before_views_are_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    drawn: list[Any] = []
    monkeypatch.setattr(command, "_drawn", lambda *given: drawn.append(given))
    bad = tmp_path / "bad.pt"
    bad.write_bytes(b"nothing")
    out = tmp_path / "out.pt"
    assert command.main(["--network", "detector", "--start", str(bad), "--out", str(out)]) == 2
    assert "bad.pt" in capsys.readouterr().err and not drawn and not out.exists()


def test_damaged_views_are_named(tmp_path: Path, views: Views) -> None:
    path = tmp_path / "views.npz"
    np.savez(path, **vars(views))
    assert np.array_equal(read_views([path]).labels, views.labels)
    whole = path.read_bytes()
    for place in (len(whole) // 3, len(whole) // 2, len(whole) - 30):
        path.write_bytes(flipped(whole, place))
        with pytest.raises(ChmarlError, match=r"views\.npz: .*remove it"):
            read_views([path])
