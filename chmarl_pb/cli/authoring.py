"""The verbs of ``chmarl-pb homes`` for those who make homes: new, build, export and generate."""

import argparse
import os
import shlex
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

from chmarl_pb.cli.arguments import (
    OutputFile,
    add_catalog,
    add_verb,
    add_workers,
    catalog_of,
    chosen_executor,
    output_folder,
)
from chmarl_pb.cli.output import say
from chmarl_pb.errors import ChmarlError, OptionError
from chmarl_pb.files import check_ending, write_atomically
from chmarl_pb.homes.assemble import build_home
from chmarl_pb.homes.export import export_gltf, export_urdf
from chmarl_pb.homes.generate.names import MOST_SEED
from chmarl_pb.homes.generate.store import check_seed, files_of, generate_home, put_home
from chmarl_pb.homes.home import load_home
from chmarl_pb.homes.layout import SCHEMA, STYLES
from chmarl_pb.limits import whole_number
from chmarl_pb.progress import progress_bar
from chmarl_pb.reading import read_regular
from chmarl_pb.rendering.preview import is_preview, preview

_GLANCE = 0.3  # seconds between two looks at the layout


def add_authoring(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the verbs to a parser."""
    new = add_verb(
        verbs,
        "new",
        "write a layout to begin with, and its schema for editors beside it",
        "chmarl-pb homes new cabin.toml",
    )
    new.set_defaults(run=_new)
    new.add_argument("layout", type=OutputFile(".toml"), metavar="TOML", help="file to write; it must not be there yet")
    new.add_argument(
        "--style", choices=tuple(STYLES), default="starter", help="which layout (default: %(default)s, a small one)"
    )
    build = add_verb(verbs, "build", "build a home's URDF from its layout", "chmarl-pb homes build cabin.toml --watch")
    build.set_defaults(run=_build)
    build.add_argument("layout", type=Path, metavar="TOML", help="layout file")
    add_catalog(build)
    build.add_argument(
        "--out", type=OutputFile(".urdf"), metavar="URDF", help="file to write (default: beside the layout)"
    )
    build.add_argument(
        "--watch", action="store_true", help="build whenever the layout is saved, and draw it as a PNG beside the URDF"
    )
    export = add_verb(
        verbs,
        "export",
        "write a home as plain URDF with its meshes, and as binary glTF",
        "chmarl-pb homes export home_1 --out out/home_1",
    )
    export.set_defaults(run=_export)
    export.add_argument("file", metavar="FILE", help="a home's URDF, or the name of a packaged home")
    export.add_argument("--out", type=output_folder, required=True, metavar="DIR", help="folder to write to")
    generate = add_verb(
        verbs,
        "generate",
        "make up homes from seeds: layout, URDF and picture of each",
        "chmarl-pb homes generate --seed 7 --count 3 --out out/homes",
    )
    generate.set_defaults(run=_generate)
    generate.add_argument("--seed", type=int, required=True, metavar="N", help="which home: a whole number from 0 on")
    generate.add_argument("--count", type=int, default=1, metavar="K", help="homes of K seeds from N on (default: 1)")
    generate.add_argument("--out", type=output_folder, required=True, metavar="DIR", help="folder to write to")
    add_workers(generate)


def _new(options: argparse.Namespace) -> int:
    """Write a layout to begin with, named after its file, and its schema."""
    layout: Path = options.layout
    if layout.exists():
        raise OptionError(f"{layout} is there already; name another file, or remove it")
    schema = layout.with_name(SCHEMA.name)
    kept = os.path.lexists(schema)
    if not kept:
        write_atomically(schema, SCHEMA.read_text(encoding="utf-8"))
    write_atomically(layout, STYLES[options.style].read_text(encoding="utf-8"))
    print(layout)
    if kept and not _is_schema(schema):
        say(f"{schema} is there already and differs from the schema of layouts; it is left as it is")
    say(f"next: chmarl-pb homes build {shlex.quote(str(layout))} --watch")
    return 0


def _is_schema(path: Path) -> bool:
    """Return whether a file is the schema of layouts."""
    with suppress(ValueError):  # it cannot be read
        return read_regular(path) == SCHEMA.read_bytes()
    return False


def _build(options: argparse.Namespace) -> int:
    """Build a home's URDF from its layout, once or whenever the layout is saved."""
    check_ending(options.layout, ".toml")
    if not options.watch:
        print(build_home(options.layout, options.out, catalog_of(options.catalog)))
        return 0
    built: tuple[int, int] | None = None
    while True:
        now = _stamp(options.layout)
        if now != built:
            built = now
            _build_and_draw(options.layout, options.out, options.catalog)
        time.sleep(_GLANCE)


def _stamp(layout: Path) -> tuple[int, int]:
    """Return what changes when a file is saved; zeros while an editor replaces it."""
    try:
        found = layout.stat()
    except FileNotFoundError:
        return 0, 0
    return found.st_mtime_ns, found.st_size


def _build_and_draw(layout: Path, out: Path | None, catalog: str | None) -> None:
    """Build and draw once; a mistake in the layout is printed, and the last home stays."""
    picture = (out or layout).with_suffix(".png")
    try:
        if picture.exists() and picture.stat().st_size and not is_preview(picture):
            raise OptionError(f"{picture} is there already and is no picture of a home; move it away, or use --out")
        home = build_home(layout, out, catalog_of(catalog))
        print(f"{time.strftime('%H:%M:%S')} {home} {preview(home, picture)}", flush=True)
    except ChmarlError as error:
        print(f"{time.strftime('%H:%M:%S')} {error}", file=sys.stderr, flush=True)


def _export(options: argparse.Namespace) -> int:
    """Write a home as URDF and as glTF."""
    home = load_home(options.file)
    print(export_urdf(home, options.out / f"{home.name}.urdf"))
    print(export_gltf(home, options.out / f"{home.name}.glb"))
    return 0


def _generate(options: argparse.Namespace) -> int:
    """Make up homes from seeds."""
    seeds = _seeds(options.seed, options.count)
    with chosen_executor(options) as executor, progress_bar() as bar:
        made = map(_home_files, seeds) if executor.alone else executor.map(_home_files, seeds, ordered=True)
        for files in bar.count(made, len(seeds), "making homes"):
            print(put_home(files, options.out))
    return 0


def _seeds(first: int, count: int) -> range:
    """Return the seeds of the homes to make.

    Raises:
        OptionError: one of them is none, or there are none.
    """
    left = MOST_SEED - check_seed(first)
    if whole_number("count", count, 1) > left:
        raise OptionError(f"count={count}: seeds end at {MOST_SEED - 1:,}; use at most {left:,}")
    return range(first, first + count)


def _home_files(seed: int) -> dict[Path, bytes]:
    """Return the files of a home with its picture, by their paths in its folder; its URDF last."""
    with tempfile.TemporaryDirectory(prefix="chmarl-home-") as name:
        home = generate_home(seed, Path(name))
        preview(home, home.with_suffix(".png"))
        return files_of(home)
