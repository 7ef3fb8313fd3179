"""``chmarl-pb homes``: list, check, draw, build and generate homes."""

import argparse
import sys
from functools import partial
from typing import Any

from chmarl_pb.catalog import room_of
from chmarl_pb.cli.arguments import OutputFile, add_catalog, add_verb, catalog_of, verbs
from chmarl_pb.cli.authoring import add_authoring
from chmarl_pb.cli.output import add_json, each, has, say, tell
from chmarl_pb.homes.home import home_names, home_path, load_home
from chmarl_pb.homes.layout import STYLES
from chmarl_pb.navigation.check import HomeReport
from chmarl_pb.rendering.preview import preview
from chmarl_pb.tasks.verdict import judge


def add(parser: argparse.ArgumentParser) -> None:
    """Add the verbs to a parser."""
    all_verbs = verbs(parser)
    listing = add_verb(all_verbs, "list", "list the homes that come with the package", "chmarl-pb homes list")
    listing.set_defaults(run=_list)
    add_json(listing, each(has("name", "area", "things", "file")))
    check = add_verb(
        all_verbs, "check", "check that a home can be played", "chmarl-pb homes check cabin.urdf --preview cabin.png"
    )
    check.set_defaults(run=_check)
    add_json(check, has("file", "playable", "problems"))
    check.add_argument(
        "--preview", type=OutputFile(".png"), metavar="PNG", help="draw the home with its problems marked"
    )
    draw = add_verb(all_verbs, "preview", "draw a home from above", "chmarl-pb homes preview home_1 --out home_1.png")
    draw.set_defaults(run=_preview)
    for verb in (check, draw):
        verb.add_argument("file", metavar="FILE", help="a home's URDF, or the name of a packaged home")
    add_catalog(check)
    draw.add_argument("--out", type=OutputFile(".png"), required=True, metavar="PNG", help="picture to write")
    add_authoring(all_verbs)


def _list(options: argparse.Namespace) -> int:
    """Print the packaged homes."""
    rows = list(map(_facts, home_names()))
    tell(options, lambda: rows, partial(_print_homes, rows))
    return 0


def _facts(name: str) -> dict[str, Any]:
    home = load_home(name)
    area = round(float(sum(room.area for room in home.rooms.values())), 1)
    classes = {thing.class_name for thing in home.receptacles.values()}
    path = str(home.path)
    return {"name": name, "area": area, "things": len(home.things), "receptacle_classes": len(classes), "file": path}


def _print_homes(rows: list[dict[str, Any]]) -> None:
    for row in rows:
        inside = f"{row['things']} things, {row['receptacle_classes']} receptacle classes"
        print(f"{row['name']}  {row['area']:5.1f} m2  {inside}  {row['file']}")
    say(f"layouts to begin with (homes new --style): {', '.join(STYLES)}")


def _check(options: argparse.Namespace) -> int:
    """Print all that was found in a home; return 1 if it cannot be played."""
    report = judge(options.file, known=catalog_of(options.catalog))
    if options.preview and report.home is not None:
        preview(report.home, options.preview, marks=report.problems)
    elif options.preview:
        print(f"{report.path}: no picture, for there are no floors to draw", file=sys.stderr)
    tell(options, report.as_dict, lambda: _tell(report, bool(options.preview)))
    return 1 if report.errors else 0


def _tell(report: HomeReport, numbered: bool) -> None:
    """Print a report for people: errors to the standard error, the rest to the standard output."""
    for number, problem in enumerate(report.problems, start=1):
        mark = f"[{number}] " if numbered else ""
        error = problem.severity == "error"
        print(f"{mark}{'' if error else 'warning: '}{problem}", file=sys.stderr if error else sys.stdout)
    if report.errors:
        return
    warnings = f", {len(report.warnings)} warnings" if report.warnings else ""
    print(f"{report.path}: good: it can be played{warnings}")
    for name, room in report.rooms.items():
        print(f"  {name}  {room.area:.1f} m2")
        for receptacle, top in report.tops.items():
            if room_of(receptacle) == name:
                print(f"    {receptacle}  {top.area:.2f} m2 free, {top.reached} of {top.places} places within reach")


def _preview(options: argparse.Namespace) -> int:
    """Draw a home from above."""
    preview(home_path(options.file), options.out)
    print(options.out)
    return 0
