"""Soft things, toys, clock and candle. Each function returns the painted meshes of the class that it is named after."""

import numpy as np

from tools.assets.decals import GAP, disc, front, line, panel, patch, twice, upright
from tools.assets.meshes import (
    Array,
    Mesh,
    at_height,
    box,
    cylinder,
    ellipsoid,
    extrude,
    join,
    lathe,
    loft,
    ngon,
    tube,
)
from tools.assets.model import Paint


def candle() -> Paint:
    """Candle with drips in a brass holder with a ring handle."""
    drip = loft([at_height(r * ngon(1, 4), z) for r, z in ((0.001, 0), (0.005, 0.008), (0.002, 0.040))])
    places = ((0.3, 0.085), (4.3, 0.088), (5.2, 0.070))
    drips = [drip.moved(0.018).turned("z", angle).moved(z=z) for angle, z in places]
    dish = [(0, 0), (0.046, 0), (0.056, 0.014), (0.050, 0.014), (0.040, 0.006), (0.025, 0.006), (0.025, 0.026)]
    loop = upright(tube(at_height(ngon(0.018, 7), 0), 0.005, 3, closed=True))
    return {
        "gold": join(lathe(dish, 9), loop.moved(0.068, 0, 0.020)),
        "cream": join(lathe([(0.026, 0.026), (0.020, 0.028), (0.020, 0.128), (0.016, 0.132), (0, 0.126)], 8), *drips),
        "black": cylinder(0.0028, 0.020, 5).moved(z=0.125),
    }


def clock() -> Paint:
    """Twin-bell alarm clock, 15 cm high, its face towards -y."""
    centre = 0.068
    bell = lathe([(0, 0.002), (0.024, 0), (0.020, 0.012), (0, 0.020)], 8, crease=np.radians(60))
    bells = [bell.turned("y", side * 0.6).moved(side * 0.034, 0, centre + 0.046) for side in (-1, 1)]
    foot = cylinder(0.005, 0.034, 5, top=0.009)
    feet = [foot.turned("y", -side * 0.5).moved(side * 0.046) for side in (-1, 1)]
    arch = [(-0.030, 0, 0.062), (-0.018, 0, 0.085), (0.018, 0, 0.085), (0.030, 0, 0.062)]
    case = lathe([(0, 0), (0.055, 0), (0.055, 0.045), (0.048, 0.045)], 14)
    ticks = [line((0, 0.035), (0, 0.041), 0.005).turned("z", n * np.pi / 6) for n in range(12)]
    hands = [line((0, 0), (-0.020, 0.012), 0.007), line((0, 0), (0.010, 0.031), 0.005), disc(0.006, 6)]
    return {
        "red": join(upright(case).moved(0, 0.022, centre), *bells),
        "white": front(disc(0.049, 14), 0.018, centre),
        "black": front(join(*ticks, *hands), 0.018 + GAP, centre),
        "gold": join(*feet, tube(arch, 0.004, 4).moved(z=centre)),
    }


def cushion() -> Paint:
    """Plump square cushion, 34 cm, yellow above and teal below, with piping and a button."""
    corner = np.array([(t, -1 + 0.12 * (1 - t * t)) for t in (-1, -0.5, 0, 0.5)])
    quarter = np.array([[0, -1], [1, 0]])
    outline = np.concatenate([corner @ np.linalg.matrix_power(quarter, n).T for n in range(4)])
    circle = ngon(1.0, 16)[(np.arange(16) - 6) % 16]

    def side(levels: tuple[tuple[float, float, float], ...]) -> Mesh:
        rings = [at_height(size * (square * outline + (1 - square) * circle), z) for size, square, z in levels]
        return loft(rings, caps=False, crease=np.radians(70))

    low = side(((0, 0, 0), (0.08, 0.2, 0.0), (0.135, 0.7, 0.020), (0.166, 1, 0.058)))
    high = side(((0.166, 1, 0.062), (0.14, 0.7, 0.096), (0.09, 0.3, 0.116), (0, 0, 0.120)))
    return {
        "teal": low,
        "yellow": high,
        "cream": side(((0.166, 1, 0.056), (0.170, 1, 0.060), (0.166, 1, 0.064))),
        "rose": lathe([(0.014, 0.118), (0.010, 0.125), (0, 0.126)], 8),
    }


def sports_ball() -> Paint:
    """Football, 20 cm wide: black pentagons and white hexagons."""
    black, white = _football(0.10)
    return {"black": black, "white": white}


def teddy_bear() -> Paint:
    """Sitting teddy bear, 27 cm high, facing -y."""

    def pair(mesh: Mesh) -> Mesh:
        return join(mesh, mesh.scaled(x=-1))

    ear = upright(lathe([(0, -0.012), (0.034, -0.012), (0.024, 0.014)], 6)).moved(0.054, 0, 0.242)
    arms = pair(ellipsoid(0.056, 0.056, 0.110, 6, 3).turned("y", -0.55).moved(0.060, -0.030, 0.070))
    legs = pair(ellipsoid(0.074, 0.120, 0.072, 6, 3).turned("z", 0.35).moved(0.060, -0.060))
    body = ellipsoid(0.160, 0.140, 0.165, 7, 4)
    head = ellipsoid(0.140, 0.125, 0.125, 8, 5).moved(0, -0.005, 0.137)
    soles = pair(upright(disc(0.026, 6)).turned("z", 0.35).moved(0.082, -0.120, 0.038))
    bow = patch([(0, -0.006), (0.036, -0.022), (0.036, 0.016), (0, 0.006)])
    eye = upright(lathe([(0.010, 0), (0, 0.007)], 5)).moved(0.030, -0.057, 0.219)
    return {
        "fur": join(body, head, pair(ear), arms, legs),
        "tan": join(
            ellipsoid(0.072, 0.055, 0.054, 6, 3).moved(0, -0.060, 0.155),
            soles,
            pair(upright(disc(0.024, 6)).moved(0.054, -0.014, 0.242)),
        ),
        "black": join(ellipsoid(0.028, 0.020, 0.018, 4, 2).moved(0, -0.086, 0.186), pair(eye)),
        "red": pair(upright(bow).moved(0, -0.072, 0.138)),
    }


def toy_car() -> Paint:
    """Toy car, 16 cm long, driving towards +x."""
    side = [(-0.08, 0.012), (0.08, 0.012), (0.08, 0.034), (0.045, 0.042), (-0.075, 0.042), (-0.08, 0.036)]
    cabin = [(-0.062, 0.042), (0.045, 0.042), (0.018, 0.074), (-0.046, 0.074)]
    panes = [
        [(-0.052, 0.046), (-0.010, 0.046), (-0.010, 0.069), (-0.041, 0.069)],
        [(-0.004, 0.046), (0.034, 0.046), (0.016, 0.069), (-0.004, 0.069)],
    ]
    shield = panel(0.034, 0.052).turned("y", np.arctan2(0.032, 0.027)).moved(0.0315, 0, 0.058)
    shields = join(shield.moved(GAP, 0, GAP), panel(0.028, 0.052).turned("y", -1.1).moved(-0.055, 0, 0.058))
    wheel = upright(cylinder(0.018, 0.014, 10))
    hub = front(disc(0.009, 6), 0.044, 0.018)
    places = (-0.045, 0.045)
    lights = [box(0.004, 0.014, 0.009).moved(0.080, y, 0.022) for y in (-0.022, 0.022)]
    return {
        "red": join(upright(extrude(side, 0.076)).moved(y=0.038), upright(extrude(cabin, 0.064)).moved(y=0.032)),
        "black": join(*(wheel.moved(x, y, 0.018) for x in places for y in (-0.030, 0.044))),
        "silver": twice(join(*(hub.moved(x) for x in places))),
        "ice": join(*(front(patch(pane), side_, 0) for pane in panes for side_ in (0.032,)), shields),
        "yellow": join(*lights),
    }


def _football(radius: float) -> tuple[Mesh, Mesh]:
    """Return the pentagons and the hexagons of a truncated icosahedron about the origin."""
    g = (1 + 5**0.5) / 2
    signs = (-1.0, 1.0)
    corners = np.array([np.roll([0.0, a, b * g], k) for k in range(3) for a in signs for b in signs])
    near = [[j for j in range(12) if 0 < np.linalg.norm(corners[i] - corners[j]) < 2.1] for i in range(12)]
    black = [_dome([(2 * corners[i] + corners[j]) / 3 for j in near[i]], radius) for i in range(12)]
    faces = [(i, j, k) for i in range(12) for j in near[i] for k in near[j] if i < j < k and k in near[i]]
    white = [_dome([(2 * corners[a] + corners[b]) / 3 for a in face for b in face if a != b], radius) for face in faces]
    pentagons, hexagons = np.concatenate(black), np.concatenate(white)
    return Mesh(pentagons, pentagons / radius), Mesh(hexagons, hexagons / radius)


def _dome(points: list[Array], radius: float) -> Array:
    """Return triangles from a patch's centre to its corners, all on a sphere."""
    corners = np.array(points)
    middle = corners.mean(axis=0)
    axis = middle / np.linalg.norm(middle)
    side = np.cross(axis, corners[0])
    order = np.argsort(np.arctan2(corners @ np.cross(axis, side), corners @ side))
    ring = np.array([c / np.linalg.norm(c) for c in corners[order]])
    return radius * np.stack([np.broadcast_to(axis, ring.shape), ring, np.roll(ring, -1, axis=0)], axis=1)
