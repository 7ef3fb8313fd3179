"""Storage: bookshelves, cabinets, dressers, nightstand, tv stands, wardrobes, wall cabinets and the shoe rack."""

from typing import Literal

from tools.assets.furniture_model import Block, Model, Vector

Span = tuple[float, float]
Handles = Literal["drawer", "door", "none"]

#: How far fronts and their handles stand out of the carcass.
FRONT = 0.018
HANDLE = 0.022

#: Colour, thickness and height of a row of books.
BOOKS = (
    ("red", 0.04, 0.24),
    ("navy", 0.03, 0.21),
    ("mustard", 0.035, 0.23),
    ("teal", 0.045, 0.2),
    ("cream", 0.03, 0.25),
)


def models() -> list[Model]:
    """Return the models of this group."""
    return [
        _bookshelf("bookshelf_tall", 0.9, 1.75, (0.06, 0.46, 0.87, 1.28), "oak"),
        _bookshelf("bookshelf_low", 1.2, 0.95, (0.06, 0.48), "white"),
        _chest("cabinet_low", (0.45, 1.0, 0.9), "white", "oak", columns=2, rows=1, handles="door"),
        cabinet_sideboard(),
        _chest("cabinet_tall", (0.45, 0.8, 1.2), "sage", "oak", columns=2, rows=1, handles="door"),
        _chest("dresser_wide", (0.5, 1.3, 0.85), "oak", "oak", columns=2, rows=3, handles="drawer"),
        _chest("dresser_tall", (0.5, 0.8, 1.15), "white", "pine", columns=1, rows=4, handles="drawer"),
        _chest("nightstand_drawer", (0.42, 0.45, 0.52), "walnut", "walnut", columns=1, rows=2, handles="drawer"),
        tv_stand_low(),
        tv_stand_wide(),
        _wardrobe("wardrobe_two", 1.1, 2.0, 2, "pine"),
        _wardrobe("wardrobe_three", 1.6, 2.1, 3, "white"),
        shoe_rack_wood(),
        _wall_cabinet("wall_cabinet_kitchen", (0.34, 1.2, 0.65), 3, "white"),
        _wall_cabinet("wall_cabinet_bath", (0.18, 0.6, 0.6), 2, "white"),
    ]


def fronts(
    model: Model,
    x: float,
    y: Span,
    z: Span,
    columns: int,
    rows: int,
    handles: Handles,
    metal: str = "dark_steel",
    part: str = "",
) -> None:
    """Cover a carcass's front with doors or drawers, divided by dark gaps.

    Args:
        model: model to add to.
        x: plane of the carcass's front.
        y: extent of the area sideways.
        z: extent of the area upwards.
        columns: fronts side by side.
        rows: fronts above each other.
        handles: horizontal bars (drawer), upright bars at the edge (door) or none.
        metal: colour of the handles.
        part: prefix of the mesh names, for a second area on one model.
    """
    width, height, gap = (y[1] - y[0]) / columns, (z[1] - z[0]) / rows, 0.014
    cells = [(c, y[0] + (c + 0.5) * width, z[0] + r * height) for c in range(columns) for r in range(rows)]
    plate = (0.006, y[1] - y[0] - 2 * gap, z[1] - z[0] - 2 * gap)
    model.block("gap", plate, (x + 0.003, sum(y) / 2, z[0] + gap), solid=False)
    panel = (FRONT, width - gap, height - gap)
    model.blocks(f"{part}fronts", "primary", [(panel, (x + FRONT / 2, cy, cz + gap / 2)) for _, cy, cz in cells])
    if handles != "none":
        bars = (_handle(handles, c % 2 == 0, width, height) for c, _, _ in cells)
        at = x + FRONT + HANDLE / 2
        places = [(size, (at, cy + dy, cz + dz)) for (size, (dy, dz)), (_, cy, cz) in zip(bars, cells, strict=True)]
        model.blocks(f"{part}handles", metal, places)


def _handle(kind: Handles, hinged_right: bool, width: float, height: float) -> tuple[Vector, Span]:
    """Return the size of a front's handle and its place (y, z) from the middle of the front's lower edge."""
    if kind == "drawer":
        return (HANDLE, 0.4 * width, 0.018), (0.0, 0.6 * height)
    side = 0.5 * width - 0.05
    return (HANDLE, 0.018, 0.16), (side if hinged_right else -side, max(0.5 * height - 0.08, 0.3 * height))


def carcass(model: Model, size: Vector, top: float = 0.03, plinth: float = 0.06) -> float:
    """Add a closed body with a top board and a set-back plinth.

    Returns:
        The plane x on which fronts go: they and their handles end at the model's depth.
    """
    depth, width, height = size
    body = depth - FRONT - HANDLE
    x = -(FRONT + HANDLE) / 2
    model.block("gap", (body - 0.05, width - 0.06, plinth), (x - 0.025, 0, 0), solid=False)
    model.block("primary", (body, width, height - top - plinth), (x, 0, plinth), solid=False)
    model.block("secondary", (depth, width, top), (0, 0, height - top), solid=False)
    model.solid(size)
    return x + body / 2


def cabinet_sideboard() -> Model:
    """Return a long sideboard with drawers between two pairs of doors."""
    model = Model("cabinet_sideboard", primary="walnut", secondary="walnut")
    x = carcass(model, (0.45, 1.6, 0.8), plinth=0.1)
    fronts(model, x, (-0.8, -0.27), (0.1, 0.77), 1, 1, "none", part="left_")
    fronts(model, x, (0.27, 0.8), (0.1, 0.77), 1, 1, "none", part="right_")
    fronts(model, x, (-0.27, 0.27), (0.1, 0.77), 1, 3, "drawer", metal="brass")
    knobs = [((HANDLE, 0.02, 0.16), (x + FRONT + HANDLE / 2, y, 0.36)) for y in (-0.32, 0.32)]
    model.blocks("knobs", "brass", knobs)
    return model


def tv_stand_low() -> Model:
    """Return a low stand: two doors and an open bay between them."""
    model = Model("tv_stand_low", primary="oak", secondary="oak")
    depth, width, height = 0.42, 1.5, 0.5
    model.block("secondary", (depth, width, 0.03), (0, 0, height - 0.03))
    for side in (-1, 1):
        model.block("primary", (0.38, 0.48, 0.39), (-0.02, side * 0.5, 0.08))
    model.block("primary", (0.38, 0.52, 0.03), (-0.02, 0, 0.08))
    model.block("gap", (0.02, 0.52, 0.36), (-0.2, 0, 0.11))
    fronts(model, 0.17, (-0.74, -0.26), (0.08, 0.47), 1, 1, "none", part="left_")
    fronts(model, 0.17, (0.26, 0.74), (0.08, 0.47), 1, 1, "none", part="right_")
    model.blocks("pulls", "charcoal", [((HANDLE, 0.12, 0.016), (0.199, y, 0.4)) for y in (-0.5, 0.5)])
    model.block("charcoal", (0.22, 0.32, 0.06), (0.0, 0, 0.11), solid=False)
    model.blocks("feet", "charcoal", _feet(0.36, 1.4, 0.08), solid=True)
    return model


def tv_stand_wide() -> Model:
    """Return a wide stand with three wide drawers."""
    model = Model("tv_stand_wide", primary="white", secondary="oak")
    x = carcass(model, (0.45, 1.9, 0.45), top=0.035, plinth=0.08)
    fronts(model, x, (-0.95, 0.95), (0.08, 0.415), 3, 1, "drawer", metal="charcoal")
    return model


def shoe_rack_wood() -> Model:
    """Return an open rack with two boards of shoes."""
    model = Model("shoe_rack_wood", primary="pine", secondary="pine")
    model.blocks("sides", "secondary", [((0.32, 0.03, 0.5), (0, y, 0)) for y in (-0.385, 0.385)], solid=True)
    boards = [((0.3, 0.74, 0.02), (0, 0, z)) for z in (0.06, 0.27)]
    model.blocks("boards", "primary", boards, solid=True)
    model.block("primary", (0.32, 0.8, 0.025), (0, 0, 0.475))
    pairs = (("navy", -0.22, 0.29), ("burgundy", 0.2, 0.08), ("charcoal", 0.1, 0.29), ("mustard", -0.2, 0.08))
    for colour, y, z in pairs:
        shoes: list[Block] = []
        for offset in (-0.06, 0.06):
            shoes.append(((0.26, 0.09, 0.05), (0, y + offset, z)))
            shoes.append(((0.12, 0.08, 0.05), (-0.06, y + offset, z + 0.05)))
        model.blocks(f"shoes_{colour}", colour, shoes)
    return model


def _bookshelf(name: str, width: float, height: float, boards: tuple[float, ...], wood: str) -> Model:
    """Return an open shelf with boards whose bottoms are at the given heights, and a few books."""
    model = Model(name, primary=wood, secondary=wood)
    depth, thick = 0.32, 0.025
    model.blocks(
        "sides", "primary", [((depth, thick, height), (0, s * (width - thick) / 2, 0)) for s in (-1, 1)], solid=True
    )
    model.block("secondary", (0.012, width - 0.03, height - 0.06), (-depth / 2 + 0.006, 0, 0.05))
    levels = (*boards, height - thick)
    inner = width - 2 * thick
    model.blocks("boards", "primary", [((depth - 0.01, inner, thick), (0.005, 0, z)) for z in levels], solid=True)
    rows = [(boards[-1], -1), (boards[0], 1)]
    if len(boards) > 2:
        rows.append((boards[1], -1))
    for row, (z, side) in enumerate(rows):
        _books(model, row, z + thick, side * (inner / 2), side)
    return model


def _books(model: Model, row: int, z: float, edge: float, side: int) -> None:
    """Add a row of upright books from a shelf's inner ``edge`` inwards, as visuals and one solid box."""
    y = edge
    for colour, thickness, tall in BOOKS[row:] + BOOKS[:row]:
        model.block(colour, (0.18, thickness, tall), (-0.02, y - side * thickness / 2, z), solid=False)
        y -= side * (thickness + 0.002)
    model.solid((0.18, abs(edge - y), 0.23), (-0.02, (edge + y) / 2, z))


def _chest(name: str, size: Vector, primary: str, secondary: str, columns: int, rows: int, handles: Handles) -> Model:
    """Return a closed chest with a grid of doors or drawers."""
    model = Model(name, primary=primary, secondary=secondary)
    x = carcass(model, size)
    fronts(model, x, (-size[1] / 2, size[1] / 2), (0.06, size[2] - 0.03), columns, rows, handles, metal="brass")
    return model


def _wardrobe(name: str, width: float, height: float, doors: int, wood: str) -> Model:
    """Return a wardrobe with full-height doors."""
    model = Model(name, primary=wood, secondary=wood)
    x = carcass(model, (0.6, width, height), top=0.04, plinth=0.08)
    fronts(model, x, (-width / 2, width / 2), (0.08, height - 0.04), doors, 1, "door")
    return model


def _wall_cabinet(name: str, size: Vector, doors: int, colour: str) -> Model:
    """Return a cabinet that hangs on a wall; z = 0 is its lower face."""
    depth, width, height = size
    model = Model(name, primary=colour, secondary=colour)
    body = depth - FRONT - HANDLE
    model.block("secondary", (body, width, height), (-(FRONT + HANDLE) / 2, 0, 0), solid=False)
    model.solid(size)
    fronts(model, depth / 2 - FRONT - HANDLE, (-width / 2, width / 2), (0, height), doors, 1, "door")
    return model


def _feet(x: float, y: float, height: float) -> list[Block]:
    return [((0.04, 0.04, height), (i * (x / 2 - 0.02), j * (y / 2 - 0.02), 0)) for i in (-1, 1) for j in (-1, 1)]
