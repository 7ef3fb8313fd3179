"""The classes of things: graspables, receptacles, scenery, rooms and robots, with states and names.

A class is known by its identifier (``coffee_pot``). Its row gives the symbolic states that a task's seed chooses from,
the words people use for it, and its model. All rows together are a :class:`Catalog`, which a home is read with. The
benchmark's is :data:`BENCHMARK`: CH-MARL, section 3 (45 graspables, 16 receptacles, 4 room kinds). Users' own
classes stand after these, see :func:`chmarl_pb.homes.catalog_file.load_catalog`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Literal

from chmarl_pb.assets import URDF_DIR
from chmarl_pb.errors import AssetError

Kind = Literal["graspable", "receptacle", "scenery", "room", "robot"]

#: Name and content of the files of a model, the URDF first.
Files = tuple[tuple[str, bytes], ...]


@dataclass(frozen=True)
class Name:
    """One English name of a class.

    Attributes:
        text: the words, without an article.
        number: "count" takes a or an, "mass" and "plural" take some; of a plural one says them.
        held_out: whether tasks for training never use it.
    """

    text: str
    number: Literal["count", "mass", "plural"] = "count"
    held_out: bool = False


@dataclass(frozen=True)
class ThingClass:
    """One class of things.

    Attributes:
        name: identifier, lower case with underscores.
        kind: what the class is used for.
        states: symbolic states that a task's seed draws from; the first is the usual one.
        names: names in plain English, the first is the canonical one.
        places: receptacle classes that tasks put it on; none named: all.
        model: name and content of the files that PyBullet loads it from, the URDF first; none: the packaged ones.
        looks: colour -> model of each object of the class, where there are several; none: one object.
    """

    name: str
    kind: Kind
    states: tuple[str, ...]
    names: tuple[Name, ...]
    places: tuple[str, ...] = ()
    model: Files = field(default=(), repr=False)
    looks: tuple[tuple[str, Files], ...] = field(default=(), repr=False)

    @property
    def objects(self) -> tuple[tuple[str, Files], ...]:
        """The name of each object of the class that there may be in a home, and its model."""
        looks = tuple((object_name(self.name, colour), model) for colour, model in self.looks)
        return looks or ((f"{self.name}_1", self.model),)

    @property
    def synonyms(self) -> tuple[str, ...]:
        """The words of all its names."""
        return tuple(name.text for name in self.names)

    @property
    def noun(self) -> str:
        """The canonical English name."""
        return self.names[0].text


@dataclass(frozen=True, eq=False)
class Catalog:
    """All classes of things that a home, its tasks and its observations know of; equal if their content is.

    Attributes:
        rows: the classes in the order of their ids.
        states: all state names in the order of their ids; "held" is given by the world, others by the task's seed.
        furniture: model of the user's own -> its class and its URDF.
        content: the sha256 of the user's files; empty for the benchmark's.
    """

    rows: tuple[ThingClass, ...]
    states: tuple[str, ...]
    furniture: dict[str, tuple[str, Path]] = field(default_factory=dict)
    content: str = ""

    def __eq__(self, other: object) -> bool:
        """Tell whether it is of the same content."""
        return isinstance(other, Catalog) and other.content == self.content

    def __hash__(self) -> int:
        """Return a number that is the same for the same content."""
        return hash(self.content)

    def extended(
        self, rows: Sequence[ThingClass], content: str, furniture: dict[str, tuple[str, Path]] | None = None
    ) -> "Catalog":
        """Return a catalogue with more classes; all ids that this one gives stay.

        Args:
            rows: the classes, of other names.
            content: what tells it from other catalogues.
            furniture: as the attribute.
        """
        new = dict.fromkeys(state for row in rows for state in row.states if state not in self.states)
        return Catalog((*self.rows, *rows), (*self.states, *new), {**self.furniture, **(furniture or {})}, content)

    @cached_property
    def classes(self) -> dict[str, ThingClass]:
        """Class name -> row, over all kinds."""
        return {row.name: row for row in self.rows}

    @cached_property
    def class_ids(self) -> dict[str, int]:
        """Scene-graph class id of each class; 0 is padding."""
        return {row.name: number for number, row in enumerate(self.rows, start=1)}

    @cached_property
    def state_ids(self) -> dict[str, int]:
        """Scene-graph state id of each state; 0 is padding."""
        return {name: number for number, name in enumerate(self.states, start=1)}

    @cached_property
    def graspables(self) -> dict[str, ThingClass]:
        """What robots can pick."""
        return self._of("graspable")

    @cached_property
    def receptacles(self) -> dict[str, ThingClass]:
        """What things can be placed on."""
        return self._of("receptacle")

    @cached_property
    def scenery(self) -> dict[str, ThingClass]:
        """What stands in a home besides."""
        return self._of("scenery")

    @cached_property
    def rooms(self) -> dict[str, ThingClass]:
        """Kinds of rooms."""
        return self._of("room")

    @cached_property
    def robots(self) -> dict[str, ThingClass]:
        """Kinds of robots."""
        return self._of("robot")

    def _of(self, kind: Kind) -> dict[str, ThingClass]:
        return {row.name: row for row in self.rows if row.kind == kind}


def _rows(kind: Kind, table: str, default: tuple[str, ...]) -> list[ThingClass]:
    """Parse rows of ``identifier | names | names held out of training | states``; later columns may be absent."""
    classes = []
    for line in table.strip().splitlines():
        columns = [[entry.strip() for entry in column.split(",") if entry.strip()] for column in line.split("|")]
        columns += [[]] * (4 - len(columns))
        (identifier,), shown, held_out, states = columns
        classes.append(ThingClass(identifier, kind, tuple(states) or default, names_of(identifier, shown, held_out)))
    return classes


def names_of(identifier: str, shown: Sequence[str], held_out: Sequence[str]) -> tuple[Name, ...]:
    """Return the names of a class.

    Args:
        identifier: its own words are the first name, unless ``shown`` begins with them.
        shown: names for all tasks; "some" before one says that it takes no "a", and a final s then that it is a plural.
        held_out: names that tasks for training never use.
    """
    names = [_name(text, False) for text in shown] + [_name(text, True) for text in held_out]
    canonical = Name(identifier.replace("_", " "))
    if not names or names[0].text != canonical.text:
        names.insert(0, canonical)
    return tuple(names)


def _name(text: str, held_out: bool) -> Name:
    if not text.startswith("some "):
        return Name(text, "count", held_out)
    return Name(text.removeprefix("some "), "plural" if text.endswith("s") else "mass", held_out)


_GRASPABLES = _rows(
    "graspable",
    """
    apple | red apple | fresh apple
    banana | yellow banana | ripe banana
    board_game | tabletop game | family game
    book | novel | paperback
    bowl | soup bowl | dessert bowl
    bread | some bread, loaf of bread | bread loaf
    candle | wax candle | scented candle | off, on
    cereal_box | box of cereal | packet of cereal | closed, open
    chocolate_syrup | some chocolate syrup, bottle of chocolate syrup | some chocolate sauce | closed, open
    clock | alarm clock | timepiece | on, off
    coffee_pot | coffee jug | coffee pitcher | closed, open
    cooking_pot | stew pot | soup pot | closed, open
    cupcake | muffin | little cake
    cushion | pillow | throw pillow
    face_cream | some face cream, jar of face cream | some facial cream | closed, open
    folder | file folder | document folder | closed, open
    fork | dinner fork | table fork | clean, dirty
    frying_pan | skillet | fry pan | clean, dirty
    glass | drinking glass | tumbler | clean, dirty
    hairbrush | hair brush | styling brush
    juice_box | box of juice | carton of juice | closed, open
    knife | kitchen knife | sharp knife | clean, dirty
    lime | green lime | fresh lime
    lotion | some lotion, some body lotion, bottle of lotion | some skin lotion | closed, open
    magazine | glossy magazine | illustrated magazine | closed, open
    milk_carton | carton of milk | packet of milk | closed, open
    mobile_phone | cell phone | smartphone | off, on
    mug | coffee mug | tea mug | clean, dirty
    notes | some notes, some paper notes | some written notes
    peach | ripe peach | fresh peach
    plate | dinner plate | china plate | clean, dirty
    remote_control | remote | television remote
    shampoo | some shampoo, bottle of shampoo | shampoo bottle | closed, open
    slippers | some slippers, some house shoes | some indoor shoes
    sports_ball | ball | game ball
    teddy_bear | stuffed bear | plush bear
    toothbrush | tooth brush | dental brush
    toothpaste | some toothpaste, tube of toothpaste | toothpaste tube | closed, open
    towel | hand towel | cotton towel
    toy_car | toy | model car
    washing_sponge | washing scrub | cleaning sponge
    water_bottle | bottle of water | drinking bottle | closed, open
    whipped_cream | some whipped cream, can of whipped cream | whipped cream can | closed, open
    wine_bottle | bottle of wine | corked wine bottle | closed, open
    wine_glass | stemmed glass | wine goblet | clean, dirty
    """,
    ("intact",),
)

_RECEPTACLES = _rows(
    "receptacle",
    """
    bathroom_counter | bathroom vanity | vanity unit
    bed | mattress | bedstead
    bench | sitting bench | bench seat
    bookshelf | bookcase | book rack
    cabinet | cupboard | storage cabinet | closed, open
    chair | seat | sitting chair
    coffee_table | low table | tea table
    desk | work table | writing desk
    dresser | chest of drawers | drawer chest | closed, open
    kitchen_counter | kitchen worktop | kitchen countertop
    kitchen_table | dining table | dinner table
    nightstand | bedside table | night table | closed, open
    sofa | couch | settee
    stove | cooker | kitchen range | off, on
    towel_rack | towel shelf | towel holder
    tv_stand | television stand | media console | closed, open
    """,
    ("fixed",),
)

_SCENERY = _rows(
    "scenery",
    """
    bathtub | bath
    coat_rack
    fireplace | | | off, on
    floor_lamp | standing lamp | | off, on
    fridge | refrigerator | | closed, open
    laundry_basket
    microwave | | | closed, open
    mirror
    piano | | | closed, open
    picture | painting
    plant | potted plant
    radiator | heater | | off, on
    range_hood | | | off, on
    rug | carpet
    shoe_rack
    shower | | | off, on
    stool
    table_lamp | lamp | | off, on
    toilet | | | closed, open
    trash_can | bin | | closed, open
    tv | television | | off, on
    wall_cabinet | | | closed, open
    wardrobe | closet | | closed, open
    washing_machine | washer | | closed, open
    window | | | closed, open
    """,
    ("fixed",),
)

#: Kinds of rooms that robots can be sent to, in the order of the ``goto`` actions.
ROOM_KINDS = ("kitchen", "bedroom", "bathroom", "livingroom")

_ROOMS = _rows(
    "room",
    """
    kitchen | kitchen area | cooking area
    bedroom | sleeping room | sleeping area
    bathroom | washroom | restroom
    livingroom | living room, lounge | sitting room
    hallway | hall | corridor
    """,
    ("fixed",),
)

_ROBOTS = _rows("robot", "humanoid | robot\ndrone | flying robot", ("free", "holding"))

#: Structure of a home: solid and visible, but never a node of the scene graph.
STRUCTURE = ("floor", "wall")

_ALL = (*_GRASPABLES, *_RECEPTACLES, *_SCENERY, *_ROOMS, *_ROBOTS)

#: The benchmark's classes, whose ids never move.
BENCHMARK = Catalog(_ALL, tuple(sorted({state for row in _ALL for state in row.states} | {"held"})))

#: Colours that objects of a class are told apart by, in the order of their ids; 0 is none.
COLOURS = ("black", "white", "red", "pink", "orange", "yellow", "brown", "green", "teal", "blue", "purple")

COLOUR_IDS = {name: number for number, name in enumerate(COLOURS, start=1)}

#: Relations between two nodes, in the order of their ids; 0 is padding.
RELATIONS = ("on", "inside", "near", "held_by", "in_room")

RELATION_IDS = {name: number for number, name in enumerate(RELATIONS, start=1)}


@lru_cache(maxsize=4096)
def class_of(thing: str) -> str:
    """Return the class of a thing's name: ``kitchen/stove_1`` -> ``stove``, ``mug_1`` -> ``mug``."""
    return thing.rsplit("/", 1)[-1].rstrip("0123456789").rstrip("_")


def object_name(class_name: str, colour: str) -> str:
    """Return the name of the object of a class that has a colour, where there are several."""
    return f"{class_name}_{COLOUR_IDS[colour]}"


def colour_of(thing: str) -> int:
    """Return the id of the colour in the name of an object among others of its class: ``mug_3`` -> 3; else 0."""
    number = thing.rpartition("_")[2]
    return int(number) if "/" not in thing and number.isdecimal() else 0


def room_of(thing: str) -> str:
    """Return the room in a static thing's name: ``kitchen/stove_1`` -> ``kitchen``."""
    return thing.split("/", 1)[0]


def room_kind(room: str) -> str:
    """Return the kind of a room: ``bedroom_2`` -> ``bedroom``."""
    return room.rstrip("0123456789").rstrip("_")


def graspable_urdf(name: str) -> Path:
    """Return the URDF file of a graspable class.

    Raises:
        AssetError: the class has no file.
    """
    return _urdf("graspables", name)


def furniture_urdf(model: str) -> Path:
    """Return the URDF file of a furniture model, e.g. ``bed_double``.

    Raises:
        AssetError: there is no such model.
    """
    return _urdf("furniture", model)


_LONGEST_NAME = 100  # characters of a model


def _urdf(folder: str, name: str) -> Path:
    path = URDF_DIR / folder / f"{name}.urdf"
    if len(name) > _LONGEST_NAME or not path.is_file():
        path = path.with_name(f"{name[:_LONGEST_NAME]}.urdf")
        known = sorted(file.stem for file in path.parent.glob("*.urdf"))
        raise AssetError(f"{path}: no such model; known in {folder}: {', '.join(known)}")
    return path
