"""Contact sheet of the models: ``python -m tools.assets.sheet --out docs/assets.png``.

Every URDF under ``urdf/`` is loaded alone and rendered by TinyRenderer from its front left, slightly above, so that
its bounds fill the cell. No graphics card or display is needed.
"""

import argparse
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from yourdfpy import URDF

from chmarl_pb.assets import URDF_DIR
from chmarl_pb.world.bullet import pybullet as p

GROUPS = ("graspables", "furniture", "robots")

#: Direction (x, y, z) from a model to the camera: graspables face -y, furniture and robots face +x.
VIEWS = {"graspables": (-0.35, -1.0, 0.7), "furniture": (1.0, -0.6, 0.65), "robots": (1.0, -0.6, 0.45)}
LIGHTS = {"graspables": (-0.8, -1.2, 2.0), "furniture": (1.4, -0.5, 2.0), "robots": (1.4, -0.5, 2.0)}
FIELD_OF_VIEW = 30.0  # degrees
BACKGROUND = (226, 230, 232)
_COLUMNS, _SIZE = 11, 224  # models in a row, and pixels of a picture

Image = NDArray[np.uint8]


def picture(urdf: Path, size: int, turn: float = 0.0) -> Image:
    """Render one model.

    Args:
        urdf: the model's file, in one of the folders ``GROUPS``.
        size: side of the square picture, in pixels.
        turn: by which the camera goes round the model, radians.

    Returns:
        RGB picture, shape (size, size, 3).
    """
    (x, y, z), cosine, sine = VIEWS[urdf.parent.name], np.cos(turn), np.sin(turn)
    view = np.array([x * cosine - y * sine, x * sine + y * cosine, z])
    client = p.connect(p.DIRECT)
    try:
        p.loadURDF(str(urdf), useFixedBase=True, physicsClientId=client)
        _, _, colour, _, mask = p.getCameraImage(
            size,
            size,
            *_camera(_visible_bounds(urdf), view),
            lightDirection=LIGHTS[urdf.parent.name],
            shadow=1,
            renderer=p.ER_TINY_RENDERER,
            physicsClientId=client,
        )
    finally:
        p.disconnect(client)
    image = np.reshape(colour, (size, size, 4))[..., :3].astype(np.uint8)
    image[np.reshape(mask, (size, size)) < 0] = BACKGROUND
    return image


def sheet(files: list[Path], columns: int, size: int) -> Image:
    """Render labelled pictures of models in rows and return one RGB picture."""
    cells = [_labelled(picture(file, size), file.stem) for file in files]
    blank = np.full_like(cells[0], 255)
    cells += [blank] * (-len(cells) % columns)
    rows = [np.concatenate(cells[start : start + columns], axis=1) for start in range(0, len(cells), columns)]
    return np.concatenate(rows)


def _visible_bounds(urdf: Path) -> NDArray[np.float64]:
    """Return the lowest and highest corner of all that is seen of a model, in metres."""
    bounds: NDArray[np.float64] = URDF.load(str(urdf)).scene.bounds
    return bounds


def _camera(bounds: NDArray[np.float64], view: NDArray[np.float64]) -> tuple[list[float], list[float]]:
    """Return view and projection matrices of a camera whose picture just holds the bounds."""
    centre, radius = bounds.mean(axis=0), float(np.linalg.norm(bounds[1] - bounds[0])) / 2
    towards = view / np.linalg.norm(view)
    right = np.cross([0, 0, 1], towards) / np.linalg.norm(np.cross([0, 0, 1], towards))
    corners = np.stack(np.meshgrid(*(bounds - centre).T), axis=-1).reshape(-1, 3)
    reach = np.abs(corners @ np.stack([right, np.cross(towards, right)], axis=1)).max(axis=1)
    distance = float(np.max(1.04 * reach / np.tan(np.radians(FIELD_OF_VIEW / 2)) + corners @ towards))
    eye = centre + distance * towards
    return (
        p.computeViewMatrix(eye.tolist(), centre.tolist(), [0, 0, 1]),
        p.computeProjectionMatrixFOV(FIELD_OF_VIEW, 1.0, 0.1 * distance, distance + 2 * radius),
    )


def _labelled(image: Image, name: str) -> Image:
    """Add a white strip with the model's name below a picture."""
    strip = np.full((24, image.shape[1], 3), 255, dtype=np.uint8)
    cv2.putText(strip, name.replace("_", " "), (6, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (30, 30, 30), 1, cv2.LINE_AA)
    return np.concatenate([image, strip])


def main() -> None:
    """Write the contact sheet."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("docs/assets.png"), help="PNG file to write")
    parser.add_argument("--models", nargs="*", help="only these models, by name")
    arguments = parser.parse_args()
    files = [file for group in GROUPS for file in sorted((URDF_DIR / group).glob("*.urdf"))]
    files = [file for file in files if file.stem in (arguments.models or [file.stem])]
    if not files:
        parser.error("no such models")
    image = sheet(files, min(_COLUMNS, len(files)), _SIZE)
    cv2.imwrite(str(arguments.out), cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_PNG_COMPRESSION, 9])
    print(f"{arguments.out}: {len(files)} models")


if __name__ == "__main__":
    main()
