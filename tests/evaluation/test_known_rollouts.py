"""Rollouts are bit by bit those that were recorded, and ``chmarl-pb doctor`` says where they are not."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from chmarl_pb.cli.program import main
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import OptionError
from chmarl_pb.evaluation import golden


@pytest.mark.parametrize("name", golden.ROLLOUTS)
def test_rollouts_are_those_that_were_recorded(name: str) -> None:
    assert golden.ROLLOUTS[name]() == golden.recorded()["digests"][name], (
        "other results than in golden.json, where versions and processor are named: `chmarl-pb doctor` compares them; "
        "where the change is meant, `chmarl-pb doctor --record chmarl_pb/evaluation/golden.json` writes it anew"
    )


def test_driven_motions_are_the_same_bits_with_other_instructions_of_the_processor() -> None:
    """Linear algebra and trigonometry take other instructions on other processors, and round differently there."""
    features = "X86_V4 X86_V3 AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR AVX2 FMA3"
    old = {**os.environ, "OPENBLAS_CORETYPE": "Prescott", "NPY_DISABLE_CPU_FEATURES": features}
    code = "from chmarl_pb.evaluation import golden; print(golden.ROLLOUTS['simulated execution']())"
    found = subprocess.run([sys.executable, "-W", "ignore", "-c", code], env=old, capture_output=True, text=True)
    assert found.stdout.strip() == golden.recorded()["digests"]["simulated execution"], found.stderr


def test_a_digest_tells_every_bit() -> None:
    env = HouseholdEnv(split="val-unseen")
    observations, _ = env.reset(seed=0)
    env.close()
    before = golden.digest(observations)
    observations["drone"]["self"][-1] += 1e-6
    assert golden.digest(observations) != before
    observations["drone"]["self"][-1] -= 1e-6
    assert golden.digest(dict(reversed(observations.items()))) == golden.digest(observations)


def test_the_doctor_names_what_differs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = str(tmp_path / "digests.json")
    monkeypatch.setattr(golden, "ROLLOUTS", {"one": lambda: "1" * 64, "other": lambda: "2" * 64})
    assert main(["doctor", "--record", file]) == 1, "they are not those of the package"
    assert main(["doctor", "--against", file]) == 0
    assert "DIFFERS" not in capsys.readouterr().out.partition("on machines")[2]
    monkeypatch.setattr(golden, "ROLLOUTS", {"one": lambda: "1" * 64, "other": lambda: "3" * 64})
    data = json.loads(Path(file).read_text())
    data["versions"]["numpy"] = "1.0"
    Path(file).write_text(json.dumps(data))
    assert main(["doctor", "--against", file]) == 1
    out = capsys.readouterr().out
    assert [line.split()[-1] for line in out.splitlines() if line.startswith("DIFFERS")] == ["other"]
    assert "(the digests: 1.0)" in out and "1 of 2 rollouts differ" in out


@pytest.mark.parametrize("content", ["", "{}", '{"versions": 1, "machine": {}, "digests": {}}', None])
def test_a_file_without_digests_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str | None
) -> None:
    path = tmp_path / "digests.json"
    if content is not None:
        path.write_text(content)
    with pytest.raises(OptionError, match=r"digests\.json: no digests of rollouts"):
        golden.recorded(path)
    assert main(["doctor", "--against", str(path)]) == 2
    assert "--record" in capsys.readouterr().err
