"""Write a layout as the file that :func:`chmarl_pb.homes.layout.load_layout` reads back as the same layout."""

from collections.abc import Sequence

from chmarl_pb.homes.layout import Furniture, Layout, Room
from chmarl_pb.homes.layout_file import Colour


def layout_text(layout: Layout) -> str:
    """Return a layout as TOML."""
    rooms = [_table(_room(room)) for room in layout.rooms]
    doors = [
        _table({"between": list(door.between), "position": list(door.position), "width": door.width})
        for door in layout.doors
    ]
    head = [
        f'name = "{layout.name}"',
        f"wall_height = {layout.wall_height}",
        f"wall_thickness = {layout.wall_thickness}",
    ]
    head += [] if layout.object_looks is None else [f"object_looks = {layout.object_looks}"]
    furniture = []
    for room in layout.rooms:
        things = [_table(_furniture(thing)) for thing in layout.furniture if thing.room == room.name]
        furniture += [f"# {room.name}", *things] if things else []
    lists = [_list("room", rooms), _list("door", doors), _list("furniture", furniture)]
    return "\n".join([*head, *lists]) + "\n"


def _room(room: Room) -> dict[str, object]:
    return {
        "name": room.name,
        "rects": [list(rect) for rect in room.rects],
        "floor": _hex(room.floor),
        "wall": _hex(room.wall),
    }


def _furniture(thing: Furniture) -> dict[str, object]:
    x, y, z = thing.position
    values: dict[str, object] = {"room": thing.room, "model": thing.model, "position": [x, y], "yaw": thing.yaw}
    values |= {"z": z} if z else {}
    colours = {"color": thing.color, "secondary": thing.secondary}
    return values | {key: _hex(colour) for key, colour in colours.items() if colour}


def _hex(colour: Colour) -> str:
    return "#" + "".join(f"{round(255 * channel):02x}" for channel in colour)


def _table(values: dict[str, object]) -> str:
    """Return an inline table; lists and numbers are written alike in Python and TOML."""
    return "{ " + ", ".join(f"{key} = {_value(value)}" for key, value in values.items()) + " },"


def _value(value: object) -> str:
    return (
        str(value).replace("'", '"')
        if isinstance(value, list)
        else f'"{value}"'
        if isinstance(value, str)
        else str(value)
    )


def _list(name: str, rows: Sequence[str]) -> str:
    return "\n".join([f"{name} = [", *(f"    {row}" for row in rows), "]"])
