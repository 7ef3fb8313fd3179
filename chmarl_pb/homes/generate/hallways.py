"""Hallways: narrow things along the walls, none of which it must have."""

from chmarl_pb.homes.generate.extras import Extra, put_extras
from chmarl_pb.homes.generate.site import Site

_MAY = (
    Extra(65, ("shoe_rack_wood",)),
    Extra(55, ("coat_rack_pole",), gap=3),
    Extra(45, ("bench_wood", "bench_upholstered")),
    Extra(40, ("plant_tall",), gap=3),
    Extra(25, ("cabinet_low",)),
    Extra(25, ("mirror_standing",)),
)


def hallway(site: Site) -> bool:
    """Put in what a hallway must have, which is nothing."""
    return True


def more(site: Site) -> None:
    """Put in what a hallway may have."""
    put_extras(site, _MAY)
