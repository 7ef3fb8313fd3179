"""The reference tables of docs/guide.md, from the code: ``python -m tools.guide_tables`` writes them anew."""

import math
from collections.abc import Iterable
from pathlib import Path

from chmarl_pb import catalog
from chmarl_pb.assets import URDF_DIR
from chmarl_pb.homes import layout, rooms, source
from chmarl_pb.homes.materials import MOST_LIBRARY_BYTES, MOST_PIXELS
from chmarl_pb.homes.mesh import MOST_TRIANGLES
from chmarl_pb.homes.solids import MOST_CORNERS
from chmarl_pb.homes.textures import textures
from chmarl_pb.navigation import check, lattice, surfaces
from chmarl_pb.navigation.reach import REACH
from chmarl_pb.reading import MOST_FILE_BYTES

GUIDE = Path(__file__).parents[1] / "docs" / "guide.md"
BEGIN, END = "<!-- tables: written by python -m tools.guide_tables -->\n", "<!-- end of tables -->\n"


def tables() -> str:
    """Return the tables as Markdown."""
    return "\n".join([*_table("limit", "value", _limits()), "", *_table("what", "names", _names()), ""])


def _table(left: str, right: str, rows: Iterable[tuple[str, str]]) -> list[str]:
    return [f"| {left} | {right} |", "|---|---|", *(f"| {name} | {value} |" for name, value in rows)]


def _limits() -> list[tuple[str, str]]:
    """Return what a home may have, and what robots need of it."""
    near, far = REACH.distance
    lowest, highest = REACH.height
    body = lattice.FOOTPRINT
    return [
        ("rooms of a home", f"{check.MOST_ROOMS}"),
        ("furniture and scenery of a home", f"{check.MOST_THINGS}, one less for each robot beyond two"),
        ("size of a home", f"{rooms.WIDEST} m from end to end, {rooms.LARGEST} m² of floor"),
        ("tops of all receptacles", f"{surfaces.MOST_CELLS * surfaces.CELL**2:.0f} m²"),
        ("edges of rooms in a layout", f"on multiples of {layout.GRID} m"),
        ("URDF", f"{source.MOST_URDF_BYTES // 2**20} MiB, {source.MOST_ELEMENTS:,} elements"),
        (
            "other files",
            f"{source.MOST_FILES:,}, {MOST_FILE_BYTES // 2**20} MiB each, {source.MOST_BYTES // 2**20} MiB"
            f" together, {source.MOST_LINES:,} lines of OBJ and materials",
        ),
        ("triangles of all visuals", f"{MOST_TRIANGLES:,}"),
        ("corners of the hull of a collision", f"{MOST_CORNERS}"),
        ("a material file, a texture", f"{MOST_LIBRARY_BYTES // 2**20} MiB, {MOST_PIXELS:,} pixels"),
        ("the humanoid's body", f"{body.radius} m radius, from {body.low} m to {body.high} m high"),
        ("it stands", f"on multiples of {lattice.SPACING} m, looks in {lattice.HEADINGS} directions"),
        (
            "its hand reaches",
            f"{near} m to {far} m from its middle, {lowest} m to {highest} m high,"
            f" {math.degrees(REACH.bearing):.0f}° to either side",
        ),
    ]


def _names() -> list[tuple[str, str]]:
    """Return what things, rooms, models and pictures are called."""
    models = sorted(file.stem for file in (URDF_DIR / "furniture").glob("*.urdf"))
    return [
        ("rooms that robots go to", _listed(catalog.ROOM_KINDS)),
        ("other rooms", _listed(room for room in catalog.BENCHMARK.rooms if room not in catalog.ROOM_KINDS)),
        ("receptacles", _listed(catalog.BENCHMARK.receptacles)),
        ("scenery", _listed(catalog.BENCHMARK.scenery)),
        ("structure", _listed(catalog.STRUCTURE)),
        ("objects", _listed(catalog.BENCHMARK.graspables)),
        ("furniture models", _listed(models)),
        ("pictures for floors and walls", _listed(textures())),
        ("layouts to begin with", _listed(layout.STYLES)),
    ]


def _listed(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


def main() -> None:
    """Write the tables into the guide."""
    text = GUIDE.read_text(encoding="utf-8")
    before, after = text.split(BEGIN)[0], text.split(END)[1]
    GUIDE.write_text(f"{before}{BEGIN}\n{tables()}\n{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
