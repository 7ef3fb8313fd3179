"""``chmarl-pb things``: import, list and check own objects and furniture."""

import argparse
from functools import partial
from pathlib import Path
from typing import Any

from chmarl_pb.catalog import BENCHMARK, Catalog, ThingClass
from chmarl_pb.cli.arguments import OutputFile, add_verb, verbs
from chmarl_pb.cli.output import add_json, each, has, tell
from chmarl_pb.homes.catalog_file import KEYS
from chmarl_pb.homes.imports import AXES, Wish, add_thing
from chmarl_pb.homes.things import Thing
from chmarl_pb.rendering.preview import preview_model
from chmarl_pb.tasks.language.own_names import load_things, name_fault

_CATALOG = Path("my_things.toml")


def add(parser: argparse.ArgumentParser) -> None:
    """Add the verbs to a parser."""
    all_verbs = verbs(parser)
    adding = add_verb(
        all_verbs,
        "add",
        "import a URDF or a mesh (OBJ, STL, DAE) as a class of things",
        "chmarl-pb things add duck.stl --class rubber_duck --scale 0.001 --names 'rubber duck' 'yellow duck'",
    )
    adding.set_defaults(run=_add)
    adding.add_argument("file", type=Path, metavar="FILE", help="URDF or mesh")
    adding.add_argument("--class", dest="name", required=True, metavar="NAME", help="name of the class, as rubber_duck")
    adding.add_argument("--kind", choices=tuple(KEYS), default="graspable", help="default: %(default)s")
    adding.add_argument("--scale", type=float, default=1.0, metavar="S", help="metres in a unit of it (default: 1)")
    adding.add_argument(
        "--up", choices=AXES, help="axis of the file that points up (default: z, if the file says no other)"
    )
    adding.add_argument("--mass", type=float, metavar="KG", help="default: the file's, else guessed from its size")
    for option, text in (
        ("--names", "other names of it in instructions, as 'yellow duck'; some before one that takes no 'a'"),
        ("--held-out", "names that are never used in training"),
        ("--states", "symbolic states, the usual one first"),
    ):
        adding.add_argument(option, nargs="+", default=[], metavar="WORDS", help=text)
    adding.add_argument("--out", type=OutputFile(".png"), metavar="PNG", help="draw it, too")
    listing = add_verb(
        all_verbs,
        "list",
        "list all classes, the benchmark's and own ones",
        "chmarl-pb things list --catalog my_things.toml",
    )
    listing.set_defaults(run=_list)
    add_json(listing, each(has("id", "kind", "name", "synonyms")))
    checking = add_verb(
        all_verbs, "check", "check a catalogue file and all that it names", "chmarl-pb things check my_things.toml"
    )
    checking.set_defaults(run=_check)
    checking.add_argument("catalog", type=Path, metavar="TOML", help="catalogue file")
    adding.add_argument(
        "--catalog", type=Path, default=_CATALOG, metavar="TOML", help="catalogue file (default: %(default)s)"
    )
    listing.add_argument("--catalog", type=Path, metavar="TOML", help="catalogue file; its classes stand at the end")


def _add(options: argparse.Namespace) -> int:
    """Import a file and print what it has become."""
    wish = Wish(
        options.name, options.kind, options.scale, options.up, options.mass,
        tuple(options.names), tuple(options.held_out), tuple(options.states),
    )  # fmt: skip
    picture = None if options.out is None else (options.out, preview_model)
    catalog, thing = add_thing(options.file, wish, options.catalog, load_things, picture)
    row = catalog.classes[options.name]
    for label, value in _sheet(catalog, row, thing):
        print(f"{label:10} {value}")
    if options.out is not None:
        print(options.out)
    count = len(catalog.rows) - len(BENCHMARK.rows)
    print(f"{options.catalog}: {count} own class{'' if count == 1 else 'es'}")
    return 0


def _sheet(catalog: Catalog, row: ThingClass, thing: Thing) -> list[tuple[str, str]]:
    """Return what there is to know of a class."""
    return [
        ("class", f"{row.name}, {row.kind}, id {catalog.class_ids[row.name]}"),
        ("size", " x ".join(f"{side:.3f}" for side in thing.size) + " m"),
        ("mass", f"{thing.mass:.3g} kg" if row.kind == "graspable" else "fixed"),
        ("triangles", f"{sum(len(part.corners) for part in thing.parts):,} in {len(thing.parts)} colours"),
        ("names", ", ".join(f"{name.text} (held out)" if name.held_out else name.text for name in row.names)),
        ("states", ", ".join(row.states)),
    ]


def _list(options: argparse.Namespace) -> int:
    """Print all classes."""
    catalog = BENCHMARK if options.catalog is None else load_things(options.catalog)
    rows = [
        {"id": catalog.class_ids[row.name], "kind": row.kind, "name": row.name, "synonyms": list(row.synonyms)}
        for row in catalog.rows
    ]
    tell(options, lambda: rows, partial(_print_classes, rows))
    return 0


def _print_classes(rows: list[dict[str, Any]]) -> None:
    for row in rows:
        print(f"{row['id']:4} {row['kind']:10} {row['name']:18} {', '.join(row['synonyms'])}")


def _check(options: argparse.Namespace) -> int:
    """Read a catalogue file, which says what is wrong with it."""
    known = load_things(options.catalog)
    own = ", ".join(f"{row.name} ({row.kind})" for row in known.rows[len(BENCHMARK.rows) :])
    print(f"{options.catalog}: good: {own}")
    if fault := name_fault(known, lookalikes=True):
        print(f"but not with lookalikes, as in the grounded track: {fault}")
    return 0
