"""Pictures of floors and walls, in greys around white, so that a room's colour tints them; each is one square metre.

They are drawn at low contrast with broad features: small cameras take one texel a pixel, and fine lines would glitter.
Edges meet, so that copies lie side by side without a seam.
"""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

SIZE = 256  # pixels of a metre

Grey = NDArray[np.float64]


def planks(rng: np.random.Generator) -> Grey:
    """Return boards 0.125 m wide that end at different places, each in a tone and with a grain of its own."""
    rows, height = 8, SIZE // 8
    picture = np.ones((SIZE, SIZE))
    for row in range(rows):
        start = int(rng.integers(SIZE))
        for half in range(2):
            columns = (start + half * SIZE // 2 + np.arange(SIZE // 2)) % SIZE
            grain: Grey = np.repeat(rng.uniform(-0.015, 0.015, (height // 4, 1)), 4, axis=0)
            picture[row * height : (row + 1) * height, columns] = 0.93 + rng.uniform(-0.06, 0.06) + grain
            picture[row * height : (row + 1) * height, columns[:2]] = 0.86
        picture[row * height : row * height + 2] = 0.87
    return picture


def tiles(rng: np.random.Generator) -> Grey:
    """Return four tiles of 0.5 m with joints of 12 mm."""
    picture, half = np.empty((SIZE, SIZE)), SIZE // 2
    for x in (0, half):
        for y in (0, half):
            picture[y : y + half, x : x + half] = 0.94 + rng.uniform(-0.03, 0.03)
    for line in (0, half):
        picture[line : line + 3] = picture[:, line : line + 3] = 0.84
    return picture


def checks(rng: np.random.Generator) -> Grey:
    """Return tiles of 0.25 m in two tones by turns."""
    fields = np.indices((4, 4)).sum(axis=0) % 2
    return np.asarray(np.kron(np.where(fields, 0.97, 0.8), np.ones((SIZE // 4, SIZE // 4))))


def carpet(rng: np.random.Generator) -> Grey:
    """Return soft patches."""
    noise = rng.uniform(-1, 1, (SIZE // 8, SIZE // 8))
    tiled = cv2.resize(np.tile(noise, (3, 3)), (3 * SIZE, 3 * SIZE), interpolation=cv2.INTER_CUBIC)
    return np.asarray(0.93 + 0.045 * tiled[SIZE : 2 * SIZE, SIZE : 2 * SIZE])


def panels(rng: np.random.Generator) -> Grey:
    """Return upright boards 0.25 m wide, for walls."""
    picture, width = np.ones((SIZE, SIZE)), SIZE // 4
    for column in range(4):
        picture[:, column * width : (column + 1) * width] = 0.95 + rng.uniform(-0.03, 0.03)
        picture[:, column * width : column * width + 3] = 0.82
    return picture


TEXTURES: dict[str, Callable[[np.random.Generator], Grey]] = {
    "planks": planks, "tiles": tiles, "checks": checks, "carpet": carpet, "panels": panels,
}  # fmt: skip


def write_textures(folder: Path) -> None:
    """Write all of them as PNG."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, (name, draw) in enumerate(TEXTURES.items()):
        grey = np.rint(255 * draw(np.random.default_rng(number)).clip(0, 1)).astype(np.uint8)
        (folder / f"{name}.png").write_bytes(cv2.imencode(".png", grey, [cv2.IMWRITE_PNG_COMPRESSION, 9])[1].tobytes())


if __name__ == "__main__":
    write_textures(Path("urdf/textures"))
