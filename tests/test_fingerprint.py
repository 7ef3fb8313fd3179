"""What tells the user's own objects apart."""

import functools
import subprocess
import sys
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chmarl_pb.fingerprint import fingerprint
from chmarl_pb.tasks.messages import Board


class Lossy(Board):
    def __init__(self, rate: float):
        self.rate = rate


@dataclass
class Holder:
    parts: dict[str, Any] = field(default_factory=dict)


def maker(rate: float, scale: float = 1.0) -> Any:
    return lambda env: (env, rate, scale)


def local(rate: float) -> Any:
    class Local:
        def act(self) -> float:
            return rate

    return Local()


def cyclic(rate: float) -> Holder:
    made = Holder({"rate": rate})
    made.parts["self"] = made
    return made


def tensors(value: float) -> Holder:
    torch = pytest.importorskip("torch")
    layer = torch.nn.Linear(2, 3)
    with torch.no_grad():
        layer.weight.fill_(value)
        layer.bias.fill_(0)
    return Holder({"layer": layer, "scalar": torch.tensor(value), "half": torch.ones(2, dtype=torch.bfloat16)})


MAKES: dict[str, Any] = {
    "object": Lossy, "closure": maker, "local class": local, "cycle": cyclic, "tensors": tensors,
    "partial": lambda rate: functools.partial(maker, rate), "array": lambda rate: Holder({"array": np.array([rate])}),
    "set": lambda rate: Holder({"names": {"a", "b", str(rate)}}), "method": lambda rate: Lossy(rate).begin,
    "several": lambda rate: [Lossy(0.0), Lossy(rate)],
}  # fmt: skip


@pytest.mark.parametrize("make", MAKES.values(), ids=MAKES)
def test_equal_objects_are_alike_and_others_are_not(make: Any) -> None:
    one, same, other = fingerprint(make(0.25)), fingerprint(make(0.25)), fingerprint(make(0.5))
    assert one is not None and one == same and one != other


def test_a_class_of_a_module_is_its_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    seen = set()
    for number in range(2):
        (tmp_path / f"own_{number}.py").write_text(f"class Own:\n    rate = {number}\n\ndef make(env): return Own()\n")
        module = __import__(f"own_{number}")
        seen |= {fingerprint(module.Own), fingerprint(module.Own())}
        assert fingerprint(module.make) == fingerprint(module.Own)
    assert len(seen) == 4 and None not in seen


def test_what_nothing_tells_apart() -> None:
    assert fingerprint(Holder({"lock": threading.Lock()})) is None
    assert fingerprint(Holder({"generator": (number for number in range(3))})) is None
    code = "from chmarl_pb.fingerprint import fingerprint\nclass Own: pass\nprint(fingerprint(Own), fingerprint(Own()))"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said.split() == ["None", "None"]  # as in a notebook: the class has no file


def test_it_is_the_same_in_another_process() -> None:
    script = "from tests.test_fingerprint import MAKES; from chmarl_pb.fingerprint import fingerprint\n"
    script += "print(*[fingerprint(make(0.25)) for make in MAKES.values()])"
    said = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    assert said.split() == [fingerprint(make(0.25)) for make in MAKES.values()]
