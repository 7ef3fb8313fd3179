"""What tells the user's own objects apart."""

import functools
import importlib
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


@dataclass(frozen=True)
class Quiet:
    name: str
    rate: float = field(repr=False)


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


OWN = """
import functools
from dataclasses import dataclass, field
from wrapping import logged

class Own:
    rate = {rate}

def make(env): return Own()

@logged
def decorated(env): return Own()

@functools.lru_cache
def cached(env): return Own()

@dataclass(frozen=True)
class Quiet:
    rate: float = field(default={rate}, repr=False)

quiet = {{Quiet()}}
"""
LOGGED = """
import functools

def logged(call):
    @functools.wraps(call)
    def wrapped(*given): return call(*given)
    return wrapped
"""


def test_other_files_make_other_objects(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # files of one second have one date
    (tmp_path / "wrapping.py").write_text(LOGGED)
    importlib.import_module("wrapping")
    seen = []
    for rate in (0.25, 0.5, 0.25):
        (tmp_path / "own.py").write_text(OWN.format(rate=rate))
        monkeypatch.delitem(sys.modules, "own", raising=False)
        importlib.invalidate_caches()
        own = importlib.import_module("own")
        given = own.Own, own.Own(), own.make, own.decorated, own.cached, own.quiet
        seen.append([fingerprint(one) for one in given])
    first, other, again = seen
    assert first == again and None not in first and len(set(first + other)) == 2 * len(first)
    (tmp_path / "wrapping.py").write_text(LOGGED + "# changed")
    assert fingerprint(own.decorated) != again[3] and fingerprint(own.cached) != again[4], "its module imports that one"


@pytest.mark.parametrize("line", ["import helping.rates", "from helping import rates", "from helping.rates import *"])
def test_what_modules_of_the_user_import_counts(line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("playing", "helping", "helping.rates", "helping.deeper"):
        sys.modules.pop(name, None)  # of the test before
    (tmp_path / "helping").mkdir()
    (tmp_path / "helping" / "__init__.py").write_text("")
    (tmp_path / "helping" / "deeper.py").write_text("RATE = 0.25\n")
    (tmp_path / "helping" / "rates.py").write_text("from .deeper import RATE\n")
    late = f"\n    def act(self):\n        {line}\n" if "import rates" in line else ""
    (tmp_path / "playing.py").write_text(f"import json, torch\n{'' if late else line}\n\nclass Own:\n    pass\n{late}")
    importlib.invalidate_caches()
    playing = importlib.import_module("playing")
    before = [fingerprint(one) for one in (playing.Own, playing.Own())]
    importlib.import_module("helping.rates")
    assert None not in before and before == [fingerprint(one) for one in (playing.Own, playing.Own())]
    for number, changed in enumerate(("rates.py", "deeper.py")):
        with (tmp_path / "helping" / changed).open("a") as file:
            file.write(f"# {number}\n")
        after = [fingerprint(one) for one in (playing.Own, playing.Own())]
        assert not set(before) & set(after)
        before = after


def test_a_policy_that_is_run_as_a_module_imports_from_its_package(tmp_path: Path) -> None:
    (tmp_path / "package").mkdir()
    (tmp_path / "package" / "__init__.py").write_text("")
    (tmp_path / "package" / "play.py").write_text(
        "from .rates import RATE\nfrom chmarl_pb.fingerprint import fingerprint\n\n"
        "class Own:\n    rate = RATE\n\nprint(fingerprint(Own))\n"
    )
    seen = set()
    for number in range(2):
        (tmp_path / "package" / "rates.py").write_text(f"RATE = 1  # {number}\n")
        command = [sys.executable, "-m", "package.play"]
        seen.add(subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stdout)
    assert len(seen) == 2 and "None\n" not in seen


def test_elements_of_sets_are_told_apart() -> None:
    one, same, other = ({Quiet("x", rate), Quiet("y", 0)} for rate in (0.25, 0.25, 0.5))
    assert fingerprint(one) == fingerprint(same) != fingerprint(other)


def test_shared_parts_are_read_in_bounded_time() -> None:
    """A grid of 20 x 20 nodes has more ways through it than could ever be read."""
    seen = set()
    for rate in (0.25, 0.25, 0.5):
        nodes: list[list[Holder]] = []
        for row in range(20):
            nodes.append([])
            for column in range(20):
                before = [*nodes[row - 1][column : column + 1]] if row else [rate]
                nodes[row].append(Holder({"up": before, "left": nodes[row][-1:]}))
        seen.add(fingerprint(nodes[-1][-1]))
    assert len(seen) == 2 and None not in seen


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
