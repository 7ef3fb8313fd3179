"""Machine code is stored where that can be done, trusted only if it is whole, and made anew after any change."""

import hashlib
import json
import os
import subprocess
import sys
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chmarl_pb import compiled as compiled_module
from chmarl_pb.compiled import COMPILES, compiled
from chmarl_pb.homes.home import load_home
from chmarl_pb.navigation.free_space import space_of
from chmarl_pb.rendering.camera import camera_of, lens, view_matrix
from chmarl_pb.rendering.home_model import HomeModel
from chmarl_pb.robots.file import find_model
from chmarl_pb.world import World

needs_numba = pytest.mark.skipif(not COMPILES, reason="NUMBA_DISABLE_JIT is set")

SOURCE = """
from typing import NamedTuple
import numpy as np
from chmarl_pb.compiled import compiled
FACTOR = {factor}
class Pair(NamedTuple):
    {fields}: int
    {last}: int
@compiled
def inner(x):
    return x * FACTOR + {shift}
@compiled
def outer(x, pair):
    return inner(x) + pair.first
"""
USUAL = {"factor": "np.float64(2)", "shift": "1", "fields": "first", "last": "second"}


@pytest.fixture
def folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """The folders for machine code: one, which a test may change."""
    found = [tmp_path / "kernels"]
    monkeypatch.setattr(compiled_module, "_folders", lambda to_write=False: iter(found))
    compiled_module._warn.cache_clear()
    return found


def module(**changes: str) -> dict[str, Any]:
    """A module with two compiled functions, as a process has it that has just begun."""
    names: dict[str, Any] = {"__name__": "some_kernels"}
    exec(SOURCE.format(**{**USUAL, **changes}), names)
    return names


def answer(names: dict[str, Any]) -> float:
    return float(names["outer"](10.0, names["Pair"](100, 7)))


def loaded(names: dict[str, Any]) -> int:
    """How often ``outer`` was read from disk."""
    return sum(names["outer"].stats.cache_hits.values())


@needs_numba
def test_machine_code_is_read_by_the_next_process(folders: list[Path]) -> None:
    first, second = module(), module()
    assert (answer(first), loaded(first)) == (121, 0)
    assert len(list(folders[0].iterdir())) == 2
    assert (answer(second), loaded(second)) == (121, 1)


SIDE_BY_SIDE = """
import sys, time
from pathlib import Path
from numba.core import event
from chmarl_pb import compiled as module
class Listener(event.Listener):
    def on_start(self, event):
        print(event.data["dispatcher"].py_func.__name__)
        time.sleep(1.0)  # long enough for the other process to come to it
    def on_end(self, event):
        pass
event.register("numba:compile", Listener())
module._folders = lambda to_write=False: iter([Path(sys.argv[1])])
sys.path.insert(0, sys.argv[2])
import some_kernels
assert some_kernels.outer(10.0, some_kernels.Pair(100, 7)) == 121
"""


@needs_numba
def test_of_two_processes_one_compiles_and_the_other_waits(tmp_path: Path) -> None:
    (tmp_path / "some_kernels.py").write_text(SOURCE.format(**USUAL))
    command = [sys.executable, "-c", SIDE_BY_SIDE, str(tmp_path / "kernels"), str(tmp_path)]
    started = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    said = "".join(process.communicate(timeout=120)[0] for process in started)
    assert [process.returncode for process in started] == [0, 0]
    own = [name for name in said.split() if name in ("inner", "outer")]
    assert sorted(own) == ["inner", "outer"], "compiled twice"
    assert sorted(path.suffix for path in (tmp_path / "kernels").iterdir()) == [".kernel", ".kernel"], "locks are left"


@needs_numba
def test_nobody_waits_for_ever_for_a_process_that_was_interrupted(
    folders: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compiled_module, "_PATIENCE", 0.1)
    first = module()["outer"]._cache
    monkeypatch.setattr(type(first), "_file_name", lambda *_: "some.kernel")
    lock = compiled_module._lock("some.kernel")
    assert lock is not None and compiled_module._lock("some.kernel") is None
    assert answer(module()) == 121
    lock.close()


CHANGES = {
    "a constant": ({"factor": "np.float64(3)"}, 131),
    "the type of a constant": ({"factor": "np.float32(2)"}, 121),
    "a called function": ({"shift": "5"}, 125),
    "the fields of a tuple": ({"fields": "second", "last": "first"}, 28),
}


@needs_numba
@pytest.mark.parametrize(("changes", "expected"), CHANGES.values(), ids=CHANGES)
def test_a_change_is_compiled_by_itself(folders: list[Path], changes: dict[str, str], expected: float) -> None:
    assert answer(module()) == 121
    names = module(**changes)
    assert (answer(names), loaded(names)) == (expected, 0)
    again = module()
    assert (answer(again), loaded(again)) == (121, 1)


def _flip(share: float, content: bytes) -> bytes:
    changed = bytearray(content)
    changed[int(share * len(content))] ^= 1
    return bytes(changed)


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda content: b"",
    "shortened": lambda content: content[: len(content) // 2],
    "garbage": lambda content: bytes(reversed(content)),
    "zeros": lambda content: bytes(len(content)),
    "longer": lambda content: content + b"x",
    **{f"a bit at {share}": partial(_flip, share) for share in (0.0, 0.01, 0.5, 0.99)},
    "well summed nonsense": lambda content: hashlib.sha256(b"nonsense").digest() + b"nonsense",
}


@needs_numba
@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_damaged_machine_code_is_made_anew(folders: list[Path], damage: Callable[[bytes], bytes]) -> None:
    assert answer(module()) == 121
    for path in folders[0].iterdir():
        path.write_bytes(damage(path.read_bytes()))
    for hits in (0, 1):
        names = module()
        assert (answer(names), loaded(names)) == (121, hits)


@needs_numba
def test_folders_that_cannot_be_written_are_passed_over(folders: list[Path], tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    folders.insert(0, tmp_path / "file" / "kernels")
    assert answer(module()) == 121
    names = module()
    assert (answer(names), loaded(names)) == (121, 1)
    assert list(folders[1].iterdir())


@needs_numba
def test_no_folder_at_all_is_one_warning(folders: list[Path], tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    folders[:] = [tmp_path / "file" / "kernels"]
    with pytest.warns(RuntimeWarning, match="set NUMBA_CACHE_DIR") as caught:
        assert answer(module()) == 121
        assert answer(module()) == 121
    assert len(caught) == 1


@needs_numba
def test_a_folder_keeps_only_the_newest_files_of_a_function(folders: list[Path]) -> None:
    for number in range(compiled_module._KEPT + 3):
        path = folders[0] / f"some_kernels.outer-{number:032x}.kernel"
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(b"old")
        os.utime(path, (number, number))
    names = module()
    answer(names)
    assert len(list(folders[0].glob("some_kernels.outer-*"))) == compiled_module._KEPT
    again = module()
    assert (answer(again), loaded(again)) == (121, 1)


def test_the_folders_in_their_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled_module.config, "CACHE_DIR", str(tmp_path / "chosen"))
    monkeypatch.setenv("CHMARL_CACHE", str(tmp_path / "own"))
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path))
    assert len(list(compiled_module._folders())) == 3
    chosen, beside, own, temporary = compiled_module._folders(to_write=True)
    assert (chosen, own) == (tmp_path / "chosen" / "chmarl_pb", tmp_path / "own" / "kernels")
    assert beside.parent == Path(compiled_module.__file__).parent
    assert temporary.parent == tmp_path
    assert temporary.stat().st_mode & 0o777 == 0o700


def test_a_temporary_folder_that_others_can_write_to_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path))
    *_, temporary = compiled_module._folders(to_write=True)
    temporary.chmod(0o777)
    assert temporary not in compiled_module._folders()
    temporary.chmod(0o700)
    moved = temporary.rename(tmp_path / "moved")
    temporary.symlink_to(moved)
    assert temporary not in compiled_module._folders()
    temporary.unlink()
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path / "missing"))
    assert len(list(compiled_module._folders())) == 2


# The whole package

EPISODES = """
import hashlib, json, sys
import numpy as np
from chmarl_pb.envs.parallel import HouseholdEnv
digests = []
for observation in ("scene_graph", "visual"):
    env, rng = HouseholdEnv(observation, image_size=32, render_mode="rgb_array"), np.random.default_rng(0)
    seen, infos = env.reset(seed=3)
    for _ in range(6):
        seen, rewards, *_, infos = env.step({name: int(rng.integers(env.action_space(name).n)) for name in env.agents})
        parts = [np.ascontiguousarray(value).tobytes() for one in seen.values() for value in one.values()]
        facts = json.dumps([rewards, [info["visible"] for info in infos.values()]])
        digests.append(hashlib.sha256(b"".join(parts) + facts.encode()).hexdigest())
    digests.append(hashlib.sha256(env.render().tobytes()).hexdigest())
    env.close()
print(json.dumps(digests))
"""

#: Refuses all that changes the file system, as if it were read-only, for root too.
READ_ONLY = """
import errno, os, sys
def refuse(event, arguments):
    writes = event == "open" and isinstance(arguments[0], (str, bytes)) and (
        (arguments[2] or 0) & (os.O_WRONLY | os.O_RDWR | os.O_CREAT) and str(arguments[0]) != os.devnull)
    if writes or event in ("os.mkdir", "os.rename", "os.remove", "os.truncate", "tempfile.mkstemp"):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), arguments[0])
sys.addaudithook(refuse)
"""

#: Ends the process as soon as anything is compiled.
NOTHING_NEW = """
from numba.core import event
class Listener(event.Listener):
    def on_start(self, event):
        raise SystemExit(f"compiled anew: {event.data['dispatcher']}")
    def on_end(self, event):
        pass
event.register("numba:compile", Listener())
"""


def episodes(code: str = "", **environment: str) -> list[str]:
    """Hashes of what is seen in some episodes, in a process of its own."""
    ended = subprocess.run(
        [sys.executable, "-c", code + EPISODES],
        env={**os.environ, **environment}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert ended.returncode == 0, ended.stderr
    assert "Traceback" not in ended.stderr
    hashes: list[str] = json.loads(ended.stdout)
    return hashes


@pytest.fixture(scope="module")
def usual() -> list[str]:
    """The hashes as they always are."""
    return episodes()


@needs_numba
def test_the_next_process_compiles_nothing(usual: list[str]) -> None:
    """The names of all files are the same there: nothing that they are made of holds an address."""
    assert episodes(NOTHING_NEW) == usual


@pytest.mark.slow
def test_episodes_without_compiling_are_the_same(usual: list[str], tmp_path: Path) -> None:
    assert episodes(NUMBA_DISABLE_JIT="1", CHMARL_CACHE=str(tmp_path)) == usual


def test_episodes_where_nothing_can_be_written_are_the_same(usual: list[str]) -> None:
    assert episodes(READ_ONLY, HOME="/nonexistent", CHMARL_CACHE="/nonexistent/cache") == usual


def test_episodes_with_a_cache_folder_that_is_a_file_are_the_same(usual: list[str], tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    assert episodes(NUMBA_CACHE_DIR=str(tmp_path / "file")) == usual


@needs_numba
def test_pictures_of_homes_drawn_without_compiling_are_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without compiling, TinyRenderer draws homes; our own rasteriser would give the same."""
    code = "import sys; from tests.test_compiled import drawn; sys.stdout.write(drawn())"
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    ended = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert ended.stdout == drawn()


def drawn() -> str:
    """A hash of pictures of a benchmark home, drawn by our own rasteriser."""
    home, digest = load_home("home_1"), hashlib.sha256()
    space, world = space_of(home), World(home)
    model = HomeModel(world.client, world.bodies["home"])
    for robot, pose in (("humanoid", 5), ("humanoid", 100), ("drone", 3)):
        picture = model.draw(lens(camera_of(find_model(robot)), view_matrix(find_model(robot).eye(space, pose))), 24)
        for array in (picture.colour, picture.depth, picture.segmentation):
            digest.update(np.ascontiguousarray(array).tobytes())
    world.close()
    return digest.hexdigest()


def test_compiled_functions_divide_as_the_machine_does() -> None:
    @compiled
    def divide(x: float, y: float) -> float:
        return x / y

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert divide(np.float64(1), np.float64(0)) == np.inf
