"""What the page says in words, as Markdown."""

from chmarl_pb import catalog
from chmarl_pb.frames import wording
from chmarl_pb.frames.recording import Moment, Recording
from chmarl_pb.rendering.renderer import VISIBLE_PIXELS
from chmarl_pb.robots.pointing import cell_of, verb_of

_ARROWS = ("↖↑↗", "←·→", "↙↓↘")


def status(recording: Recording, number: int, over: bool) -> str:
    """Return the instruction and how an episode stands at one of its moments.

    Args:
        recording: the episode.
        number: of the moment.
        over: whether it ends there.
    """
    moment = recording.moments[number]
    facts = [f"step {number}", f"potential {moment.potential:g} of 10"]
    facts += [f"reward {wording.reward_words(moment.reward)}"] if moment.actions else []
    facts += [f"shortest plan {wording.shortest_words(recording)}"]
    ending = f"\n\n**{'Solved' if recording.success else 'Not solved'} in {number} steps.**" if over else ""
    return f"**{recording.instruction}**\n\n{' · '.join(facts)}{ending}"


def board(recording: Recording, number: int) -> str:
    """Return what the robots have told each other: the message board as a table, or the symbols of the step."""
    moment = recording.moments[number]
    if moment.messages is None and not moment.said:
        return "Nothing has been said."
    if moment.messages is None:
        return "Said: " + ", ".join(f"{robot} {symbol}" for robot, symbol in moment.said.items())
    rooms = [wording.room_words(room) for room in recording.rooms]
    rows = [f"| seen in | {' | '.join(rooms)} |", f"|---|{':-:|' * len(rooms)}"]
    for noun, bits in zip(
        (wording.item_words(recording), wording.target_words(recording)), moment.messages, strict=True
    ):
        rows.append(f"| {noun} | {' | '.join('●' if bit else '' for bit in bits)} |")
    return "\n".join(rows)


def robot_report(recording: Recording, number: int, robot: str) -> str:
    """Return what a robot did and was told.

    Args:
        recording: the episode.
        number: of the moment.
        robot: its name.
    """
    moment = recording.moments[number]
    told = f"\n\nTold: *{moment.feedback[robot]}*" if moment.feedback[robot] else ""
    return _did(moment, robot) + told


def _did(moment: Moment, robot: str) -> str:
    if not moment.actions:
        return "At the start"
    words = wording.short_action_words(moment.actions[robot]) + wording.said_words(moment, robot)
    return f"Did: {words}" + ("" if moment.succeeded[robot] else " **(failed)**")


def scene_graph(recording: Recording, number: int, robot: str, pixels: dict[str, int]) -> str:
    """Return the scene graph of what a robot sees as a table: its nodes, their states, edges and pixels.

    Args:
        recording: the episode.
        number: of the moment.
        robot: its name.
        pixels: thing -> its pixels in the picture that decides what the robot sees.
    """
    graph = recording.moments[number].graphs[robot]
    edges: dict[str, list[str]] = {}
    for source, target, relation in graph.relations():
        if relation != "near":
            edges.setdefault(source, []).append(f"{relation.replace('_', ' ')} {target}")
    rows = [f"| {robot} sees | state | where | pixels |", "|---|---|---|--:|"]
    for name, state in zip(graph.names, graph.states, strict=True):
        if name in pixels:
            rows.append(f"| {name} | {state} | {', '.join(edges.get(name, ()))} | {pixels[name]} |")
    return "\n".join(rows) if len(rows) > 2 else f"{robot} sees nothing."


def seen_labels(pixels: dict[str, dict[str, int]]) -> dict[str, str]:
    """Return thing -> which robots see it, with how many pixels; fewer than the rule asks for do not count.

    Args:
        pixels: robot -> thing -> its pixels.
    """
    labels: dict[str, list[str]] = {}
    for robot, counts in pixels.items():
        for name, count in counts.items():
            few = "" if count >= VISIBLE_PIXELS else f", below {VISIBLE_PIXELS}"
            labels.setdefault(name, []).append(f"{robot} {count} px{few}")
    return {name: f"{name}: {'; '.join(words)}" for name, words in labels.items()}


def thing_report(recording: Recording, number: int, name: str) -> str:
    """Return class, state and place of a thing, an object or a robot, and who sees it.

    Args:
        recording: the episode.
        number: of the moment.
        name: of the thing.
    """
    moment = recording.moments[number]
    x, y, z = place_of(recording, moment, name)
    model = recording.models.get(name)
    kind = model.class_name if model else catalog.class_of(name)
    lines = [f"**{name}**", f"class: {kind}"]
    lines += [f"state: {recording.states[name]}"] if name in recording.states else []
    carrier = moment.carriers.get(name)
    lines += [f"{'held by' if carrier in recording.models else 'stands on'}: {carrier}"] if carrier else []
    lines += [f"room: {catalog.room_of(name)}"] if "/" in name else []
    lines += [f"at: x {x:.2f}, y {y:.2f}, z {z:.2f} m"]
    seers = [robot for robot, seen in moment.visible.items() if name in seen]
    lines += [f"seen by: {', '.join(seers) or 'nobody'}"]
    return " · ".join(lines)


def place_of(recording: Recording, moment: Moment, name: str) -> tuple[float, float, float]:
    """Return where a thing, an object or a robot stands, metres."""
    moving = moment.rest.objects | moment.rest.robots
    if name in moving:
        x, y, z = moving[name][0]
        return x, y, z
    thing = next(thing for thing in recording.home.things if thing.name == name)
    x, y, z = thing.frame[:3, 3].tolist()
    return x, y, z


def button_words(action: str) -> str:
    """Return an action in the few words of a button: ``goto_kitchen`` -> ``kitchen``, ``pick_0_2`` -> ``pick ↗``."""
    cell = cell_of(action)
    if cell is not None:
        return f"{verb_of(action)} {_ARROWS[cell[0]][cell[1]]}"
    return wording.room_words(action.removeprefix("goto_")) if action.startswith("goto_") else action.replace("_", " ")
