"""Single pieces of furniture that a room may have: each with its likelihood, models and place."""

from collections.abc import Sequence
from typing import NamedTuple

from chmarl_pb.homes.generate.groups import at_wall, group
from chmarl_pb.homes.generate.site import Site


class Extra(NamedTuple):
    """A piece that a room may have.

    Attributes:
        likelihood: in per cent.
        models: of which one is taken.
        prefer: where along the walls it stands: see :func:`chmarl_pb.homes.generate.spots.along_walls`.
        gap: centimetres between its back and the wall.
    """

    likelihood: int
    models: tuple[str, ...]
    prefer: str = "corner"
    gap: int = 0


def put_extras(site: Site, extras: Sequence[Extra]) -> None:
    """Put in those that the draws want and that find a place."""
    for extra in site.draws.shuffled(extras):
        if site.draws.chance(extra.likelihood):
            put_alone(site, site.draws.one_of(extra.models), extra.prefer, extra.gap)


def put_alone(site: Site, model: str, prefer: str = "any", gap: int = 0) -> bool:
    """Put one piece against a wall, and tell whether there was a place."""
    return site.against_wall(group(at_wall(model, gap=gap)), prefer)
