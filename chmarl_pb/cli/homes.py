"""``chmarl-pb homes``: list, check, draw, build and generate homes."""

import argparse
import sys

from chmarl_pb.cli.arguments import add_catalog, add_verb, catalog_of, output_file, verbs
from chmarl_pb.cli.authoring import add_authoring
from chmarl_pb.homes.home import home_names, home_path, load_home
from chmarl_pb.navigation.check import check_home
from chmarl_pb.rendering.preview import preview
from chmarl_pb.world import World


def add(parser: argparse.ArgumentParser) -> None:
    """Add the verbs to a parser."""
    all_verbs = verbs(parser)
    add_verb(all_verbs, "list", "list the homes that come with the package").set_defaults(run=_list)
    check = add_verb(all_verbs, "check", "check that a home can be played")
    check.set_defaults(run=_check)
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
    return 0


def _check(options: argparse.Namespace) -> int:
    """Print what keeps a home from being played; return 1 if anything does."""
    report = check_home(options.file, catalog_of(options.catalog))
    World(report.home).close()  # says so if PyBullet cannot load it
    for problem in report.problems:
        print(f"{report.home.path}: {problem}", file=sys.stderr)
    if report.problems:
        return 1
    print(f"{report.home.path}: good: {', '.join(report.home.rooms)}; {len(report.places)} receptacles within reach")
    return 0


def _preview(options: argparse.Namespace) -> int:
    """Draw a home from above."""
    preview(home_path(options.file), options.out)
    print(options.out)
    return 0
