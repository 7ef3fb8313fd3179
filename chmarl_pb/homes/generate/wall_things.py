"""What hangs on walls: windows on outer ones, radiators under them, pictures and mirrors where a wall is free."""

from chmarl_pb.homes.generate.groups import Group, Piece, at_wall, extent, group
from chmarl_pb.homes.generate.site import Site

_PICTURES = ("picture_abstract", "picture_landscape", "picture_portrait")
#: Kind of room -> models of windows, the height of their sill, how many there are at most.
_WINDOWS = {
    "livingroom": (("window_wide", "window_tall"), 95, 2),
    "bedroom": (("window_wide", "window_tall"), 95, 2),
    "kitchen": (("window_wide",), 120, 1),
    "bathroom": (("window_tall",), 110, 1),
    "hallway": (("window_tall",), 100, 1),
}
_OVER = ("sofa", "bed", "cabinet", "dresser", "piano", "desk", "bench", "bookshelf", "shoe_rack")
_EYES = 135  # height of the lower edge of pictures


def windows(site: Site) -> int:
    """Put in windows, the first in the middle of an outer wall; return how many."""
    models, sill, most = _WINDOWS[site.kind]
    outer, count = [wall for wall in site.walls if wall.outer], 0
    for wall in outer:
        if count < most:
            model = site.draws.one_of(models)
            count += site.against_wall(_window(model, sill), "middle", [wall])
    if not count and outer:
        count += site.against_wall(_window("window_tall", sill + 15), "any", outer)
    return count


def pictures(site: Site, most: int) -> None:
    """Hang pictures over furniture, then on free walls."""
    places = [
        (part, pose) for part, pose in site.parts if part.thing_class in _OVER and part.top < _EYES + 10 and not part.z
    ]
    for part, pose in site.draws.shuffled(places):
        behind = part.area[1] < 10 and part.turn == 0
        if most and behind and site.draws.chance(55):
            model = site.draws.one_of(_PICTURES)
            most -= site.at(group(at_wall(model, part.u, z=max(_EYES, part.top + 15))), pose)
    if most and site.draws.chance(30):
        site.against_wall(group(at_wall(site.draws.one_of(_PICTURES), z=_EYES)), "middle")


def radiator(site: Site) -> None:
    """Put a radiator under a window."""
    for part, pose in list(site.parts):
        if part.thing_class == "window" and site.at(group(at_wall("radiator_white", part.u, z=12)), pose):
            return


def _window(model: str, sill: int) -> Group:
    return group(Piece(model, 0, -extent(model).x0, 0, sill))
