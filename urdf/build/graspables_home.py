"""Living-room and bedroom things. Each function returns the painted meshes of the class that it is named after."""

import numpy as np

from urdf.build.decals import disc, front, lettering, line, panel, patch
from urdf.build.meshes import (
    Array,
    Mesh,
    arc,
    at_height,
    box,
    cylinder,
    ellipsoid,
    extrude,
    join,
    lathe,
    loft,
    ngon,
    rounded_box,
    shaded,
    sphere,
    tube,
)

Paint = dict[str, Mesh]


def board_game() -> Paint:
    """Board game, 32 x 32 x 5 cm: a chequered board on the lid, with pieces."""
    squares = [
        panel(0.036, 0.036).moved(0.036 * (i - 2.5), 0.036 * (j - 2.5), 0.0512)
        for i in range(6)
        for j in range(6)
        if (i + j) % 2
    ]
    pawn = join(cylinder(0.011, 0.018, 6, top=0.004), sphere(0.007, 6, 3).moved(z=0.015)).moved(z=0.050)
    place = 0.036 * np.array([[-2.5, -1.5], [-0.5, 0.5], [1.5, -0.5], [2.5, 2.5]])
    pawns = [pawn.moved(x, y) for x, y in place]
    return {
        "green": join(box(0.32, 0.32, 0.028).moved(z=0.022)),
        "crimson": box(0.312, 0.312, 0.022),
        "cream": box(0.24, 0.24, 0.0008).moved(z=0.050),
        "brown": join(*squares),
        "red": join(*pawns[::2]),
        "blue": join(*pawns[1::2]),
    }


def book() -> Paint:
    """Closed book, 22 x 15 x 4 cm, lying flat."""
    covers = join(
        box(0.22, 0.15, 0.005), box(0.22, 0.15, 0.005).moved(z=0.037), box(0.22, 0.006, 0.042).moved(0, 0.072)
    )
    frame = [box(0.19, 0.003, 0.001).moved(0, y, 0.042) for y in (-0.060, 0.050)]
    frame += [box(0.003, 0.113, 0.001).moved(x, -0.005, 0.042) for x in (-0.0935, 0.0935)]
    return {
        "navy": covers,
        "paper": box(0.212, 0.144, 0.032).moved(0, 0, 0.005),
        "gold": join(*frame, lettering("NOVEL", 0.036, 0.18).moved(0, -0.002, 0.043)),
        "red": box(0.012, 0.030, 0.002).moved(0.05, -0.087, 0.020),
    }


def candle() -> Paint:
    """Candle with drips in a brass holder with a ring handle."""
    drip = ellipsoid(0.012, 0.008, 0.045, 6, 3)
    drips = [
        drip.moved(0.019).turned("z", a).moved(z=z) for a, z in ((0.3, 0.085), (2.2, 0.075), (4.0, 0.090), (5.2, 0.070))
    ]
    loop = np.column_stack([0.018 * ngon(1, 8)[:, 0], np.zeros(8), 0.018 * ngon(1, 8)[:, 1]])
    return {
        "gold": join(
            lathe(
                [
                    (0, 0),
                    (0.046, 0),
                    (0.056, 0.014),
                    (0.050, 0.014),
                    (0.040, 0.006),
                    (0.025, 0.006),
                    (0.025, 0.026),
                    (0, 0.026),
                ],
                12,
            ),
            tube(loop, 0.004, 4, closed=True).moved(0.068, 0, 0.020),
        ),
        "cream": join(lathe([(0.020, 0.026), (0.020, 0.128), (0.016, 0.132), (0, 0.126)], 10), *drips),
        "black": cylinder(0.0025, 0.018, 5).moved(z=0.125),
    }


def clock() -> Paint:
    """Twin-bell alarm clock, 15 cm high."""
    centre = 0.068

    def upright(mesh: Mesh) -> Mesh:
        return mesh.turned("x", np.pi / 2)

    ticks = [line((0, 0.034), (0, 0.041), 0.005).turned("z", n * np.pi / 6) for n in range(0, 12, 1)]
    bell = lathe([(0.022, 0), (0.020, 0.010), (0.010, 0.017), (0, 0.018)], 10)
    bells = [bell.turned("y", a).moved(np.sign(a) * 0.034, 0, centre + 0.048) for a in (-0.6, 0.6)]
    feet = [cylinder(0.006, 0.030, 6, top=0.008).turned("y", a).moved(-np.sign(a) * 0.044, 0, 0) for a in (-0.5, 0.5)]
    hands = join(line((0, 0), (0, 0.032), 0.005), line((0, 0), (0.018, 0.012), 0.006), disc(0.005, 6))
    return {
        "red": join(
            upright(lathe([(0, 0), (0.052, 0), (0.055, 0.005), (0.055, 0.045), (0.048, 0.045)], 16)).moved(
                0, 0.022, centre
            ),
            *bells,
        ),
        "white": upright(disc(0.049, 16)).moved(0, -0.019, centre),
        "black": join(upright(join(*ticks)).moved(0, -0.020, centre), upright(hands).moved(0, -0.021, centre)),
        "gold": join(
            *feet,
            tube(
                [
                    (-0.030, 0, centre + 0.062),
                    (-0.018, 0, centre + 0.083),
                    (0.018, 0, centre + 0.083),
                    (0.030, 0, centre + 0.062),
                ],
                0.004,
                5,
            ),
        ),
    }


def cushion() -> Paint:
    """Plump square cushion, 34 cm, with a cross of stripes."""
    steps = 8

    def ring(size: float, z: float, pinch: float) -> Array:
        t = np.linspace(-1, 1, steps // 2, endpoint=False)
        side = np.column_stack([t, -1 + pinch * (1 - t**2)])
        turns = [np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) for a in np.arange(4) * np.pi / 2]
        return at_height(size * np.concatenate([side @ turn.T for turn in turns]), z)

    rings = [
        ring(0.0, 0, 0),
        ring(0.09, 0.0, -0.3),
        ring(0.13, 0.02, -0.05),
        ring(0.17, 0.058, 0.12),
        ring(0.13, 0.100, -0.05),
        ring(0.08, 0.118, -0.3),
        ring(0, 0.121, 0),
    ]
    return {"teal": loft(rings[:4], caps=False, crease=1.0), "yellow": loft(rings[3:], caps=False, crease=1.0)}


def folder() -> Paint:
    """Manila folder with a tab and papers, 32 x 24 cm, lying flat."""
    back = [
        (-0.16, -0.115),
        (0.16, -0.115),
        (0.16, 0.105),
        (0.15, 0.105),
        (0.145, 0.12),
        (0.075, 0.12),
        (0.07, 0.105),
        (-0.16, 0.105),
    ]
    return {
        "manila": join(extrude(back, 0.006), box(0.32, 0.205, 0.005).moved(0, -0.0125, 0.015)),
        "paper": join(
            box(0.30, 0.200, 0.009).moved(0.004, 0.000, 0.006), box(0.11, 0.030, 0.001).moved(-0.05, 0.01, 0.020)
        ),
        "red": box(0.055, 0.010, 0.001).moved(0.110, 0.112, 0.006),
        "grey": join(*(box(w, 0.004, 0.001).moved(-0.05, y, 0.0205) for w, y in ((0.08, 0.016), (0.06, 0.005)))),
    }


def magazine() -> Paint:
    """Glossy magazine, 28 x 21 cm, with a portrait on the cover."""
    hair = patch(np.concatenate([arc(0.034, -0.2, np.pi + 0.2, 8), [(-0.038, -0.050), (0.038, -0.050)]]))
    lines = [
        panel(w, 0.006).moved(x, y)
        for w, x, y in (
            (0.06, -0.09, 0.0),
            (0.05, -0.095, -0.02),
            (0.055, -0.092, -0.04),
            (0.05, 0.095, -0.05),
            (0.06, 0.09, -0.07),
        )
    ]
    top = 0.0205
    return {
        "sky": box(0.28, 0.21, 0.004).moved(z=0.016),
        "paper": join(box(0.276, 0.206, 0.016), join(*lines).moved(z=top)),
        "rose": join(
            lettering("STYLE", 0.048, 0.2, 0.75).moved(0, 0.072, top),
            patch([(-0.07, -0.105), (0.07, -0.105), (0.05, -0.065), (-0.05, -0.065)]).moved(z=top),
        ),
        "brown": hair.moved(0, -0.01, top),
        "peach": join(
            patch(ngon(1, 10) * [0.023, 0.030]).moved(0, -0.018, top + 0.0008),
            panel(0.022, 0.03).moved(0, -0.055, top + 0.0008),
        ),
        "red": panel(0.014, 0.005).moved(0, -0.034, top + 0.0016),
    }


def mobile_phone() -> Paint:
    """Mobile phone, 16 cm long, screen up, with app icons."""
    top = 0.0125
    colours = ("green", "orange", "rose", "sky")
    icons: Paint = {}
    for n, colour in enumerate(colours):
        spots = [(0.045 - 0.022 * row, 0.021 - 0.014 * ((n + row) % 4)) for row in range(3)]
        icons[colour] = join(*(panel(0.012, 0.010).moved(x, y, top + 0.001) for x, y in spots))
    return {
        "silver": rounded_box(0.16, 0.076, 0.012, 0.010, 2, bevel=0.002),
        "navy": panel(0.146, 0.066).moved(z=top),
        "white": join(
            panel(0.004, 0.025).moved(-0.066, 0, top + 0.001), panel(0.012, 0.056).moved(-0.050, 0, top + 0.001)
        ),
        **icons,
    }


def notes() -> Paint:
    """Yellow note pad, 15 cm long, ruled and written on, with a pencil."""
    top = 0.0255
    rules = [panel(0.10, 0.0015).moved(-0.012, y, top) for y in (0.030, 0.015, 0.0, -0.015, -0.030)]
    words = [
        line((x, y + 0.003), (x + w, y + 0.007), 0.003).moved(z=top)
        for x, y, w in ((-0.05, 0.030, 0.05), (-0.05, 0.015, 0.07), (-0.05, 0.0, 0.035))
    ]
    return {
        "yellow": box(0.15, 0.105, 0.025),
        "blue": join(*rules),
    }


def remote_control() -> Paint:
    """Remote control, 19 cm long, buttons up."""
    top = 0.022

    def button(x: float, y: float, r: float = 0.0055) -> Mesh:
        return extrude(ngon(r, 6), 0.003, top=0.8).moved(x, y, top)

    digits = [button(0.015 - 0.017 * i, 0.015 - 0.015 * j) for i in range(4) for j in range(3)]
    return {
        "charcoal": rounded_box(0.19, 0.055, top, 0.010, 2, bevel=0.004),
        "white": join(*digits),
        "red": button(0.080, 0.014, 0.007),
        "blue": join(tube(at_height(ngon(0.014, 8), top), 0.003, 4, closed=True).moved(0.047), button(0.047, 0)),
        "green": button(-0.065, 0.013),
        "yellow": button(-0.065, -0.013),
    }


def sports_ball() -> Paint:
    """Football, 20 cm wide: black pentagons and white hexagons."""
    black, white = _football(0.10)
    return {"black": black.moved(z=0.10), "white": white.moved(z=0.10)}


def teddy_bear() -> Paint:
    """Sitting teddy bear, 28 cm high."""

    def pair(mesh: Mesh) -> Mesh:
        return join(mesh, mesh.scaled(x=-1))

    ears = pair(ellipsoid(0.058, 0.030, 0.058, 6, 3).moved(0.058, 0, 0.232))
    arms = pair(ellipsoid(0.050, 0.054, 0.110, 6, 3).turned("y", -0.7).moved(0.062, -0.02, 0.085))
    legs = pair(ellipsoid(0.064, 0.120, 0.062, 6, 3).turned("z", 0.3).moved(0.062, -0.055, 0))
    return {
        "fur": join(
            ellipsoid(0.150, 0.130, 0.160, 8, 5).moved(z=0.005),
            ellipsoid(0.138, 0.125, 0.125, 8, 5).moved(z=0.140),
            ears,
            arms,
            legs,
        ),
        "tan": join(
            ellipsoid(0.070, 0.055, 0.054, 6, 3).moved(0, -0.056, 0.160),
            pair(front(disc(0.022, 6), 0.115, 0.032, 0.082)),
        ),
        "black": join(
            ellipsoid(0.026, 0.020, 0.018, 4, 2).moved(0, -0.084, 0.190),
            pair(ellipsoid(0.017, 0.014, 0.020, 4, 2).moved(0.030, -0.052, 0.218)),
        ),
        "red": patch([(0, -0.012), (0.035, -0.028), (0.035, 0.016)]).turned("x", np.pi / 2).moved(0, -0.062, 0.150),
    }


def toy_car() -> Paint:
    """Toy car, 16 cm long."""
    body = extrude(
        [(-0.08, 0.012), (0.08, 0.012), (0.08, 0.034), (0.045, 0.040), (-0.075, 0.040), (-0.08, 0.034)], 0.072
    )
    roof = extrude([(-0.055, 0), (0.040, 0), (0.018, 0.030), (-0.042, 0.030)], 0.064)

    def upright(mesh: Mesh, depth: float) -> Mesh:
        return mesh.turned("x", np.pi / 2).moved(y=depth / 2)

    wheel = cylinder(0.017, 0.014, 10).turned("x", np.pi / 2)
    wheels = [wheel.moved(x, y, 0.017) for x in (-0.045, 0.045) for y in (-0.028, 0.042)]
    windows = [
        patch([(-0.043, 0.004), (-0.004, 0.004), (-0.004, 0.025), (-0.035, 0.025)]),
        patch([(0.002, 0.004), (0.032, 0.004), (0.016, 0.025), (0.002, 0.025)]),
    ]
    return {
        "red": join(upright(body, 0.072), upright(roof, 0.064).moved(z=0.040)),
        "black": join(*wheels),
        "ice": join(*windows).moved(0, 0, 0),
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
    return tuple(Mesh(t, t / radius) for t in (np.concatenate(black), np.concatenate(white)))


def _dome(points: list[Array], radius: float) -> Array:
    """Return triangles from a patch's centre to its corners, all on a sphere."""
    corners = np.array(points)
    middle = corners.mean(axis=0)
    axis = middle / np.linalg.norm(middle)
    side = np.cross(axis, corners[0])
    order = np.argsort(np.arctan2(corners @ np.cross(axis, side), corners @ side))
    ring = np.array([c / np.linalg.norm(c) for c in corners[order]])
    return radius * np.stack([np.broadcast_to(axis, ring.shape), ring, np.roll(ring, -1, axis=0)], axis=1)
