"""Contact sheet of generated homes: ``python -m tools.homes_sheet --out docs/homes/generated.png``."""

import argparse
import tempfile
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from chmarl_pb.homes.generate.store import generate_home
from chmarl_pb.rendering.preview import preview

COLUMNS = 4
CELL = (520, 260)  # pixels: plan and doll's house side by side


def sheet(count: int, out: Path) -> None:
    """Draw the homes of the first seeds in rows, and write the picture."""
    cells = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(count):
            path = generate_home(seed, folder)
            preview(path, path.with_suffix(".png"), (2 * CELL[0], 2 * CELL[1]))
            cells.append(_cell(path.with_suffix(".png"), str(seed)))
    rows = [np.hstack(cells[start : start + COLUMNS]) for start in range(0, count, COLUMNS)]
    cv2.imwrite(str(out), np.vstack(rows))


def _cell(picture: Path, text: str) -> NDArray[np.uint8]:
    """Return a picture at half its size, with a text in its corner."""
    pixels = np.asarray(cv2.imread(str(picture)), dtype=np.uint8)
    cell = np.asarray(cv2.resize(pixels, CELL, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    cv2.putText(cell, text, (6, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (90, 90, 90), 1, cv2.LINE_AA)
    return cell


def main() -> None:
    """Parse the command line and draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=24, help="homes, a multiple of 4 (default: %(default)s)")
    parser.add_argument("--out", type=Path, required=True, help="PNG to write")
    options = parser.parse_args()
    sheet(options.count, options.out)


if __name__ == "__main__":
    main()
