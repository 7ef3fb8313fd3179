"""Looks of graspable objects: the colour of their main part and their proportions, one set of looks for a home.

A home asks for a set by an empty link ``object_looks_<n>``; without one its objects look as in the benchmark's homes.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from chmarl_pb.catalog import Catalog, Files, ThingClass, graspable_urdf

LINK = "object_looks_"

#: Number of sets; a process that plays in homes of all of them keeps the meshes of each (35 MB).
SETS = 6

_LINK = re.compile(LINK + "([0-9]{1,6})")
#: Colours by name.
RGB = {
    "white": (0.96, 0.96, 0.95), "grey": (0.42, 0.43, 0.45), "black": (0.07, 0.07, 0.08), "red": (0.85, 0.13, 0.12),
    "pink": (0.97, 0.60, 0.70), "orange": (0.97, 0.53, 0.10), "yellow": (0.99, 0.84, 0.14), "brown": (0.40, 0.23, 0.11),
    "green": (0.18, 0.58, 0.23), "teal": (0.10, 0.55, 0.58), "blue": (0.13, 0.36, 0.78), "purple": (0.50, 0.28, 0.68),
}  # fmt: skip
#: Class | the material of its main part | colours that it may have instead of its own.
_TABLE = """
    apple | red | green yellow
    banana | yellow | green brown
    board_game | crimson | blue green purple
    book | navy | red green black
    bowl | blue | white red teal
    bread | crust | brown yellow
    candle | cream | red green purple
    cereal_box | orange | blue green purple
    chocolate_syrup | brown | black red
    clock | red | white black blue
    coffee_pot | red | black teal white
    cooking_pot | silver | red black blue
    cupcake | pink | brown white teal
    cushion | teal | red grey blue
    face_cream | pink | white blue green
    folder | manila | red blue green
    fork | red | black blue green
    frying_pan | charcoal | red green blue
    glass | glass | teal pink green
    hairbrush | rose | black blue brown
    juice_box | green | orange red purple
    knife | black | red brown blue
    lime | lime | green yellow
    lotion | cream | pink teal blue
    magazine | rose | blue green black
    milk_carton | blue | red green purple
    mobile_phone | navy | white red black
    mug | teal | red yellow white
    notes | lemon | pink green blue
    peach | peach | orange red
    plate | white | blue red teal
    remote_control | charcoal | white grey blue
    shampoo | violet | green orange white
    slippers | rose | blue brown grey
    sports_ball | white | orange yellow green
    teddy_bear | fur | white grey pink
    toothbrush | blue | red green purple
    toothpaste | white | red teal blue
    towel | blue | white pink green
    toy_car | red | blue yellow green
    washing_sponge | yellow | pink blue green
    water_bottle | blue | red green black
    whipped_cream | blue | red pink teal
    wine_bottle | bottle | black brown blue
    wine_glass | ice | pink teal purple
"""
_ROWS = (re.split(r" *\| *", line.strip()) for line in _TABLE.strip().splitlines())
_PAINT = {name: (material, colours.split()) for name, material, colours in _ROWS}
_WIDTHS, _HEIGHTS = (0.88, 0.94, 1.0), (0.88, 1.0, 1.1)  # of the usual footprint and height


def looks_in(catalog: Catalog, links: Iterable[str]) -> Catalog:
    """Return a catalogue with the looks that one of a home's links asks for, or as it is."""
    found = (_LINK.fullmatch(name) for name in links)
    return next((with_looks(catalog, int(match[1])) for match in found if match), catalog)


def with_looks(catalog: Catalog, number: int) -> Catalog:
    """Return a catalogue whose packaged graspables have the looks of a set; ids, names and states stay.

    Args:
        catalog: the classes.
        number: of the set; sets repeat after ``SETS``.
    """
    return _with_looks(catalog, number % SETS)


@lru_cache(maxsize=SETS)
def _with_looks(catalog: Catalog, number: int) -> Catalog:
    rows = tuple(
        replace(row, model=_model(row, number, place)) if row.name in _PAINT else row
        for place, row in enumerate(catalog.rows)
    )
    return replace(catalog, rows=rows, content=f"{catalog.content} object_looks_{number}".strip())


def main_part(class_name: str) -> tuple[str, tuple[str, ...]]:
    """Return the material of the main part of a packaged class and the colours that suit it; nothing of others."""
    material, colours = _PAINT.get(class_name, ("", []))
    return material, tuple(colour for colour in (material, *colours) if colour in RGB)


def packaged_model(class_name: str) -> Files:
    """Return the files of a packaged class as it looks in the benchmark's homes."""
    urdf = graspable_urdf(class_name)
    root = ElementTree.fromstring(urdf.read_bytes())
    _resize(root, (1.0, 1.0, 1.0), urdf.parent)
    return ((urdf.name, _written(root)),)


def _model(row: ThingClass, number: int, place: int) -> Files:
    """Return the files of a class, whose place in the catalogue this is, in the colour and size of a set."""
    urdf, rng = graspable_urdf(row.name), np.random.default_rng((number, place))
    material, colours = _PAINT[row.name]
    colour = [None, *(RGB[name] for name in colours)][(number + place) % (len(colours) + 1)]
    width, height = _WIDTHS[int(rng.integers(len(_WIDTHS)))], _HEIGHTS[int(rng.integers(len(_HEIGHTS)))]
    root = ElementTree.fromstring(urdf.read_bytes())
    _resize(root, (width, width, height), urdf.parent)
    if colour is not None:
        paint(root, material, colour)
    return ((urdf.name, _written(root)),)


def _written(root: ElementTree.Element) -> bytes:
    return ElementTree.tostring(root, "unicode").encode("ascii", "xmlcharrefreplace")  # as bytes it takes far longer


def paint(root: ElementTree.Element, material: str, colour: tuple[float, float, float]) -> None:
    """Give all parts of an object that are of a material another colour."""
    for element in root.iter("material"):
        if element.get("name") == material:
            _set_numbers(element.find("color"), "rgba", (*colour, 1.0))


def _resize(root: ElementTree.Element, scale: tuple[float, float, float], folder: Path) -> None:
    """Scale all lengths of an object; its meshes are named where they lie, from the folder of its URDF."""
    for element in root.iter():
        if element.tag == "origin":
            _scale_numbers(element, "xyz", scale)
        elif element.tag == "box":
            _scale_numbers(element, "size", scale)
        elif element.tag == "mesh":
            element.set("filename", str(folder / element.attrib["filename"]))
            _set_numbers(element, "scale", scale)
        elif element.tag == "inertia":
            squares = scale[1] * scale[2], scale[0] * scale[2], scale[0] * scale[1]  # near enough
            for name, factor in zip(("ixx", "iyy", "izz"), squares, strict=True):
                _scale_numbers(element, name, (factor,))


def _scale_numbers(element: ElementTree.Element, name: str, factors: Sequence[float]) -> None:
    words = zip(element.attrib[name].split(), factors, strict=True)
    _set_numbers(element, name, [float(word) * factor for word, factor in words])


def _set_numbers(element: ElementTree.Element | None, name: str, numbers: Sequence[float]) -> None:
    assert element is not None, "every material of a packaged object has a colour"
    element.set(name, " ".join([f"{number:.6g}" for number in numbers]))
