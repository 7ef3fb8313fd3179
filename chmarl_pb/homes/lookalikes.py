"""Lookalikes: in a home there may be several objects of each class, told apart by the colour of their main part.

The number in an object's name is the id of its colour: ``mug_3`` is the red one. A class has the same colours in every
home, none of which a name of the class holds ("red apple" is any apple), and its own size in each.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from xml.etree import ElementTree

from chmarl_pb.catalog import COLOURS, Catalog, Files, ThingClass
from chmarl_pb.homes.home import Home
from chmarl_pb.homes.object_looks import RGB, main_part, packaged_model, paint

#: Objects of a class that there may be: one that is meant, and up to three others.
OF_A_CLASS = 4

_OTHER_PARTS = 0.75  # share of the colour in parts of another material than the main one

_FEWEST = 2  # colours of a class
#: What a class has that does not have enough colours of its own.
_USUAL = ("red", "blue", "yellow", "white", "green", "black")
#: Colours that no two objects of a class have, as shades of the one look like the other.
_ALIKE = tuple(
    map(set, (("red", "orange"), ("red", "brown"), ("red", "pink"), ("blue", "purple"), ("brown", "orange"),
              ("brown", "black")))
)  # fmt: skip


@lru_cache(maxsize=16)
def among_lookalikes(home: Home) -> Home:
    """Return a home whose catalogue has several objects of each class; ids, names and states stay."""
    return replace(home, catalog=_with_lookalikes(home.catalog))


def colours_of(row: ThingClass) -> tuple[str, ...]:
    """Return the colours of the objects of a class, in the order of their ids."""
    taken = {word for name in row.synonyms for word in name.split()}
    chosen: list[str] = []
    for colour in (*main_part(row.name)[1], *_USUAL):
        clashes = colour in taken or any({colour, other} in (*_ALIKE, {colour}) for other in chosen)
        if colour in COLOURS and not clashes and len(chosen) < OF_A_CLASS:
            chosen.append(colour)
    if len(chosen) < _FEWEST:  # its names hold most colours
        others = (colour for colour in sorted(COLOURS, key=taken.__contains__) if colour not in chosen)
        chosen = [*chosen, *others][:_FEWEST]
    return tuple(sorted(chosen, key=COLOURS.index))


@lru_cache(maxsize=16)
def _with_lookalikes(known: Catalog) -> Catalog:
    rows = tuple(replace(row, looks=tuple(_looks(row))) if row.kind == "graspable" else row for row in known.rows)
    return replace(known, rows=rows, content=f"{known.content} lookalikes".strip())


def _looks(row: ThingClass) -> Iterator[tuple[str, Files]]:
    """Yield the colours of a class, each with the files of its object."""
    (name, urdf), *meshes = row.model or packaged_model(row.name)
    material = main_part(row.name)[0] or _first_material(urdf)
    for colour in colours_of(row):
        root = ElementTree.fromstring(urdf)
        _tint(root, RGB[colour])
        paint(root, material, RGB[colour])
        yield colour, ((f"{colour}_{name}", ElementTree.tostring(root)), *meshes)


def _tint(root: ElementTree.Element, colour: tuple[float, float, float]) -> None:
    """Mix a colour into all parts of an object: whatever side is seen, it is of that colour."""
    for element in root.iter("color"):
        *own, alpha = map(float, element.attrib["rgba"].split())
        mixed = [_OTHER_PARTS * new + (1 - _OTHER_PARTS) * old for new, old in zip(colour, own, strict=True)]
        element.set("rgba", " ".join(f"{channel:.4g}" for channel in (*mixed, alpha)))


def _first_material(urdf: bytes) -> str:
    """Return the material of the first part that is seen of an object of the user's own."""
    return next((element.get("name", "") for element in ElementTree.fromstring(urdf).iter("material")), "")
