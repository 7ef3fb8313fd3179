"""Bathrooms: a counter under a mirror, a toilet, a bathtub or a shower, and a towel rack."""

from chmarl_pb.homes.generate.extras import Extra, put_alone, put_extras
from chmarl_pb.homes.generate.groups import Piece, at_wall, extent, group
from chmarl_pb.homes.generate.site import Site

_MIRROR, _CABINET = 105, 125  # heights over a counter
_MAY = (
    Extra(80, ("washing_machine_front",)),
    Extra(55, ("laundry_basket_round",), gap=4),
    Extra(15, ("stool_wood", "plant_tall"), gap=4),
)
_LARGE = 850  # square decimetres


def bathroom(site: Site) -> bool:
    """Put in what a bathroom must have; tell whether it fits."""
    tub = site.draws.one_of(("bathtub_plain", "shower_glass"))
    racks = site.draws.shuffled(("towel_rack_ladder", "towel_rack_shelf"))
    return (
        any(put_alone(site, model, "corner") for model in (tub, "shower_glass"))
        and _counter(site)
        and put_alone(site, "toilet_white")
        and any(put_alone(site, model) for model in racks)
    )


def more(site: Site) -> None:
    """Put in what a bathroom may have."""
    if site.draws.chance(75):
        _rug(site)
    if site.area > _LARGE and site.draws.chance(40):
        put_alone(site, "shower_glass" if site.count("bathtub") else "bathtub_plain", "corner")
    put_extras(site, _MAY)


def _counter(site: Site) -> bool:
    models = site.draws.shuffled(("bathroom_counter_single", "bathroom_counter_double"))
    over = at_wall("mirror_wall", z=_MIRROR) if site.draws.chance(80) else at_wall("wall_cabinet_bath", z=_CABINET)
    return any(site.against_wall(group(at_wall(model), over)) for model in (*models, "bathroom_counter_single"))


def _rug(site: Site) -> bool:
    """Lay a mat before the bathtub, the shower or the counter."""
    for wanted in ("bathtub", "shower", "bathroom_counter"):
        for part, pose in site.parts:
            if part.thing_class == wanted:
                return site.at(group(Piece("rug_bath", part.u, part.area[3] + extent("rug_bath").x1 + 4)), pose)
    return False
