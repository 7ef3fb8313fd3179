"""Larger worlds than the benchmark has: more objects in a home, and homes of many rooms.

Both change the running process, and must be called before an environment is made.
"""

from dataclasses import replace
from math import hypot
from pathlib import Path

from chmarl_pb import catalog
from chmarl_pb.assets import SCENES_DIR
from chmarl_pb.homes.assemble import write_home
from chmarl_pb.homes.layout import Door, Furniture, Layout, Room, load_layout
from chmarl_pb.navigation import check

_DOOR_CLEARANCE = 1.4  # metres round the middle of a new door that are kept free of furniture


def dress_homes(objects: int, known: int = 100) -> None:
    """Let every task lay out a number of objects, and give scene graphs room for as many.

    The catalogue gets a row, with the URDF of another class, for each class above its own 45, as for any new object.

    Args:
        objects: how many lie in the home, the one of the task among them.
        known: how many classes the catalogue is to have, whatever the number of objects laid out.
    """
    _add_classes(known)
    from chmarl_pb.sensing import scene_graph
    from chmarl_pb.tasks import setting

    scene_graph.MAX_NODES, scene_graph.MAX_EDGES = 2 * scene_graph.MAX_NODES, 4 * scene_graph.MAX_EDGES
    setting.DISTRACTORS = objects - 1


def _add_classes(count: int) -> None:
    originals, urdf_of = list(catalog.BENCHMARK.graspables.values()), catalog.graspable_urdf
    more = []
    for number in range(len(originals), count):
        original = originals[number % len(originals)]
        more.append(replace(original, name=f"{original.name}_{'x' * (number // len(originals))}"))
    larger = vars(catalog.BENCHMARK.extended(more, catalog.BENCHMARK.content))
    vars(catalog.BENCHMARK).clear()
    vars(catalog.BENCHMARK).update(larger)
    catalog.graspable_urdf = lambda name: urdf_of(name.rstrip("x").rstrip("_") if "_x" in name else name)


def row_of_homes(copies: int, folder: Path) -> Path:
    """Build home 7 several times in a row, joined by doors, and lift the limits on rooms and things of a home.

    Args:
        copies: how many.
        folder: where to write the URDF and its meshes.

    Returns:
        The URDF.
    """
    check.MOST_ROOMS = check.MOST_THINGS = 10_000
    home = load_layout(SCENES_DIR / "home_7.toml")
    length = max(rect[2] for room in home.rooms for rect in room.rects)
    parts = [_shifted(home, number, length) for number in range(copies)]
    doors = [
        Door((_suffixed("bedroom", east - 1), _suffixed("livingroom", east)), (length * east, 2.75), 1.0)
        for east in range(1, copies)
    ]
    layout = Layout(
        f"home_7_times_{copies}", home.wall_height, home.wall_thickness,
        rooms=tuple(room for part in parts for room in part.rooms),
        doors=tuple(door for part in parts for door in part.doors) + tuple(doors),
        furniture=tuple(piece for part in parts for piece in part.furniture if not _blocks(piece, doors)),
    )  # fmt: skip
    return write_home(layout, folder / f"{layout.name}.urdf")


def _shifted(home: Layout, number: int, length: float) -> Layout:
    """Return a copy of a home that lies to the east by its own length times a number, its rooms renamed."""
    east = number * length

    def rooms(room: Room) -> Room:
        rects = tuple((x0 + east, y0, x1 + east, y1) for x0, y0, x1, y1 in room.rects)
        return replace(room, name=_suffixed(room.name, number), rects=rects)

    def doors(door: Door) -> Door:
        (one, two), (x, y) = door.between, door.position
        return replace(door, between=(_suffixed(one, number), _suffixed(two, number)), position=(x + east, y))

    def furniture(piece: Furniture) -> Furniture:
        x, y, z = piece.position
        return replace(piece, room=_suffixed(piece.room, number), position=(x + east, y, z))

    return replace(
        home,
        rooms=tuple(map(rooms, home.rooms)),
        doors=tuple(map(doors, home.doors)),
        furniture=tuple(map(furniture, home.furniture)),
    )


def _suffixed(room: str, number: int) -> str:
    return room if number == 0 else f"{room}_{number + 1}"


def _blocks(piece: Furniture, doors: list[Door]) -> bool:
    x, y, _ = piece.position
    return any(hypot(x - door.position[0], y - door.position[1]) < _DOOR_CLEARANCE for door in doors)
