"""Living rooms: the sofa faces the television over a coffee table; shelves, seats and lamps round them."""

from chmarl_pb.homes.generate.desks import desk
from chmarl_pb.homes.generate.extras import Extra, put_extras
from chmarl_pb.homes.generate.groups import Group, Piece, at_wall, extent, group
from chmarl_pb.homes.generate.site import Site

_SOFAS = ("sofa_two", "sofa_three", "sofa_chaise")
_TABLES = ("coffee_table_rect", "coffee_table_round")
_STANDS = ("tv_stand_low", "tv_stand_wide")
_WAY = 85  # between the coffee table and the television
_KNEES = 60  # between the coffee table and the sofa
_CHAISE = 55  # that the seat of a sofa with a chaise lies behind its front
_ASIDE = 32  # that the coffee table then stands off the middle
_TOO_FAR = 470  # from the wall of the television to the sofa's back
_IN_MIDDLE = (440, 400, 370, 350)  # the same for sofas with their back to nothing
_MAY = (
    Extra(75, ("bookshelf_tall", "bookshelf_low")),
    Extra(75, ("cabinet_sideboard",), "any"),
    Extra(25, ("fireplace_stone",), "middle"),
    Extra(45, ("bench_wood", "bench_upholstered"), "any"),
    Extra(45, ("chair_armchair",), gap=5),
    Extra(70, ("plant_tall",), gap=5),
    Extra(60, ("floor_lamp_arc", "floor_lamp_shade"), gap=5),
)


def livingroom(site: Site) -> bool:
    """Put in what a living room must have; tell whether it fits."""
    draws = site.draws
    stand, table = draws.one_of(_STANDS), draws.one_of(_TABLES)
    depths = sorted({side - 10 for box in site.boxes for side in (box[2] - box[0], box[3] - box[1])})
    for sofa in (*draws.shuffled(_SOFAS), "sofa_two"):
        # First with the sofa's back to the wall opposite, then in the middle of the room.
        for far in (*(depth for depth in depths if depth < _TOO_FAR), *_IN_MIDDLE):
            lounge = _lounge(site, stand, table, sofa, far)
            if lounge and site.against_wall(lounge):
                return True
    return False


def more(site: Site) -> None:
    """Put in what a living room may have."""
    if site.draws.chance(50):
        desk(site)
    if site.draws.chance(30):
        _piano(site)
    put_extras(site, _MAY)


def _lounge(site: Site, stand: str, table: str, sofa: str, far: int) -> Group | None:
    """Return television, coffee table and sofa in a line, the sofa's back so far from the wall; None if too near."""
    chaise = sofa == "sofa_chaise"
    front = far - (extent(sofa).x1 - extent(sofa).x0) + _CHAISE * chaise
    at, aside = front - _KNEES - extent(table).x1, _ASIDE * chaise
    board = at_wall(stand)
    if at - extent(table).x1 < board.area[3] + _WAY:
        return None
    screen = at_wall("tv_flat", z=extent(stand).height, gap=4)
    parts = [board, screen, Piece(table, aside, at), Piece(sofa, 0, far + extent(sofa).x0, 180)]
    if site.draws.chance(85):
        parts.append(Piece("rug_round" if table == "coffee_table_round" else "rug_rect", aside, at))
    if site.draws.chance(45):
        side = site.draws.one_of((-1, 1))
        parts.append(Piece("chair_armchair", side * 165, at, -90 * side))
    return group(*parts)


def _piano(site: Site) -> bool:
    piano = at_wall("piano_upright")
    return site.against_wall(group(piano, Piece("stool_wood", 0, piano.area[3] + 25)))
