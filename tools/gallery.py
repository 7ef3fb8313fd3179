"""Moving pictures of the documentation's gallery: ``python -m tools.gallery [NAME ...]``; about five minutes for all.

They show what ``render()`` gives, smaller, and in few colours so that they are small files.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import chmarl_pb
from chmarl_pb.assets import URDF_DIR
from chmarl_pb.policies.policy import Policy
from chmarl_pb.tasks.kinds import Tidy
from tools.assets.sheet import picture

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs" / "gallery"
WIDTH, COLOURS = 640, 64
TURNS = 16  # pictures of a robot that turns once
STEP, LAST = 700, 2500  # milliseconds that a step and the end of an episode are shown


def write(name: str, frames: Sequence[Image.Image], pause: int = STEP, last: int = LAST) -> None:
    """Write frames as an endless GIF of one palette."""
    height = frames[0].height * WIDTH // frames[0].width
    small = [frame.convert("RGB").resize((WIDTH, height), Image.Resampling.LANCZOS) for frame in frames]
    palette = small[len(small) // 2].quantize(COLOURS)
    plain = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in small]
    pauses = [pause] * (len(plain) - 1) + [last]
    path = FOLDER / f"{name}.gif"
    plain[0].save(path, save_all=True, append_images=plain[1:], duration=pauses, loop=0, optimize=True)
    print(f"{path.relative_to(ROOT)}: {len(plain)} frames, {path.stat().st_size / 1000:.0f} kB")


def episode(name: str, policy: str, row: str | None = None, **options: Any) -> None:
    """Play the task of a row of the splits, or one that is drawn by the options, and write its frames."""
    env = chmarl_pb.parallel_env(render_mode="rgb_array", **options)
    frames: list[Image.Image] = []
    player: Policy = chmarl_pb.make_policy(policy, env)
    chmarl_pb.rollout(env, player, 0, row, on_step=lambda core: frames.append(_image(core.render())))
    env.close()
    write(name, frames)


def robots() -> None:
    """Write humanoid and drone, turning."""
    frames = []
    for turn in np.linspace(0, 2 * np.pi, TURNS, endpoint=False):
        shown = [picture(URDF_DIR / "robots" / f"{name}.urdf", 320, float(turn)) for name in ("humanoid", "drone")]
        frames.append(_image(np.hstack(shown)))
    write("robots", frames, pause=200, last=200)


def homes() -> None:
    """Write one home after the other, from their previews."""
    paths = sorted((ROOT / "docs" / "homes").glob("home_*.png"))
    write("homes", [Image.open(path) for path in paths], pause=2000, last=2000)


def _image(pixels: Any) -> Image.Image:
    return Image.fromarray(np.asarray(pixels, dtype=np.uint8))


GALLERY: dict[str, Callable[[], None]] = {
    "paper_track": lambda: episode("paper_track", "search", row="test-unseen-007", split="test-unseen"),
    "grounded_track": lambda: episode(
        "grounded_track", "belief", row="generated-val-000", split="generated-val", track="grounded"
    ),
    "team": lambda: episode(
        "team",
        "planner",
        task=Tidy(3, 3),
        split="val-unseen",
        max_steps=60,
        robots=("humanoid", "humanoid", "humanoid", "drone", "drone"),
    ),
    "robots": robots,
    "homes": homes,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the pictures that are named, else all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of: {', '.join(GALLERY)}")
    names = parser.parse_args(arguments).names or list(GALLERY)
    unknown = sorted(set(names) - set(GALLERY))
    if unknown:
        parser.error(f"no picture is called {unknown[0]!r}; use one of: {', '.join(GALLERY)}")
    FOLDER.mkdir(exist_ok=True)
    for name in names:
        GALLERY[name]()
    return 0


if __name__ == "__main__":
    sys.exit(main())
