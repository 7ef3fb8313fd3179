"""Checkpoints and weights as files: no byte changes unseen, no code is run, and refusals are in our own words."""

import pickle
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from chmarl_pb.learning import train
from chmarl_pb.learning.networks.frozen import frozen_encoder
from chmarl_pb.learning.policies.load import load_policy
from chmarl_pb.learning.runs.run import BEST, LAST
from chmarl_pb.learning.storage.checkpoint import BEFORE, FORMAT, CheckpointError, load, save
from chmarl_pb.learning.storage.seal import LENGTH, fault, is_sealed, seal
from tests.helpers.damage import Evil, flipped
from tests.helpers.frozen_weights import random_weights
from tests.helpers.small_runs import SMALL
from tests.helpers.uneven_env import UnevenEnv

#: What must not be repeated: torch tells how to load a file in spite of what is wrong with it.
ADVICE = (
    "weights_only",
    "safe_globals",
    "Re-running",
    "arbitrary code",
    "trusted",
    "torch.load",
    "torch.serialization",
)


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("checkpoint") / "x.pt"
    stream = torch.Generator().manual_seed(0)
    save(path, "value", {"weights": torch.randn(7, 300, generator=stream), "more": {"steps": 5, "name": "x" * 50}})
    return path


def refusal(read: Callable[[], Any]) -> str:
    """Return what a reader says of a file; it must say it in one line, and in our own words."""
    with pytest.raises(CheckpointError) as caught:
        read()
    text, error = str(caught.value), caught.value
    assert "\n" not in text and not [word for word in ADVICE if word in text]
    assert error.__cause__ is None and (error.__suppress_context__ or error.__context__ is None)
    return text


def test_equal_content_is_equal_files(tmp_path: Path) -> None:
    content = {"weights": torch.arange(5.0), "steps": 3}
    save(tmp_path / "one.pt", "value", content)
    save(tmp_path / "other" / "last.pt", "value", content)
    assert (tmp_path / "one.pt").read_bytes() == (tmp_path / "other" / "last.pt").read_bytes()


def test_every_flipped_byte_is_noticed(checkpoint: Path, tmp_path: Path) -> None:
    whole, path = checkpoint.read_bytes(), tmp_path / "flipped.pt"
    rng = np.random.default_rng(0)
    places = {*range(120), *range(len(whole) - 400, len(whole)), *rng.integers(0, len(whole), 400).tolist()}
    for place in sorted(places):
        path.write_bytes(flipped(whole, place, 1 << int(rng.integers(8))))
        assert "flipped.pt: not a whole checkpoint" in refusal(lambda: load(path))
    path.write_bytes(whole)
    assert torch.equal(load(path)["weights"], load(checkpoint)["weights"])


def test_every_cut_and_every_addition_is_noticed(checkpoint: Path, tmp_path: Path) -> None:
    whole, path = checkpoint.read_bytes(), tmp_path / "cut.pt"
    unsealed = len(whole) - LENGTH
    for length in (0, 1, 2, 30, 1000, unsealed - 1, unsealed + 1, len(whole) - 1):
        path.write_bytes(whole[:length])
        refusal(lambda: load(path))
    for more in (b"x", whole):
        path.write_bytes(whole + more)
        refusal(lambda: load(path))


def test_files_without_a_sha256_are_read_and_their_parts_are_checked(checkpoint: Path, tmp_path: Path) -> None:
    """As versions before it wrote them, and as torch writes weights."""
    path = tmp_path / "old.pt"
    weights = torch.arange(3000.0)
    torch.save({"format": FORMAT, "kind": "value", "weights": weights}, path)
    assert not is_sealed(path) and torch.equal(load(path)["weights"], weights)
    whole = path.read_bytes()
    for value in (5.0, 1500.0, 2999.0):
        path.write_bytes(flipped(whole, whole.index(np.float32(value).tobytes())))
        assert "damaged" in refusal(lambda: load(path))


def test_torch_and_zipfile_read_what_has_a_sha256(checkpoint: Path) -> None:
    assert is_sealed(checkpoint) and not fault(checkpoint)
    assert torch.load(checkpoint, weights_only=True)["more"]["steps"] == 5
    with zipfile.ZipFile(checkpoint) as archive:
        assert archive.testzip() is None


@pytest.mark.parametrize("content", [b"", b"hello", b"PK", b"RRR", pickle.dumps(Evil(Path("code ran")))])
def test_files_of_other_kinds_are_refused_in_our_own_words(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "x.pt"
    path.write_bytes(content)
    for read in (lambda: load(path), lambda: frozen_encoder("resnet18", str(path))):
        assert "x.pt: not a whole checkpoint" in refusal(read)
    path.unlink()
    path.mkdir()
    assert "it is no file" in refusal(lambda: load(path))


@pytest.mark.parametrize("sealed", [False, True])
def test_code_in_a_checkpoint_is_not_run_and_not_made_easy(sealed: bool, tmp_path: Path) -> None:
    path, touched = tmp_path / "x.pt", tmp_path / "code ran"
    torch.save({"format": FORMAT, "kind": "value", "agents": Evil(touched)}, path)
    if sealed:
        seal(path)
    for read in (lambda: load(path), lambda: load_policy(path), lambda: frozen_encoder("resnet18", str(path))):
        assert "could run code and is never loaded" in refusal(read)
    assert not touched.exists()


def test_compressed_zips_are_not_unpacked(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "x.pt", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("x/data.pkl", b"0" * 10**6)
    assert "compressed" in refusal(lambda: load(tmp_path / "x.pt"))


def test_a_checkpoint_that_lacks_something_is_refused(tmp_path: Path) -> None:
    train(UnevenEnv, "vdn", SMALL, tmp_path)
    content = load(tmp_path / LAST)
    for lost in ("learner", "streams", "rows"):
        save(tmp_path / LAST, "run", {key: value for key, value in content.items() if key not in (lost, "kind")})
        with pytest.raises(CheckpointError, match=rf"last\.pt: does not hold.*'{lost}'"):
            train(UnevenEnv, "vdn", SMALL, tmp_path)
    save(tmp_path / BEST, "value", {"agents": {}})
    with pytest.raises(CheckpointError, match=r"best\.pt: does not hold.*'setting'"):
        load_policy(tmp_path / BEST)(None)


def test_weights_of_frozen_encoders_are_checked(tmp_path: Path) -> None:
    path = tmp_path / "resnet18.pt"
    torch.save(random_weights(), path)
    seal(path)
    whole, rng = path.read_bytes(), np.random.default_rng(0)
    assert frozen_encoder("resnet18", str(path)).fingerprint
    frozen_encoder.cache_clear()
    for place in (0, len(whole) - 1, len(whole) - LENGTH, *rng.integers(0, len(whole), 3).tolist()):
        path.write_bytes(flipped(whole, place))
        assert "resnet18.pt" in refusal(lambda: frozen_encoder("resnet18", str(path)))


@pytest.mark.parametrize(("old", "new"), [("minds", "actors"), ("pupil", "model")])
def test_parts_of_earlier_versions_have_their_present_names(tmp_path: Path, old: str, new: str) -> None:
    save(tmp_path / "x.pt", "pretraining", {old: {"weight": torch.ones(2)}, "done": 3})
    content = load(tmp_path / "x.pt", "pretraining")
    assert old not in content and content[new]["weight"].tolist() == [1, 1] and content["done"] == 3


@pytest.mark.parametrize(
    ("algorithm", "setting", "before"), [("imitation", "expert", "search"), ("mappo", "normalize_values", False)]
)
def test_settings_newer_than_a_file_are_what_was_done_then(
    tmp_path: Path, algorithm: str, setting: str, before: str | bool
) -> None:
    path = tmp_path / "last.pt"
    save(path, "run", {"algorithm": algorithm, "config": {"seed": 1}})
    assert load(path)["config"] == {"seed": 1} | BEFORE[algorithm] and BEFORE[algorithm][setting] == before
    save(path, "run", {"algorithm": algorithm, "config": {"seed": 1, setting: "own"}})
    assert load(path)["config"][setting] == "own"
