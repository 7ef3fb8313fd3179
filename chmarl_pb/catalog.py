"""The classes of things: graspables, receptacles, scenery, rooms and robots, with states and names.

A class is known by its identifier (``coffee_pot``). Its row here gives the symbolic states that a
task's seed chooses from and the words people use for it; its model is a URDF file named after it.
Class lists: CH-MARL, section 3 (45 graspables, 16 receptacles, 4 room kinds).
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from chmarl_pb.assets import URDF_DIR
from chmarl_pb.errors import AssetError

Kind = Literal["graspable", "receptacle", "scenery", "room", "robot"]


@dataclass(frozen=True)
class ThingClass:
    """One class of things.

    Attributes:
        name: identifier, lower case with underscores.
        kind: what the class is used for.
        states: symbolic states that a task's seed draws from; the first is the usual one.
        synonyms: names in plain English, the first is the canonical one.
    """

    name: str
    kind: Kind
    states: tuple[str, ...]
    synonyms: tuple[str, ...]

    @property
    def noun(self) -> str:
        """The canonical English name."""
        return self.synonyms[0]


def _rows(kind: Kind, table: str, default: tuple[str, ...]) -> dict[str, ThingClass]:
    """Parse rows of ``identifier | synonym, synonym | state, state``; later columns may be absent."""
    classes = {}
    for line in table.strip().splitlines():
        columns = [column.strip() for column in line.split("|")]
        name = columns[0]
        synonyms: tuple[str, ...] = (name.replace("_", " "),)
        if len(columns) > 1 and columns[1]:
            synonyms += tuple(word.strip() for word in columns[1].split(","))
        states = tuple(state.strip() for state in columns[2].split(",")) if len(columns) > 2 else default
        classes[name] = ThingClass(name, kind, states, synonyms)
    return classes


GRASPABLES = _rows(
    "graspable",
    """
    apple | red apple
    banana | yellow banana
    board_game | tabletop game
    book | novel
    bowl | soup bowl
    bread | loaf of bread
    candle | wax candle | off, on
    cereal_box | box of cereal | closed, open
    chocolate_syrup | bottle of chocolate syrup | closed, open
    clock | alarm clock | on, off
    coffee_pot | coffee jug | closed, open
    cooking_pot | stew pot | closed, open
    cupcake | muffin
    cushion | pillow
    face_cream | jar of face cream | closed, open
    folder | file folder | closed, open
    fork | dinner fork | clean, dirty
    frying_pan | skillet | clean, dirty
    glass | drinking glass | clean, dirty
    hairbrush | hair brush
    juice_box | juice carton | closed, open
    knife | kitchen knife | clean, dirty
    lime | green lime
    lotion | body lotion | closed, open
    magazine | glossy magazine | closed, open
    milk_carton | carton of milk | closed, open
    mobile_phone | cell phone | off, on
    mug | coffee mug | clean, dirty
    notes | note pad
    peach | ripe peach
    plate | dinner plate | clean, dirty
    remote_control | remote
    shampoo | bottle of shampoo | closed, open
    slippers | house shoes
    sports_ball | ball
    teddy_bear | stuffed bear
    toothbrush | tooth brush
    toothpaste | tube of toothpaste | closed, open
    towel | hand towel
    toy_car | toy
    washing_sponge | washing scrub
    water_bottle | bottle of water | closed, open
    whipped_cream | can of whipped cream | closed, open
    wine_bottle | bottle of wine | closed, open
    wine_glass | stemmed glass | clean, dirty
    """,
    ("intact",),
)

RECEPTACLES = _rows(
    "receptacle",
    """
    bathroom_counter | bathroom vanity
    bed | mattress
    bench | sitting bench
    bookshelf | bookcase
    cabinet | cupboard | closed, open
    chair | seat
    coffee_table | low table
    desk | work table
    dresser | chest of drawers | closed, open
    kitchen_counter | kitchen worktop
    kitchen_table | dining table
    nightstand | bedside table | closed, open
    sofa | couch
    stove | cooker | off, on
    towel_rack | towel shelf
    tv_stand | television stand | closed, open
    """,
    ("fixed",),
)

SCENERY = _rows(
    "scenery",
    """
    bathtub | bath
    coat_rack
    fireplace | | off, on
    floor_lamp | standing lamp | off, on
    fridge | refrigerator | closed, open
    laundry_basket
    microwave | | closed, open
    mirror
    piano | | closed, open
    picture | painting
    plant | potted plant
    radiator | heater | off, on
    range_hood | | off, on
    rug | carpet
    shoe_rack
    shower | | off, on
    stool
    table_lamp | lamp | off, on
    toilet | | closed, open
    trash_can | bin | closed, open
    tv | television | off, on
    wall_cabinet | | closed, open
    wardrobe | closet | closed, open
    washing_machine | washer | closed, open
    window | | closed, open
    """,
    ("fixed",),
)

#: Kinds of rooms that robots can be sent to, in the order of the ``goto`` actions.
ROOM_KINDS = ("kitchen", "bedroom", "bathroom", "livingroom")

ROOMS = _rows("room", "kitchen\nbedroom\nbathroom\nlivingroom | living room\nhallway | hall", ("fixed",))

ROBOTS = _rows("robot", "humanoid | robot\ndrone | flying robot", ("free", "holding"))

#: Structure of a home: solid and visible, but never a node of the scene graph.
STRUCTURE = ("floor", "wall")

#: Class name to row, over all kinds, in the order of the scene graph's class ids.
CLASSES: dict[str, ThingClass] = {**GRASPABLES, **RECEPTACLES, **SCENERY, **ROOMS, **ROBOTS}

#: Scene-graph class id of each class; 0 is padding.
CLASS_IDS = {name: number for number, name in enumerate(CLASSES, start=1)}

#: All state names; "held" is given by the world, the others by the task's seed.
STATES = tuple(sorted({state for row in CLASSES.values() for state in row.states} | {"held"}))

#: Scene-graph state id of each state; 0 is padding.
STATE_IDS = {name: number for number, name in enumerate(STATES, start=1)}

#: Relations between two nodes, in the order of their ids; 0 is padding.
RELATIONS = ("on", "inside", "near", "held_by", "in_room")

RELATION_IDS = {name: number for number, name in enumerate(RELATIONS, start=1)}


def class_of(thing: str) -> str:
    """Return the class of a thing's name: ``kitchen/stove_1`` -> ``stove``, ``mug_1`` -> ``mug``."""
    return thing.rsplit("/", 1)[-1].rstrip("0123456789").rstrip("_")


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


def robot_urdf(name: str) -> Path:
    """Return the URDF file of a robot.

    Raises:
        AssetError: there is no such robot.
    """
    return _urdf("robots", name)


def _urdf(folder: str, name: str) -> Path:
    path = URDF_DIR / folder / f"{name}.urdf"
    if not path.is_file():
        known = sorted(file.stem for file in path.parent.glob("*.urdf"))
        raise AssetError(f"{path}: no such model; known in {folder}: {', '.join(known)}")
    return path
