"""Words for the humanoid's actions: ``turn_left`` -> turn left, turned left, turning left."""

from dataclasses import dataclass

from chmarl_pb.robots.pointing import verb_of
from chmarl_pb.tasks.language.attributes import names_of_room


@dataclass(frozen=True)
class Verb:
    """One way to say an action.

    Attributes:
        base: after "to".
        past: after "should have".
        doing: after "instead of".
    """

    base: str
    past: str
    doing: str

    def applied(self, to: str) -> "Verb":
        """Return the verb followed by some more words."""
        return Verb(f"{self.base} {to}", f"{self.past} {to}", f"{self.doing} {to}")


TRY = Verb("try to", "tried to", "trying to")

#: The ways to say each action but Goto.
VERBS = {
    "pick": (
        Verb("pick something up", "picked something up", "picking something up"),
        Verb("grab something", "grabbed something", "grabbing something"),
    ),
    "place": (
        Verb("place something", "placed something", "placing something"),
        Verb("put something down", "put something down", "putting something down"),
    ),
    "move_forward": (
        Verb("move forward", "moved forward", "moving forward"),
        Verb("go straight ahead", "gone straight ahead", "going straight ahead"),
    ),
    "turn_left": (
        Verb("turn left", "turned left", "turning left"),
        Verb("turn to the left", "turned to the left", "turning to the left"),
    ),
    "turn_right": (
        Verb("turn right", "turned right", "turning right"),
        Verb("turn to the right", "turned to the right", "turning to the right"),
    ),
    "stay": (
        Verb("stay where you were", "stayed where you were", "staying where you were"),
        Verb("stand still", "stood still", "standing still"),
    ),
}

#: The ways to say Goto; a room follows.
GOTO = (Verb("go to", "gone to", "going to"), Verb("drive to", "driven to", "driving to"))


def ways_to_say(action: str, held_out: bool) -> list[Verb]:
    """Return the ways to say an action.

    Args:
        action: its name, e.g. ``goto_kitchen``.
        held_out: whether names of rooms that are held out of training may be used.
    """
    if not action.startswith("goto_"):
        return list(VERBS[verb_of(action)])
    rooms = names_of_room(action.removeprefix("goto_"), held_out)
    return [verb.applied(room) for room in rooms for verb in GOTO]
