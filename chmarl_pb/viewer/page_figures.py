"""The drawings of the web page as inline SVG: what lies over the map, and the curve of the potential."""

from chmarl_pb.frames.plan_map import Point, field_of_view, robot_mark
from chmarl_pb.frames.recording import Recording
from chmarl_pb.rendering.plan_view import PlanView

_BADGE = 19  # pixels of the plan
_WIDTH, _HEIGHT, _LEFT, _RIGHT, _TOP, _BOTTOM = 1100, 170, 40, 14, 14, 32  # of the curve, its margins included
_INSET = 16  # pixels between the axis and the start
_LEVELS = (0, 2, 4, 6, 8, 10)


def plan_overlay(recording: Recording, plan: PlanView, number: int) -> str:
    """Return the robots after a step with the way of that step, X and the Ys, in pixels of the plan."""
    moment = recording.moments[number]
    height, width = plan.rgb.shape[:2]
    parts = []
    places = {robot: f"r{place}" for place, robot in enumerate(recording.models)}
    for robot, model in recording.models.items():
        own = places[robot]
        earlier = [scene for past in recording.moments[:number] for scene in (*past.motion[::6], past.rest)]
        points = [scene.robots[robot][0][:2] for scene in earlier]
        now = [scene.robots[robot][0][:2] for scene in (*moment.motion[::3], moment.rest)]
        parts.append(f'<polyline class="past {own}" points="{_points(plan, [*points, now[0]])}"/>')
        parts.append(f'<polyline class="way {own}" points="{_points(plan, now)}"/>')
        field = _points(plan, field_of_view(moment.rest, robot, model))
        parts.append(f'<polygon class="field{"" if model.flies else " cone"} {own}" points="{field}"/>')
    for name in recording.targets:
        parts.append(_badge("Y", "y", plan.pixel(*recording.home.receptacles[name].centre)))
    x, y, _ = moment.rest.objects[recording.item][0]
    parts.append(_badge("X", "x", plan.pixel(x, y)))
    for robot in reversed(places):
        parts.append(_robot(plan, *robot_mark(moment.rest, robot, recording.models[robot]), places[robot]))
    return _svg(width, height, f"Map after step {number}", parts)


def curve(recording: Recording) -> str:
    """Return the potential over the steps as a line with a dot for each step."""
    across = (_WIDTH - _LEFT - _INSET - _RIGHT) / max(recording.steps, 1)
    up = (_HEIGHT - _TOP - _BOTTOM) / _LEVELS[-1]
    places = [
        (_LEFT + _INSET + number * across, _HEIGHT - _BOTTOM - up * moment.potential)
        for number, moment in enumerate(recording.moments)
    ]
    parts = []
    for level in _LEVELS:
        y = _HEIGHT - _BOTTOM - up * level
        parts.append(f'<line class="grid" x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>')
        parts.append(f'<text x="{_LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{level}</text>')
    parts.append(f'<polyline class="curve" points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in places)}"/>')
    spread = max(1, recording.steps // 20)
    for number, (x, y) in enumerate(places):
        if number % spread == 0:
            parts.append(f'<text x="{x:.1f}" y="{_HEIGHT - 8}" text-anchor="middle">{number}</text>')
        dot = f'<circle class="dot" id="dot-{number}" cx="{x:.1f}" cy="{y:.1f}" r="5"/>'
        parts.append(f'<a href="#step-{number}" aria-label="Step {number}">{dot}</a>')
    return _svg(_WIDTH, _HEIGHT, "Potential after each step", parts)


def _svg(width: int, height: int, label: str, parts: list[str]) -> str:
    return f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="{label}">{"".join(parts)}</svg>'


def _points(plan: PlanView, points: list[Point] | list[tuple[float, ...]]) -> str:
    pixels = (plan.pixel(x, y) for x, y in points)
    return " ".join(f"{column:.1f},{row:.1f}" for column, row in pixels)


def _robot(plan: PlanView, discs: list[tuple[float, float, float]], arrow: list[Point], own: str) -> str:
    """Return a robot's mark: a white rim around all its discs, then the discs, then the arrow."""
    circles = ""
    for kind in ("rim", f"body {own}"):
        for x, y, radius in discs:
            column, row = plan.pixel(x, y)
            circles += f'<circle class="{kind}" cx="{column:.1f}" cy="{row:.1f}" r="{radius * plan.scale:.1f}"/>'
    return f'{circles}<polygon class="arrow" points="{_points(plan, arrow)}"/>'


def _badge(letter: str, mark: str, middle: tuple[float, float]) -> str:
    x, y = middle
    return (
        f'<circle class="badge {mark}" cx="{x:.1f}" cy="{y:.1f}" r="{_BADGE}"/>'
        f'<text class="letter" x="{x:.1f}" y="{y:.1f}">{letter}</text>'
    )
