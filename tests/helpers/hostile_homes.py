"""Homes that no program should trip over, and a program that plays them, each in a process of its own.

It reads folders, one a line, and prints one line of JSON for each: how the check and an environment ended.
"""

import json
import os
import re
import resource
import signal
import struct
import sys
import tempfile
import zipfile
import zlib
from collections.abc import Callable
from contextlib import redirect_stdout
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any

from tests.helpers.small_homes import SMALL_HOME, box, home_text

SECONDS = 30  # of processor time for a home: far more than any takes, far less than for ever
BYTES = 8 * 2**30

CUBE = "".join(f"v {x} {y} {z}\n" for x in (0, 0.4) for y in (0, 0.4) for z in (0, 0.4)) + (
    "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"
)
Content = bytes | str | Callable[[Path], object]
Files = dict[str, Content]


def link(inside: str, name: str = "livingroom/box_1") -> str:
    """Return a link, fixed to the world."""
    joint = f'<joint name="to {name}" type="fixed"><parent link="world"/><child link="{name}"/></joint>'
    return f'<link name="{name}">{inside}</link>\n{joint}\n'


def shape(geometry: str, role: str = "visual", origin: str = "1 1 0.5") -> str:
    """Return a <visual> or <collision>."""
    return f'<{role}><origin xyz="{origin}"/><geometry>{geometry}</geometry></{role}>\n'


def with_mesh(name: str, content: Content, role: str = "visual", **others: Content) -> Files:
    """Return a home with one mesh, and other files with ``__`` for a dot in their names."""
    files: Files = {"home.urdf": home_text(extra=link(shape(f'<mesh filename="{name}"/>', role))), name: content}
    return files | {other.replace("__", "."): text for other, text in others.items()}


def png(width: int, height: int, rows: bytes) -> bytes:
    """Return a PNG that says it is of a size."""
    chunks = ((b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)), (b"IDAT", zlib.compress(rows)))
    body = b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in (*chunks, (b"IEND", b""))
    )
    return b"\x89PNG\r\n\x1a\n" + body


_PARAMS = "".join(f'<param name="{axis}" type="float"/>' for axis in "XYZ")
_ACCESSOR = f'<technique_common><accessor source="#a" count="4" stride="3">{_PARAMS}</accessor></technique_common>'
_FACES = '<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/><p>{}</p></triangles>'


def dae(faces: str = "0 1 2 0 1 3 0 2 3 1 2 3", node: str = '<instance_geometry url="#g"/>', **parts: str) -> str:
    """Return a COLLADA file of four triangles; ``parts`` replace other parts of it."""
    text = {
        "asset": '<asset><unit meter="1"/></asset>',
        "library": "",
        "numbers": '<float_array id="a" count="12">0 0 0 .4 0 0 0 .4 0 0 0 .4</float_array>',
        "accessor": _ACCESSOR,
        "scene": '<scene><instance_visual_scene url="#s"/></scene>',
        "primitive": _FACES.format(faces),
    } | parts
    return (
        f'<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema">{text["asset"]}{text["library"]}'
        f'<library_geometries><geometry id="g"><mesh><source id="p">{text["numbers"]}{text["accessor"]}</source>'
        f'<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>{text["primitive"]}</mesh></geometry>'
        f'</library_geometries><library_visual_scenes><visual_scene id="s"><node>{node}</node></visual_scene>'
        f"</library_visual_scenes>{text['scene']}</COLLADA>"
    )


def stl(says: int, has: int = 4) -> bytes:
    """Return a binary STL file of a tetrahedron's sides."""
    corners = [(0, 0, 0), (0.4, 0, 0), (0, 0.4, 0), (0, 0, 0.4)]
    sides = [[corner for number, corner in enumerate(corners) if number != left] for left in range(4)]
    rows = b"".join(struct.pack("<12fH", 0, 0, 1, *sum(side, ()), 0) for side in sides)
    return bytes(80) + struct.pack("<I", says) + rows[: 50 * has]


def ascii_stl() -> str:
    """Return the same as text."""
    vertex = "vertex 0 0 0\nvertex {} 0\nvertex 0 {}\n"
    vertices = [vertex.format("0.4 0", "0.4 0"), vertex.format("0.4 0", "0 0.4"), vertex.format("0 0.4", "0 0.4")]
    facets = "".join(f"facet normal 0 0 1\nouter loop\n{three}endloop\nendfacet\n" for three in vertices)
    return f"solid a\n{facets}endsolid a\n"


def zipped(name: str, content: bytes) -> bytes:
    """Return a zip archive with one file."""
    archive = BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr(name, content)
    return archive.getvalue()


def sparse(path: Path) -> None:
    """Make a file of 50 GB that takes no space."""
    with path.open("wb") as file:
        file.truncate(50 * 2**30)


def to(target: str) -> Callable[[Path], object]:
    """Return what makes a link to a file."""
    return lambda path: path.symlink_to(target)


def chain(count: int) -> str:
    """Return links that hang on one another."""
    names = ["world", *(f"frame_{number}" for number in range(count))]
    return "".join(
        f'<link name="{name}"/>\n<joint name="to {name}" type="fixed"><parent link="{parent}"/><child link="{name}"/>'
        "</joint>\n"
        for parent, name in pairwise(names)
    )


def _meshes() -> dict[str, Files]:
    objs: dict[str, Content] = {
        "index out of range": CUBE + "f 1 2 9\n",
        "index far out of range": CUBE + "f 1 2 2147483647\n",
        "negative index out of range": CUBE + "f -1 -2 -2147483648\n",
        "index 0": CUBE + "f 0 1 2\n",
        "normal out of range": CUBE + "vn 0 0 1\nf 1//1 2//1 3//1431655766\n",
        "no vertices": "f 1 2 3\nf 1 2 4\n",
        "faces alone": "vn 0 0 1\nf 1//1 2//1 3//1\n",
        "not a number": CUBE.replace("v 0 0 0", "v nan 0 0"),
        "beyond single precision": CUBE.replace("v 0 0 0", "v 1e300 0 0"),
        "two corners": CUBE + "f 1 2\n",
        "null characters": "\0" * 200,
        "a zip archive": zipped("mesh.obj", CUBE.encode()),
    }
    one = '<triangles count="1"><input semantic="VERTEX" source="#v" offset="{}"/><p>0 1 2</p></triangles>'
    doubling = "".join(f'<node id="n{n}">' + f'<instance_node url="#n{n + 1}"/>' * 2 + "</node>" for n in range(40))
    collada: dict[str, Content] = {
        "unit without metres": dae(asset="<asset><unit/></asset>", numbers=""),
        "no numbers": dae(numbers=""),
        "no accessor": dae(accessor=""),
        "index out of range": dae("0 1 99999999"),
        "negative index": dae("0 1 -900"),
        "no corners": dae(""),
        "offset out of range": dae(primitive=one.format(99999999)),
        "no primitive": dae(primitive=""),
        "no scene": dae(scene=""),
        "no such geometry": dae(node='<instance_geometry url="#x"/>'),
        "empty matrix": dae(node='<matrix/><instance_geometry url="#g"/>'),
        "nodes that double": dae(
            library=f'<library_nodes>{doubling}<node id="n40"/></library_nodes>', node='<instance_node url="#n0"/>'
        ),
        "entities": '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">]>' + dae(),
        "another root": "<robot name='x'/>",
        "nothing": "",
        "a zip archive": zipped("mesh.dae", b"<COLLADA>" + b" " * 100_000_000),
    }
    stls: dict[str, Content] = {
        "more triangles than there are": stl(400),
        "so many that 32 bits overflow": stl(85899346),
        "cut": stl(4)[:-7],
        "none": stl(0, 0),
        "ASCII, cut": ascii_stl()[:-20],
        "300,000 triangles": bytes(80) + struct.pack("<I", 300_000) + bytes(15_000_000),
    }
    homes: dict[str, Files] = {}
    for role in ("visual", "collision"):
        for ending, contents in (("obj", objs), ("dae", collada), ("stl", stls)):
            homes |= {f"{ending}, {n} ({role})": with_mesh(f"mesh.{ending}", c, role) for n, c in contents.items()}
    return homes | {
        "500,000 vertices": with_mesh("mesh.obj", "v 0 0 0\n" * 500_000 + CUBE),
        "500,000 faces": with_mesh("mesh.obj", CUBE + "f 1 2 3\n" * 500_000, "collision"),
    }


def _materials() -> dict[str, Files]:
    def mesh(line: str) -> str:
        return f"{line}\nusemtl m\n{CUBE}"

    def texture(content: Content) -> Files:
        return with_mesh("mesh.obj", mesh("mtllib a.mtl"), a__mtl="newmtl m\nmap_Kd t.png\n", t__png=content)

    lines = {
        "a tab before a name outside": "mtllib\t../../etc/passwd",
        "two names, one outside": "mtllib mesh.obj ../../etc/passwd",
        "an absolute name": "mtllib /etc/passwd",
        "no name": "mtllib ",
        "a folder": "mtllib .",
        "a null character": "mtllib a\0b",
        "an endless name": "mtllib " + "x" * 5000,
        "a missing file": "mtllib none.mtl",
    }
    homes = {f"materials, {name}": with_mesh("mesh.obj", mesh(line)) for name, line in lines.items()}
    files: dict[str, Content] = {
        "a pipe": os.mkfifo,
        "a device": to("/dev/zero"),
        "a folder that is called so": Path.mkdir,
        "a loop": to("a.mtl"),
        "too much": "newmtl m\n" * 200_000,
        "a texture with options": "newmtl m\nmap_Kd -o 1 1 1 t.png\n",
        "a texture outside, after a tab": "newmtl m\nmap_Kd\t../../secret.png\n",
    }
    homes |= {f"materials, {n}": with_mesh("mesh.obj", mesh("mtllib a.mtl"), a__mtl=c) for n, c in files.items()}
    pictures: dict[str, Content] = {
        "a pipe": os.mkfifo,
        "a folder": Path.mkdir,
        "a device": to("/dev/zero"),
        "no picture": b"hello",
        "nothing": b"",
        "50,000 x 50,000": png(50_000, 50_000, b"\0"),
        "3,000 x 3,000": png(3000, 3000, bytes(9001 * 3000)),
    }
    return homes | {f"texture, {name}": texture(content) for name, content in pictures.items()}


def _files() -> dict[str, Files]:
    odd: dict[str, Content] = {
        "a pipe": os.mkfifo,
        "a folder": Path.mkdir,
        "a device": to("/dev/zero"),
        "50 GB": sparse,
        "a link out of the folder": to("/etc/passwd"),
    }
    meshes = {**odd, "a loop": to("mesh.obj"), "a missing one": to("none.obj")}
    homes = {f"mesh file, {name}": with_mesh("mesh.obj", content) for name, content in meshes.items()}
    homes |= {f"ending {end}": with_mesh(f"mesh.{end}", CUBE) for end in ("3mf", "zae", "glb", "vtk", "cdf", "zip")}
    urdfs = {**odd, "a loop": to("home.urdf")}
    return homes | {f"URDF, {name}": {"home.urdf": content} for name, content in urdfs.items()}


def _urdfs() -> dict[str, Files]:
    text = home_text()
    floor = box("livingroom/floor_1", *SMALL_HOME["livingroom/floor_1"])
    sliver = (
        '<collision><origin xyz="{} 0 1" rpy="0 0 0.785"/><geometry><box size="20 0.001 2"/></geometry></collision>'
    )
    slivers = "".join(link(sliver.format(n * 0.03 - 9), f"livingroom/wall_{n}") for n in range(590))
    white = '</geometry><material name="m"><color rgba="1e38 0 0 1"/></material></visual>'

    def with_floor(size: str, extra: str = "") -> str:
        return home_text(extra=extra).replace(floor, floor.replace("4 4 0.1", size))

    def with_shape(geometry: str, origin: str = "1 1 0.5", count: int = 1) -> str:
        return home_text(extra=link(shape(geometry, origin=origin) * count))

    texts = {
        "two joints of one name": text.replace("to_livingroom/sofa_1", "to_livingroom/desk_1"),
        "4,000 links": home_text(extra="".join(f'<link name="frame_{n}"/>\n' for n in range(4000))),
        "4,000 things": home_text({f"livingroom/lamp_{n}": ((0.01,) * 3, (1, 1, 0.1)) for n in range(4000)}),
        "a chain of 5,000 links": home_text(extra=chain(5000)),
        "an unknown encoding": text.replace('"1.0"?', '"1.0" encoding="zlib"?'),
        "an endless name": home_text(extra='<link name="' + ("x" * 900 + "\n") * 3000 + '"/>'),
        "nested without end": home_text(extra="<a>\n" * 300_000 + "</a>\n" * 300_000),
        "8 MB": text.replace("</robot>", "\n" * 2**23 + "</robot>"),
        "6,000 visuals": with_shape('<box size="0.1 0.1 0.1"/>', count=6000),
        "a visual far away": with_shape('<box size="1 1 1"/>', "1e300 0 0"),
        "a visual of no size": with_shape('<box size="1e-320 1 1"/>'),
        "a visual without geometry": home_text(extra=link("<visual/>")),
        "a colour beyond white": text.replace("</geometry></visual>", white, 1),
        "a floor of 60 m": with_floor("60 60 0.1"),
        "a floor of 10 km": with_floor("10000 10000 0.1"),
        "floors far apart": home_text(extra=box("livingroom/floor_2", (4, 4, 0.1), (1e6, 0, -0.05))),
        "a desk of 18 m": with_floor("19 19 0.1").replace("1.2 0.6 0.75", "18 18 0.75"),
        "a room full of slivers": with_floor("19 19 0.1", slivers),
    }
    return {name: {"home.urdf": text} for name, text in texts.items()}


def _playable() -> dict[str, Files]:
    """Return homes that look odd and are good."""
    text = home_text()
    ignored = "<bullet><user-data/></bullet><sensor/><deformable/><gazebo><plugin/></gazebo><transmission/>"
    desk = re.search(r'<joint name="to_livingroom/desk_1".*?</joint>\n', text)
    assert desk
    rooted = text.replace('<link name="world"/>\n', "").replace(desk[0], "")
    material, picture = "newmtl m\nmap_Kd t.png\n", png(2, 2, bytes(14))
    return {
        "elements that PyBullet stumbles over": {"home.urdf": home_text(extra=ignored)},
        "furniture as the root": {"home.urdf": rooted.replace('link="world"', 'link="livingroom/desk_1"')},
        "a chain of 1,900 links": {"home.urdf": home_text(extra=chain(1900))},
        "odd names": {"home.urdf": home_text(extra=chain(1).replace("frame_0", "%s%n \u00e9"))},
        "COLLADA": with_mesh("mesh.dae", dae(), "collision"),
        "COLLADA that says little of itself": with_mesh("mesh.dae", dae(asset="")),
        "ASCII STL": with_mesh("mesh.STL", ascii_stl(), "collision"),
        "STL": with_mesh("mesh.stl", stl(4)),
        "a texture": with_mesh("mesh.OBJ", f"mtllib a.mtl\nusemtl m\n{CUBE}", a__mtl=material, t__png=picture),
        "materials that name themselves": with_mesh("mesh.obj", f"mtllib a.mtl\n{CUBE}", a__mtl="mtllib a.mtl\n"),
    }


GROUPS = {"meshes": _meshes, "materials": _materials, "files": _files, "urdfs": _urdfs, "playable": _playable}


def write(folder: Path, files: Files) -> None:
    """Write the files of a home."""
    folder.mkdir()
    for name, content in files.items():
        if callable(content):
            content(folder / name)
        else:
            (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())


def check(urdf: Path) -> int:
    """Return the exit code of the check."""
    from chmarl_pb.cli import main

    return main(["homes", "check", str(urdf)])


def play(urdf: Path) -> int:
    """Play one step in a home, seen by cameras; 2 if it is refused."""
    import chmarl_pb
    from chmarl_pb.errors import ChmarlError

    try:
        env = chmarl_pb.parallel_env(observation="visual", home=str(urdf), image_size=32)
        env.reset(seed=0)
    except ChmarlError as error:
        print(error, file=sys.stderr)
        return 2
    env.step(dict.fromkeys(env.agents, 0))
    env.close()
    return 0


def apart(job: Callable[[Path], int], urdf: Path) -> dict[str, Any]:
    """Do a job in a process of its own; return its exit code, negative for a signal, and what it complained of."""
    with tempfile.TemporaryFile() as complaints:
        child = os.fork()
        if child == 0:
            code = 99
            try:
                resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
                resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
                signal.alarm(4 * SECONDS)  # for one that only waits
                os.dup2(complaints.fileno(), 2)
                os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
                code = job(urdf)
                sys.stderr.flush()
            finally:
                os._exit(code)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        complaints.seek(0)
        return {"code": code, "says": complaints.read(4000).decode(errors="replace")}


def warm_up() -> None:
    """Check and play a good home, so that what the processes need is loaded before they fork."""
    with tempfile.TemporaryDirectory() as folder, redirect_stdout(sys.stderr):
        urdf = Path(folder) / "home.urdf"
        urdf.write_text(home_text(), encoding="utf-8")
        if check(urdf) or play(urdf):
            raise SystemExit("a good home is refused")


if __name__ == "__main__":
    warm_up()
    for name in map(str.strip, sys.stdin):
        urdf = Path(name) / "home.urdf"
        print(json.dumps({"home": name, "check": apart(check, urdf), "play": apart(play, urdf)}), flush=True)
