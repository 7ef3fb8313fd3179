"""``chmarl-pb homes``: list, check, draw, build and generate homes."""

import argparse
import json
import sys

from chmarl_pb.catalog import room_of
from chmarl_pb.cli.arguments import add_catalog, add_verb, catalog_of, output_file, verbs
from chmarl_pb.cli.authoring import add_authoring
from chmarl_pb.files import write_atomically
from chmarl_pb.homes.home import home_names, home_path, load_home
from chmarl_pb.homes.layout import STYLES
from chmarl_pb.navigation.check import HomeReport
from chmarl_pb.rendering.preview import preview
from chmarl_pb.tasks.verdict import judge


def add(parser: argparse.ArgumentParser) -> None:
    """Add the verbs to a parser."""
    all_verbs = verbs(parser)
    add_verb(all_verbs, "list", "list the homes that come with the package").set_defaults(run=_list)
    check = add_verb(all_verbs, "check", "check that a home can be played")
    check.set_defaults(run=_check)
    check.add_argument("--json", metavar="FILE", help="write the report as JSON; - for the standard output")
    check.add_argument("--preview", type=output_file, metavar="PNG", help="draw the home with its problems marked")
    draw = add_verb(all_verbs, "preview", "draw a home from above")
    draw.set_defaults(run=_preview)
    for verb in (check, draw):
        verb.add_argument("file", metavar="FILE", help="a home's URDF, or the name of a packaged home")
    add_catalog(check)
    draw.add_argument("--out", type=output_file, required=True, metavar="PNG", help="picture to write")
    add_authoring(all_verbs)


def _list(options: argparse.Namespace) -> int:
    """Print the packaged homes."""
    for name in home_names():
        home = load_home(name)
        area = sum(room.area for room in home.rooms.values())
        classes = {thing.class_name for thing in home.receptacles.values()}
        print(f"{name}  {area:5.1f} m2  {len(home.things)} things, {len(classes)} receptacle classes  {home.path}")
    print(f"layouts to begin with (homes new --style): {', '.join(STYLES)}")
    return 0


def _check(options: argparse.Namespace) -> int:
    """Print all that was found in a home; return 1 if it cannot be played."""
    report = judge(options.file, known=catalog_of(options.catalog))
    if options.json:
        text = json.dumps(report.as_dict(), indent=2, ensure_ascii=False)
        if options.json == "-":
            print(text)
        else:
            write_atomically(output_file(options.json), text + "\n")
    if options.preview and report.home is not None:
        preview(report.home, options.preview, marks=report.problems)
    elif options.preview:
        print(f"{report.path}: no picture, for there are no floors to draw", file=sys.stderr)
    if options.json != "-":
        _tell(report, bool(options.preview))
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
