"""Weights that come with the package: found by name, checked by their hash."""

import json
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

import chmarl_pb
from chmarl_pb.assets import WEIGHTS_DIR
from chmarl_pb.cli import main
from chmarl_pb.errors import OptionError
from chmarl_pb.files import file_hash
from chmarl_pb.policies.sources import find_policy, register_loader
from chmarl_pb.policies.weights import (
    ENCODER,
    MANIFEST,
    MOST_BYTES,
    POLICY,
    Weights,
    checked_file,
    published,
    published_names,
    read_manifest,
    write_manifest,
)

ROOT = Path(__file__).parents[2]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of weights with one policy, which acts at random whatever its file holds."""
    (tmp_path / "ours.weights").write_bytes(b"numbers")
    options = {"feedback": False, "goal": True}
    row = Weights(
        "ours", "ours.weights", file_hash(tmp_path / "ours.weights"), POLICY, "python -m training.ours", "visual",
        options=options, published={"val-unseen": {"success_rate": 0.5, "plw": 0.25}},
    )  # fmt: skip
    write_manifest(tmp_path, {"ours": row})
    monkeypatch.setenv("CHMARL_WEIGHTS", str(tmp_path))
    monkeypatch.setattr("chmarl_pb.policies.sources._LOADERS", {})
    register_loader(".weights", lambda path: lambda env: chmarl_pb.make_policy("random", env))
    return tmp_path


def test_what_comes_with_the_package_is_what_the_manifest_says() -> None:
    rows = read_manifest(WEIGHTS_DIR)
    files = {path.name for path in WEIGHTS_DIR.iterdir()} - {MANIFEST}
    assert files == {row.file for row in rows.values()} and "detector" in rows
    assert sum((WEIGHTS_DIR / name).stat().st_size for name in files) <= MOST_BYTES
    for row in rows.values():
        assert file_hash(WEIGHTS_DIR / row.file) == row.sha256
        assert (ROOT / row.result).is_file() and row.trained_by.startswith(("python -m ", "chmarl-pb "))


@pytest.mark.parametrize("name", [row.name for row in read_manifest(WEIGHTS_DIR).values() if row.kind == POLICY])
def test_every_policy_that_comes_with_the_package_acts(name: str) -> None:
    source = chmarl_pb.load_policy(name)
    options = {**source.options, "split": "val-unseen"}
    with closing(chmarl_pb.parallel_env(options.pop("observation"), **options)) as env:
        observations, infos = env.reset(seed=0)
        policy = source.make(env)
        policy.reset(0)
        actions = policy.act(observations, infos)
        assert all(env.action_space(robot).contains(actions[robot]) for robot in actions) and actions


def test_a_name_is_a_policy_with_its_rules(folder: Path) -> None:
    source = chmarl_pb.load_policy("ours")
    assert source.name == "ours" and source.sha256 == file_hash(folder / "ours.weights")
    assert source.options == {"observation": "visual", "track": "paper", "feedback": False, "goal": True}
    assert find_policy(source) is source and published_names() == ["ours"]
    report = chmarl_pb.evaluate("ours", "val-unseen", tasks=["val-unseen-000"], workers=1, seeds=[0])
    assert report.settings["observation"] == "visual" and report.settings["policy"] == "ours"
    assert report.settings["options"]["goal"] is True and report.settings["options"]["feedback"] is False
    same = chmarl_pb.evaluate(source, "val-unseen", tasks=["val-unseen-000"], workers=1, seeds=[0], image_size=64)
    assert same.settings["policy"] == "ours" and same.settings["options"]["image_size"] == 64


@pytest.mark.parametrize("name", ["search", "planner"])
def test_built_in_policies_are_loaded_too(name: str, env: chmarl_pb.HouseholdEnv) -> None:
    assert type(chmarl_pb.load_policy(name)(env)) is type(chmarl_pb.make_policy(name, env))


def test_a_changed_file_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "ours.weights").write_bytes(b"other numbers")
    assert main(["evaluate", "--policy", "ours", "--task", "val-unseen-000", "--split", "val-unseen"]) == 2
    said = capsys.readouterr()
    (line,) = said.err.splitlines()
    assert said.out == "" and "not the published weights 'ours'" in line and str(folder / "ours.weights") in line


def test_a_missing_file_is_told(folder: Path) -> None:
    (folder / "ours.weights").unlink()
    with pytest.raises(OptionError, match=r"ours\.weights: the weights 'ours' are not there"):
        chmarl_pb.load_policy("ours")


def test_a_wrong_name_lists_the_names(folder: Path) -> None:
    with pytest.raises(OptionError, match=r"unknown policy 'our'; use one of: random, .*, planner, ours, module"):
        chmarl_pb.load_policy("our")


@pytest.mark.parametrize("content", ["{", "[1]", '[{"name": "a"}]', "[" * 100_000])
def test_a_damaged_manifest_is_told(content: str, folder: Path) -> None:
    (folder / MANIFEST).write_text(content)
    with pytest.raises(OptionError, match=r"manifest\.json: not a manifest of weights .*CHMARL_WEIGHTS"):
        chmarl_pb.load_policy("ours")


@pytest.mark.parametrize(
    ("field", "value"),
    [("sha256", 5), ("file", 5), ("options", [1]), ("published", [1]), ("published", {"val-unseen": {"plw": "x"}}),
     ("observation", None), ("name", [5])],
)  # fmt: skip
def test_fields_of_other_kinds_are_refused(field: str, value: Any, folder: Path) -> None:
    rows = json.loads((folder / MANIFEST).read_text())
    (folder / MANIFEST).write_text(json.dumps([rows[0] | {field: value}]))
    with pytest.raises(OptionError, match=r"manifest\.json: not a manifest of weights .*CHMARL_WEIGHTS"):
        chmarl_pb.load_policy("ours")


@pytest.mark.parametrize(("field", "value", "words"), [
    ("options", {"goal": True, "foo": 1}, "'foo', an option that this version does not know"),
    ("track", "moon", "the track 'moon'; known are paper"),
])  # fmt: skip
def test_rules_of_another_version_are_refused(field: str, value: Any, words: str, folder: Path) -> None:
    rows = json.loads((folder / MANIFEST).read_text())
    (folder / MANIFEST).write_text(json.dumps([rows[0] | {field: value}]))
    with pytest.raises(OptionError, match=words):
        chmarl_pb.evaluate("ours", "val-unseen", tasks=["val-unseen-000"], workers=1, seeds=[0])


def test_files_outside_the_folder_are_refused(folder: Path) -> None:
    rows = json.loads((folder / MANIFEST).read_text())
    rows[0]["file"] = "../ours.weights"
    (folder / MANIFEST).write_text(json.dumps(rows))
    with pytest.raises(OptionError, match="kind, file or another field of ours"):
        chmarl_pb.load_policy("ours")


# Encoders


def test_the_published_resnet_is_the_one_that_the_rows_on_pictures_see_by(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("torch")
    from chmarl_pb.learning.networks.frozen import frozen_encoder, weights_file

    monkeypatch.setenv("CHMARL_CACHE", str(tmp_path / "chmarl_pb"))
    monkeypatch.delenv("CHMARL_RESNET18", raising=False)
    row = published("resnet18", ENCODER)
    assert row is not None and weights_file("resnet18") == checked_file(row)
    fingerprint = frozen_encoder("resnet18", str(checked_file(row))).fingerprint
    assert fingerprint == json.loads((ROOT / row.result).read_text())["fingerprint"]
    seen = json.loads((ROOT / "results" / "visual" / "qmix-messages-seed0.json").read_text())
    assert fingerprint == seen["checkpoint"]["frozen"]


def test_the_published_detector_is_the_default(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("torch")
    from chmarl_pb.learning.networks.frozen import frozen_encoder, trained_with, weights_file
    from chmarl_pb.learning.storage.checkpoint import CheckpointError

    monkeypatch.setenv("CHMARL_CACHE", str(tmp_path / "chmarl_pb"))
    monkeypatch.delenv("CHMARL_DETECTOR", raising=False)
    row = published("detector", ENCODER)
    assert row is not None
    assert weights_file("detector") == checked_file(row)
    facts = json.loads((ROOT / row.result).read_text())
    published_detector = frozen_encoder("detector", str(checked_file(row)))
    assert published_detector.fingerprint == facts["fingerprint"]
    own = tmp_path / "chmarl_pb" / "detector.pt"
    own.parent.mkdir()
    own.write_bytes(b"mine")
    assert weights_file("detector") == own
    monkeypatch.setenv("CHMARL_DETECTOR", str(tmp_path / "chosen.pt"))
    assert weights_file("detector") == tmp_path / "chosen.pt"
    monkeypatch.setenv("CHMARL_DETECTOR", str(checked_file(row)))
    frozen_encoder.cache_clear()
    assert trained_with("detector", facts["fingerprint"], Path("best.pt")).fingerprint == facts["fingerprint"]
    with pytest.raises(CheckpointError, match="other weights of detector"):
        trained_with("detector", "other", Path("best.pt"))
    frozen_encoder.cache_clear()


def test_a_published_encoder_that_was_changed_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And not the policy that sees by it, whose file is whole."""
    pytest.importorskip("torch")
    from chmarl_pb.learning.networks.frozen import frozen_encoder
    from chmarl_pb.learning.storage.checkpoint import CheckpointError

    rows = read_manifest(WEIGHTS_DIR)
    for name in ("ours-pictures", "detector"):
        (tmp_path / rows[name].file).write_bytes((WEIGHTS_DIR / rows[name].file).read_bytes())
    with (tmp_path / "detector.pt").open("r+b") as file:
        file.seek(5000)
        file.write(b"changed")
    write_manifest(tmp_path, {name: rows[name] for name in ("ours-pictures", "detector")})
    monkeypatch.setenv("CHMARL_WEIGHTS", str(tmp_path))
    monkeypatch.setenv("CHMARL_CACHE", str(tmp_path / "chmarl_pb"))
    monkeypatch.delenv("CHMARL_DETECTOR", raising=False)
    frozen_encoder.cache_clear()
    with closing(chmarl_pb.parallel_env("visual")) as env:
        with pytest.raises(CheckpointError, match=r"detector\.pt: not the published.*the copy by CHMARL_DETECTOR$"):
            chmarl_pb.load_policy("ours-pictures").make(env)
    frozen_encoder.cache_clear()
