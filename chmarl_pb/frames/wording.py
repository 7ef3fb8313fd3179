"""How the demo names things, rooms and actions."""

from chmarl_pb import catalog
from chmarl_pb.catalog import Catalog
from chmarl_pb.frames.recording import Moment, Recording
from chmarl_pb.rendering.renderer import classes_of
from chmarl_pb.robots.pointing import MIDDLE, cell_of, verb_of
from chmarl_pb.tasks.symbols import SILENT


def robot_words(robot: str) -> str:
    """Return what a robot is called: ``humanoid_1`` -> ``Humanoid 1``."""
    return robot.replace("_", " ").capitalize()


def room_words(room: str) -> str:
    """Return a room's name: ``livingroom`` -> ``living room``, ``bedroom_2`` -> ``bedroom 2``."""
    return room.replace("livingroom", "living room").replace("_", " ")


def action_words(action: str, recording: Recording) -> str:
    """Return an action as a command: ``goto_livingroom`` -> ``Go to the living room``."""
    if action.startswith("goto_"):
        return f"Go to the {room_words(action.removeprefix('goto_'))}"
    if cell_of(action) is not None:
        return f"{verb_of(action).capitalize()} at the {cell_words(action)}"
    if action == "pick":
        return f"Pick up the {item_words(recording)}"
    if action == "place":
        return f"Place it on the {target_words(recording)}"
    return action.replace("_", " ").capitalize()


def short_action_words(action: str) -> str:
    """Return an action in few words: ``goto_livingroom`` -> ``go to living room``, ``turn_left`` -> ``turn left``."""
    if action.startswith("goto_"):
        return f"go to {room_words(action.removeprefix('goto_'))}"
    if cell_of(action) is not None:
        return f"{verb_of(action)} {cell_words(action)}"
    return action.replace("_", " ")


def said_words(moment: Moment, robot: str) -> str:
    """Return what a robot said in a step, to follow its action: `` and says 5``; nothing if it was silent."""
    symbol = moment.said.get(robot, SILENT)
    return "" if symbol == SILENT else f" and says {symbol}"


def cell_words(action: str) -> str:
    """Return where in the picture an action points: ``pick_0_2`` -> ``upper right``."""
    row, column = cell_of(action) or MIDDLE
    words = [("upper", "", "lower")[row], ("left", "", "right")[column]]
    return " ".join(word for word in words if word) or "middle"


def item_words(recording: Recording) -> str:
    """Return the noun of X."""
    return thing_words(recording.item, recording.home.catalog)


def target_words(recording: Recording) -> str:
    """Return the noun of Y."""
    return thing_words(recording.targets[0], recording.home.catalog)


def thing_words(name: str, known: Catalog) -> str:
    """Return a thing's noun: ``kitchen/stove_1`` -> ``stove``."""
    return known.classes[catalog.class_of(name)].noun


def seen_words(recording: Recording, moment: Moment, robot: str) -> list[str]:
    """Return the nouns of what a robot sees, each once, in the order of the scene graph."""
    known = recording.home.catalog.classes
    return list(dict.fromkeys(known[kind].noun for kind in classes_of(moment.visible[robot], recording.models)))


def reward_words(reward: float) -> str:
    """Return a reward with its sign, and 0 without one."""
    return f"{reward:+g}" if reward else "0"


def known_rooms(recording: Recording, moment: Moment, row: int) -> list[str]:
    """Return the rooms known for X (row 0) or Y (row 1) by the message board."""
    known = () if moment.messages is None else zip(recording.rooms, moment.messages[row], strict=True)
    return [room_words(room) for room, bit in known if bit]


def result_words(recording: Recording) -> str:
    """Return how the episode ended, in one sentence."""
    steps = f"{recording.steps} step{'s' if recording.steps != 1 else ''}"
    ending = f"Solved in {steps}" if recording.success else f"Not solved within {steps}"
    count = recording.collisions
    collided = f" {count} motion{'s' if count != 1 else ''} found no free way." if count else ""
    return f"{ending}; the shortest plan has {shortest_words(recording)}.{collided}"


def shortest_words(recording: Recording) -> str:
    """Return how many steps the shortest plan has: ``9``, or ``9 or fewer`` where that is not certain."""
    best = recording.optimum
    return "unknown" if best is None else f"{best.steps}{'' if best.proven else ' or fewer'}"
