"""Colours and a smooth canvas for text and simple shapes."""

from functools import cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

Colour = tuple[int, int, int]

PAPER: Colour = (246, 245, 241)
CARD: Colour = (255, 255, 255)
INK: Colour = (38, 42, 51)
MUTED: Colour = (122, 128, 138)
FAINT: Colour = (226, 226, 222)
#: Of the robots, by their place in the team.
ROBOTS: tuple[Colour, ...] = (
    (22, 110, 122), (214, 120, 36), (112, 84, 168), (120, 140, 30), (150, 90, 60), (60, 140, 180), (190, 100, 160),
    (90, 100, 110),
)  # fmt: skip
ITEM: Colour = (196, 48, 92)
TARGET: Colour = (52, 112, 196)
GOOD: Colour = (46, 140, 88)
BAD: Colour = (196, 62, 48)

_SCALE = 2  # drawn this much larger, so that edges come out smooth


@cache
def _font(size: int) -> ImageFont.FreeTypeFont:
    font = ImageFont.load_default(size)
    assert isinstance(font, ImageFont.FreeTypeFont)
    return font


class Canvas:
    """Draws in pixels of the finished picture; nothing has jagged edges."""

    def __init__(self, width: int, height: int):
        """Start with plain paper."""
        self.size = (width, height)
        self._image = Image.new("RGB", (width * _SCALE, height * _SCALE), PAPER)
        self._draw = ImageDraw.Draw(self._image)

    def text(self, x: float, y: float, words: str, size: int, colour: Colour = INK, anchor: str = "ls") -> float:
        """Write a line and return its width; the anchor is Pillow's, "ls" is left at the baseline."""
        font = _font(size * _SCALE)
        self._draw.text((x * _SCALE, y * _SCALE), words, colour, font, anchor)
        return width_of(words, size)

    def box(self, left: float, top: float, right: float, bottom: float, colour: Colour, radius: float = 0) -> None:
        """Fill a box with rounded corners."""
        corners = [side * _SCALE for side in (left, top, right, bottom)]
        self._draw.rounded_rectangle((*corners[:2], corners[2] - 1, corners[3] - 1), radius * _SCALE, colour)

    def disc(self, x: float, y: float, radius: float, colour: Colour) -> None:
        """Fill a disc."""
        self._draw.circle((x * _SCALE, y * _SCALE), radius * _SCALE, colour)

    def line(self, points: list[tuple[float, float]], colour: Colour, width: float) -> None:
        """Draw a line through points."""
        scaled = [(x * _SCALE, y * _SCALE) for x, y in points]
        self._draw.line(scaled, colour, round(width * _SCALE), joint="curve")

    def pixels(self) -> NDArray[np.uint8]:
        """Return the finished picture (height, width, 3)."""
        return np.asarray(self._image.resize(self.size, Image.Resampling.BOX))


def width_of(words: str, size: int) -> float:
    """Return the width of a line in pixels."""
    return _font(size * _SCALE).getlength(words) / _SCALE


def wrap(words: str, size: int, width: float, lines: int) -> list[str]:
    """Break a text into lines no wider than a width in pixels; what does not fit ends in an ellipsis."""
    rows = [""]
    for word in words.split():
        longer = f"{rows[-1]} {word}".strip()
        if width_of(longer, size) <= width or not rows[-1]:
            rows[-1] = longer
        elif len(rows) < lines:
            rows.append(word)
        else:
            rows[-1] = _shorten(longer, size, width)
            return rows
    return rows


def _shorten(words: str, size: int, width: float) -> str:
    while width_of(f"{words}…", size) > width:
        words = words[:-1]
    return f"{words.rstrip(' ,')}…"


def badge(letter: str, colour: Colour, radius: int) -> NDArray[np.uint8]:
    """Return a disc with a white rim and a letter, (side, side, 4) with alpha."""
    side, scale = 2 * radius + 2, 4
    middle = side * scale / 2
    image = Image.new("RGBA", (side * scale, side * scale), (*CARD, 0))
    draw = ImageDraw.Draw(image)
    draw.circle((middle, middle), radius * scale, CARD)
    draw.circle((middle, middle), (radius - 1.5) * scale, colour)
    draw.text((middle, middle), letter, CARD, _font(round(1.25 * radius) * scale), "mm", stroke_width=1)
    return np.asarray(image.resize((side, side), Image.Resampling.BOX))
