"""`render_mode="human"`: a window where there is a display, one sentence where there is none, and PyTorch beside it."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

import chmarl_pb
from chmarl_pb.envs import window
from chmarl_pb.errors import MissingExtraError
from tests.helpers import warm_python

pygame = pytest.importorskip("pygame")

CHECK = """
import gymnasium, chmarl_pb
from gymnasium.utils.env_checker import check_env
env = gymnasium.make("CHMARL/SceneGraph-v0")
check_env(env.unwrapped)
"""
REFUSED = """
import chmarl_pb
try:
    chmarl_pb.parallel_env(render_mode="human")
except chmarl_pb.ChmarlError as error:
    print(error)
"""
OPTIMISE = """
import torch
torch.optim.Adam([torch.nn.Parameter(torch.zeros(1))])
with open("/proc/self/maps") as maps:
    assert "libLLVM" not in maps.read()
print("optimised")
"""


def run(code: str, start: str = "cold", **environment: str) -> subprocess.CompletedProcess[str]:
    """Run code in a process without a display, but for what is named; "cold" starts an interpreter of its own."""
    without = {"DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER", "SDL_FRAMEBUFFER_ACCELERATION"}
    inherited = {name: value for name, value in os.environ.items() if name not in without}
    if start == "warm":
        return warm_python.run(("-c", code), environment=inherited | environment)
    return subprocess.run(
        [sys.executable, "-c", code], env=inherited | environment, capture_output=True, text=True, check=False
    )


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="elsewhere there is always a display")
@pytest.mark.parametrize("environment", [{}, {"DISPLAY": ":4242"}, {"SDL_VIDEODRIVER": "x11"}], ids=str)
def test_no_display_is_one_sentence(environment: dict[str, str]) -> None:
    ended = run(REFUSED, start="warm" if environment else "cold", **environment)
    assert (ended.returncode, ended.stderr) == (0, "")
    (line,) = ended.stdout.splitlines()
    assert "no display" in line
    assert "render_mode='rgb_array'" in line
    assert "SDL_VIDEODRIVER=dummy" in line and "`chmarl-pb play`" in line


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="reads which libraries are loaded")
@pytest.mark.parametrize(
    "driver", ["dummy", *(pytest.param(driver, marks=pytest.mark.slow) for driver in ("offscreen", ""))]
)
def test_pytorch_optimises_after_a_window(driver: str) -> None:
    pytest.importorskip("torch")
    ended = run((CHECK if driver else REFUSED) + OPTIMISE, **({"SDL_VIDEODRIVER": driver} if driver else {}))
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.endswith("optimised\n")


def test_a_missing_pygame_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(MissingExtraError, match=r"pip install .*\[human\]"):
        chmarl_pb.parallel_env(render_mode="human")


def test_the_window_shows_each_step_and_goes_with_its_environment() -> None:
    human: Any = gymnasium.make("CHMARL/SceneGraph-v0", render_mode="human")
    other: Any = gymnasium.make("CHMARL/SceneGraph-v0", render_mode="rgb_array")
    for env in (human, other):
        env.reset(seed=0)
        if env is other:  # the trails on the map lead through the steps that were shown
            other.render()
        env.step(np.array([1, 1]))
    shown = pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)
    np.testing.assert_array_equal(shown, other.render())
    other.close()
    assert pygame.display.get_surface() is not None
    human.close()
    human.close()
    assert not pygame.display.get_init()


def test_the_window_takes_the_size_of_the_picture() -> None:
    for size in (16, 32):
        window.show(np.full((size, 2 * size, 3), size, np.uint8), "a picture")
        assert pygame.display.get_surface().get_size() == (2 * size, size)
    window.close_window()


def test_a_window_of_somebody_else_stays() -> None:
    pygame.display.init()
    own = pygame.display.set_mode((8, 8))
    env = chmarl_pb.parallel_env(render_mode="human")
    env.close()
    assert pygame.display.get_surface() is own
    pygame.display.quit()
