"""Homes for tests: the names of the benchmark's, and small ones made of boxes on the spot."""

HOMES = tuple(f"home_{number}" for number in range(1, 8))

Triple = tuple[float, float, float]
Boxes = dict[str, tuple[Triple, Triple]]  # sizes and middles in metres, by the names of the links


def box(name: str, size: Triple, position: Triple) -> str:
    """Return the URDF lines of a box-shaped link, fixed in the world."""
    where, extents = (" ".join(map(str, values)) for values in (position, size))
    shape = f'<origin xyz="{where}"/><geometry><box size="{extents}"/></geometry>'
    return (
        f'<link name="{name}"><inertial><mass value="0"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>'
        f"</inertial>\n<visual>{shape}</visual>\n<collision>{shape}</collision></link>\n"
        f'<joint name="to_{name}" type="fixed"><parent link="world"/><child link="{name}"/></joint>\n'
    )


#: A home of one room, 4 m x 4 m about the origin, with a desk and a sofa.
SMALL_HOME: Boxes = {
    "livingroom/floor_1": ((4, 4, 0.1), (0, 0, -0.05)),
    "livingroom/desk_1": ((1.2, 0.6, 0.75), (0, 1.6, 0.375)),
    "livingroom/sofa_1": ((1.8, 0.8, 0.45), (0, -1.5, 0.225)),
}


def home_text(boxes: Boxes | None = None, extra: str = "") -> str:
    """Return the URDF of a home made of boxes."""
    links = "".join(box(name, size, position) for name, (size, position) in (boxes or SMALL_HOME).items())
    return f'<?xml version="1.0"?>\n<robot name="home">\n<link name="world"/>\n{links}{extra}</robot>\n'
