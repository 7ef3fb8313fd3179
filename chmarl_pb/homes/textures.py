"""Pictures on floors and walls: boxes as meshes on which a square picture is laid anew in every metre."""

import hashlib
from functools import lru_cache
from pathlib import Path

from chmarl_pb.assets import URDF_DIR

FOLDER = URDF_DIR / "textures"

# Normals of the faces of a box, and the two axes along which the picture lies on each, across and up, so that the face
# is seen counterclockwise from outside; -1: across runs against its axis.
_FACES = (
    ((0, 0, 1), (0, 1), 1), ((0, 0, -1), (0, 1), -1), ((0, 1, 0), (0, 2), -1), ((0, -1, 0), (0, 2), 1),
    ((1, 0, 0), (1, 2), 1), ((-1, 0, 0), (1, 2), -1),
)  # fmt: skip


def textures() -> dict[str, Path]:
    """Return the pictures that come with the package, by name; each shows one square metre."""
    return {file.stem: file for file in sorted(FOLDER.glob("*.png"))}


@lru_cache(maxsize=256)
def textured_box(picture: Path, size: tuple[float, float, float]) -> dict[str, bytes]:
    """Return the files of a box on whose faces a picture is repeated, by name; the last is the OBJ.

    Args:
        picture: PNG or JPEG of one square metre, tinted by the colour of the visual.
        size: extents x, y, z in metres.
    """
    content = picture.read_bytes()
    image = f"{picture.stem}_{hashlib.sha256(content).hexdigest()[:8]}{picture.suffix}"
    library = f"{Path(image).stem}.mtl"
    obj = "\n".join([f"mtllib {library}", "usemtl m", *_lines(size)]) + "\n"
    name = f"{Path(image).stem}_{hashlib.sha256(obj.encode()).hexdigest()[:8]}.obj"
    return {image: content, library: f"newmtl m\nmap_Kd {image}\n".encode(), name: obj.encode()}


def _lines(size: tuple[float, float, float]) -> list[str]:
    """Return vertices, normals, texture points and triangles of the box, centred on the origin."""
    lines: list[str] = []
    for number, (normal, (across, up), sign) in enumerate(_FACES):
        lines.append("vn " + " ".join(map(str, normal)))
        width, height = size[across], size[up]
        for u, v in ((0.0, 0.0), (width, 0.0), (width, height), (0.0, height)):
            place = [side * length / 2 for side, length in zip(normal, size, strict=True)]
            place[across], place[up] = sign * (u - width / 2), v - height / 2
            lines += ["v " + " ".join(f"{value:.6g}" for value in place), f"vt {u:.6g} {v:.6g}"]
        for corners in ((1, 2, 3), (1, 3, 4)):
            words = [f"{4 * number + corner}/{4 * number + corner}/{number + 1}" for corner in corners]
            lines.append("f " + " ".join(words))
    return lines
