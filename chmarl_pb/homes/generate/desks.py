"""A desk with its chair, for any room."""

from chmarl_pb.homes.generate.groups import Piece, at_wall, extent, group
from chmarl_pb.homes.generate.site import Site

_LEG_ROOM = 4  # that a chair's front stands under the desk


def desk(site: Site) -> bool:
    """Put a desk with a chair before it against a wall."""
    model = site.draws.one_of(("desk_plain", "desk_drawers"))
    board = at_wall(model)
    chair = site.draws.one_of(("chair_office", "chair_office", "chair_dining"))
    seat = Piece(chair, site.draws.one_of((28, 0, -28)), board.area[3] + extent(chair).x1 - _LEG_ROOM, 180)
    lamp = [at_wall("table_lamp_shade", 45, z=extent(model).height, gap=6)] if site.draws.chance(50) else []
    return site.against_wall(group(board, seat, *lamp))
