"""Colours of a home: one palette for its floors, walls and furniture, drawn once. As ``#rrggbb``."""

from dataclasses import dataclass

from chmarl_pb.catalog import room_kind
from chmarl_pb.homes.generate.draws import Draws

Pair = tuple[str | None, str | None]
"""The colours ``primary`` and ``secondary`` of a model; None: its own."""

_WOODS = (
    "#c59a68", "#6b4a33", "#dcb982", "#8a4a32", "#4a3022", "#d9b27c", "#a9764a", "#efe6d6", "#2f2a28", "#b9875a",
    "#e3cca6", "#7b5a40",
)  # fmt: skip
_CLOTHS = (
    "#2f7f80", "#c98f84", "#3f4d5c", "#7d9a6a", "#a9543a", "#c8963e", "#3e5b46", "#8fb0c8", "#d0705a", "#6a5a8c",
    "#d1a13a", "#1f5563", "#9b9a97", "#e0d6c3", "#5c2e3a", "#4d6f91", "#b7c2a4", "#d8a7a0", "#37474f", "#8b6f5c",
)  # fmt: skip
_FRONTS = (
    "#f4f2ee", "#e6e2d8", "#7d9a6a", "#3f4d5c", "#c46a45", "#a9cbb7", "#31525b", "#d8c7a9", "#b7c0c4", "#5b6b55",
    "#8fb0c8", "#2f3437",
)  # fmt: skip
_TOPS = (
    "#3a3c40", "#bd8f5c", "#e9e6df", "#8c8780", "#6b4a33", "#cfc8bb",
)  # fmt: skip
_METALS = (
    "#f2f0eb", "#bdc2c7", "#3a3c40", "#c3c8cb", "#e8e4da", "#2f2a28", "#9fb8ad", "#b2564a",
)  # fmt: skip
_WHITES = (
    "#f7f7f5", "#f2f0eb", "#e9edf0", "#f3e9dd",
)  # fmt: skip
_BOARDS = (
    "#b98d5e", "#8d6a4a", "#7c5a40", "#c9a574", "#a57c52", "#d3b48a", "#6d5039", "#b29a7d", "#94836d",
)  # fmt: skip
_TILES = (
    "#a9a49c", "#b9b3a8", "#c7c2b8", "#d9d4ca", "#98918a", "#e0dcd3", "#b4bcbc", "#c9b7a3", "#8f979b", "#cdd3cf",
)  # fmt: skip
_PAINTS = (
    "#e6ecdf", "#f0e9da", "#eadad5", "#dfe5d6", "#f3ecdd", "#efe3d0", "#e7dfec", "#ece7df", "#f3d9c3", "#dfe8ee",
    "#f1efe6", "#e4dcc9", "#d9e3dc", "#f0dfd8", "#e9e4f0", "#e3e7e8",
)  # fmt: skip
_WET = (
    "#d3e2ea", "#cfe3df", "#bfd8cd", "#dce6e8", "#e8e2d6", "#c9dbe4", "#e3ebe0",
)  # fmt: skip

_CONTRAST = 110  # between floor and furniture, summed over the three channels

_CASES = ("bookshelf", "cabinet", "desk", "dresser", "nightstand", "wardrobe", "tv_stand", "shoe_rack", "wall_cabinet")
_TABLES = ("kitchen_table", "coffee_table", "stool")
_SEATS = ("sofa", "bench", "chair")


@dataclass(frozen=True)
class Looks:
    """The colours of a home.

    Attributes:
        wood: of most furniture, then of some.
        cloth: of most that is soft, then of some.
        front: of the doors of kitchen and bathroom.
        top: of worktops.
        metal: of appliances.
        boards: floor of rooms that are not wet.
        tiles: floor of kitchens, then of bathrooms.
        paint: of each room's walls.
    """

    wood: tuple[str, str]
    cloth: tuple[str, str, str]
    front: str
    top: str
    metal: str
    boards: str
    tiles: tuple[str, str]
    paint: dict[str, str]

    def floor(self, room: str) -> str:
        """Return the colour of a room's floor."""
        wet = {"kitchen": self.tiles[0], "bathroom": self.tiles[1]}
        return wet.get(room_kind(room), self.boards)

    def of(self, thing_class: str, draws: Draws) -> Pair:
        """Return colours for a thing of a class."""
        wood, cloth = (draws.one_of((*choice[:1] * 2, *choice)) for choice in (self.wood, self.cloth))
        if thing_class in _CASES:
            return wood, draws.one_of((wood, wood, self.wood[1]))
        if thing_class in _TABLES:
            return wood, draws.one_of((wood, self.wood[1]))
        if thing_class in _SEATS:
            return cloth, draws.one_of(self.cloth)
        fixed = {
            "bed": (cloth, wood), "rug": (draws.one_of(self.cloth), None),
            "towel_rack": (wood, draws.one_of(self.cloth)),
            "kitchen_counter": (self.front, self.top), "bathroom_counter": (self.front, self.top),
            "stove": (self.metal, None), "fridge": (self.metal, None), "range_hood": (self.metal, None),
            "microwave": (draws.one_of(_METALS), None), "washing_machine": (draws.one_of(_WHITES), None),
            "bathtub": (draws.one_of(_WHITES), None), "toilet": (draws.one_of(_WHITES), None),
            "shower": (draws.one_of(_WHITES), None), "radiator": (draws.one_of(_WHITES), None),
            "plant": (draws.one_of((*self.cloth, "#bd694a")), None), "floor_lamp": (None, wood),
            "table_lamp": (None, draws.one_of(self.cloth)), "piano": (self.wood[0], None), "mirror": (wood, None),
            "picture": (wood, None), "window": (draws.one_of(_WHITES), None),
            "trash_can": (draws.one_of(_METALS), None),
            "laundry_basket": (wood, None), "coat_rack": (wood, None), "tv": (self.top, None),
            "fireplace": (draws.one_of(_TILES), None),
        }  # fmt: skip
        return fixed.get(thing_class, (None, None))


def draw_looks(rooms: tuple[str, ...], draws: Draws) -> Looks:
    """Return the colours of a home."""
    paint = draws.shuffled(_PAINTS)
    tiles = draws.shuffled(_TILES)
    wet = draws.one_of(_WET)
    walls = {room: wet if room_kind(room) == "bathroom" else paint.pop() for room in rooms}
    boards = draws.one_of(_BOARDS)
    woods, cloths = (draws.shuffled([c for c in choice if _differ(c, boards)]) for choice in (_WOODS, _CLOTHS))
    return Looks(
        (woods[0], woods[1]), (cloths[0], cloths[1], cloths[2]), draws.one_of((*_FRONTS, woods[0])),
        draws.one_of(_TOPS), draws.one_of(_METALS), boards, (tiles[0], tiles[1]), walls,
    )  # fmt: skip


def _differ(one: str, other: str) -> bool:
    """Tell whether two colours can be told apart, one before the other."""
    return sum(abs(int(one[i : i + 2], 16) - int(other[i : i + 2], 16)) for i in (1, 3, 5)) >= _CONTRAST


def channels(colour: str) -> tuple[float, float, float]:
    """Return red, green and blue (0..1) of a colour ``#rrggbb``."""
    red, green, blue = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue
