"""A table with chairs, and a rug under it."""

from chmarl_pb.homes.generate.groups import Group, Piece, at_wall, extent, group
from chmarl_pb.homes.generate.site import Site

_CHAIR = "chair_dining"
_TUCK = 2  # that a chair's front stands under the table


def dining(site: Site, rug: bool = False) -> bool:
    """Put a table with chairs into a room; with its back to a wall where the middle is too small."""
    draws = site.draws
    model = draws.one_of(("kitchen_table_rect", "kitchen_table_round", "kitchen_table_square"))
    for table in (model, "kitchen_table_round", "kitchen_table_square"):
        if site.in_middle(_free(site, table, rug), "any"):
            return True
    return any(site.against_wall(_at_wall(table)) for table in ("kitchen_table_rect", "kitchen_table_square"))


def _free(site: Site, table: str, rug: bool) -> Group:
    """Return a table with chairs on two, three or four sides; a robot reaches it between them."""
    size = extent(table)
    away = size.x1 + extent(_CHAIR).x1 - _TUCK
    across = size.y1 + extent(_CHAIR).x1 - _TUCK
    if table == "kitchen_table_rect":
        both = [Piece(_CHAIR, side * 37, front * away, turn) for side in (-1, 1) for front, turn in ((1, 180), (-1, 0))]
        ends = [Piece(_CHAIR, across, 0, 270), Piece(_CHAIR, -across, 0, 90)]
        chairs = site.draws.one_of((both, both[:3], [both[0], both[2], ends[0]], [both[0], both[3]]))
    else:
        four = [Piece(_CHAIR, 0, away, 180), Piece(_CHAIR, 0, -away, 0), Piece(_CHAIR, across, 0, 270)]
        chairs = site.draws.one_of((four[:2], four, four))
    under = (Piece("rug_round" if table != "kitchen_table_rect" else "rug_rect"),) if rug else ()
    return group(*under, Piece(table), *chairs, margin=62)


def _at_wall(table: str) -> Group:
    """Return a table against a wall, with a chair at each of two sides."""
    board = at_wall(table)
    across = extent(table).y1 + extent(_CHAIR).x1 - _TUCK
    chairs = [Piece(_CHAIR, across, board.v, 270), Piece(_CHAIR, -across, board.v, 90)]
    return group(board, *chairs, keep=[board.front(75)])
