"""The sentences that instructions and feedback are made of; some are held out of training.

Slots: ``{x}`` the object with the or with a, an or some; ``{the_x}`` and ``{a_x}`` the object with
just that article; ``{y}`` the receptacle; ``{it}``, ``{they}``, ``{is}``, ``{was}`` and ``{s}`` agree
with the object. Feedback: ``{done}`` what the robot did ("moving forward"), and what would have
been better as ``{base}`` ("turn left"), ``{past}`` ("turned left") and ``{doing}`` ("turning
left"); ``{goal}`` is what it needs next: the object, or once it holds that, the receptacle.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Templates:
    """Sentences of one kind.

    Attributes:
        train: those that all tasks use.
        held_out: those that only tasks for validation and test use.
    """

    train: tuple[str, ...]
    held_out: tuple[str, ...]

    def pool(self, held_out: bool) -> tuple[str, ...]:
        """Return the sentences to choose from, with or without those held out of training."""
        return self.train + self.held_out if held_out else self.train


INSTRUCTIONS = Templates(
    train=(
        "Put {x} on {y}.",
        "Place {x} on top of {y}.",
        "Grab {x} and keep {it} on {y}.",
        "Take {x} and set {it} down on {y}.",
        "Pick {x} up and put {it} onto {y}.",
        "Find {x} and leave {it} on top of {y}.",
        "Please move {x} from wherever {they} {is} onto {y}.",
        "Look for {x} in every room, then set {it} on {y}.",
        "Search the home together for {x} and put {it} on {y}.",
        "Somewhere there {is} {a_x}; find {it} and place {it} on {y}.",
        "I need {the_x} on {y}, so please go and fetch {it}.",
        "Could you find {x} for me and put {it} on {y}?",
        "{the_x} belong{s} on {y}, so pick {it} up and take {it} there.",
        "Go and get {x}, and then put {it} on {y}.",
        "Once you have found {x}, pick {it} up and set {it} on {y}.",
        "Help each other to find {x} and place {it} on {y}.",
        "Let the drone look for {x} and the humanoid put {it} on {y}.",
        "Go from room to room until you see {x}, then put {it} on {y}.",
        "I would like {the_x} to be on {y}, so please take care of that.",
        "Make sure that {the_x} end{s} up on {y} as soon as possible.",
        "Fetch {x} from wherever you can find {it} and set {it} on {y}.",
        "Your job is to find {x} and place {it} on {y}.",
        "Tidy up a little: put {x} away on {y}.",
        "Clear {x} away by placing {it} on top of {y}.",
        "{the_x} {is} missing, so search every room and leave {it} on {y}.",
        "There should be {a_x} on {y}, so find {it} and put {it} there.",
        "Take {x} off the thing that {they} rest{s} on and move {it} to {y}.",
        "I want to see {the_x} on {y} when I come home this evening.",
        "Please have {the_x} waiting for me on {y} when I get back.",
        "Get hold of {x} and drop {it} off on {y}.",
        "Keep your eyes open for {x} and bring {it} over to {y}.",
        "See if you can find {x} and move {it} onto {y}.",
    ),
    held_out=(
        "Transfer {x} onto {y} as quickly as you can.",
        "Collect {x} and deliver {it} to the top of {y}.",
        "Someone has left {the_x} in the wrong place, so put {it} on {y}.",
        "Track down {x} anywhere in the house and position {it} on {y}.",
        "Would you kindly hunt for {x} and rest {it} upon {y}?",
        "When you come across {x}, lift {it} up and deposit {it} on {y}.",
        "Explore the house as a team and set {x} upon {y}.",
        "Nobody knows where {the_x} {is}, but {they} must soon stand on {y}.",
        "There is still some space on {y}, so go and bring {the_x} there.",
        "Use the view from above to locate {x}, then get {it} onto {y}.",
        "Locate {x} first, and after that shift {it} onto {y}.",
        "Check one room after another for {x} and relocate {it} to {y}.",
        "It would be great if {the_x} could stand on {y}.",
        "Before you do anything else, lay {x} on {y}.",
        "The right spot for {the_x} is on {y}, so transport {it} there.",
        "Work as a pair: one looks for {x}, the other puts {it} on {y}.",
    ),
)

MISSED_PICK = Templates(
    train=(
        "You should have picked up {the_x} instead of {done}.",
        "You should have grabbed {the_x} instead of {done}.",
        "You could see {the_x}, so picking {it} up was better than {done}.",
        "{the_x} {was} in view: pick {it} up instead of {done}.",
        "Instead of {done}, you should have picked up {the_x}.",
        "Rather than {done}, you should have reached for {the_x}.",
        "It was time to pick up {the_x} instead of {done}.",
        "Picking up {the_x} would have been better than {done}.",
        "Next time, pick up {the_x} instead of {done}.",
        "You could have picked up {the_x}, but you were busy {done}.",
    ),
    held_out=(
        "{done} cost you a step: you could have taken {the_x}.",
        "What was the point of {done} with {the_x} in view?",
        "The correct choice was to take hold of {the_x}, not {done}.",
        "You overlooked {the_x}: a pick would have beaten {done}.",
        "With {the_x} visible, a pick was wiser than {done}.",
    ),
)

MISSED_PLACE = Templates(
    train=(
        "You should have placed {the_x} on {y} instead of {done}.",
        "You should have put {it} down on {y} instead of {done}.",
        "You could see {y}, so put {it} there instead of {done}.",
        "{y} was in view: place {the_x} there instead of {done}.",
        "Instead of {done}, you should have placed {the_x} on {y}.",
        "Rather than {done}, you should have set {it} on {y}.",
        "It was time to place {it} on {y} instead of {done}.",
        "Placing {it} on {y} was better than {done}.",
        "Next time, place {the_x} on {y} instead of {done}.",
        "You could have placed {it} on {y}, but you were busy {done}.",
    ),
    held_out=(
        "{done} cost you a step: there was room for {the_x} on {y}.",
        "What was the point of {done} with {y} in view?",
        "The correct choice was to leave {it} on {y}, not {done}.",
        "You overlooked {y}: setting {it} down would have beaten {done}.",
        "With {y} visible, setting {it} down was wiser than {done}.",
    ),
)

DETOUR = Templates(
    train=(
        "You should have {past} instead of {done}.",
        "To reach {goal} sooner, you should have {past} instead of {done}.",
        "Instead of {done}, you should have {past} to get to {goal}.",
        "A quicker way to {goal} was to {base} instead of {done}.",
        "{doing} would have led you to {goal} sooner than {done}.",
        "The shortest plan was to {base} instead of {done}.",
        "To get to {goal}, {doing} would have been better than {done}.",
        "Rather than {done}, you should have {past}, because you need {goal}.",
    ),
    held_out=(
        "{doing}, not {done}, was part of the shortest way to {goal}.",
        "{done} did not help you to reach {goal}, but {doing} would have.",
        "You lost a step by {done}; the plan was to {base}.",
        "The plan was to {base}, so {done} was a detour.",
    ),
)

FEEDBACK = (MISSED_PICK, MISSED_PLACE, DETOUR)

#: The benchmark's sentences that read stiffly, or whose "it" refers to nothing -> what ``templates=2`` says instead.
MENDED = {
    "Grab {x} and keep {it} on {y}.": "Grab {x} and put {it} on {y}.",
    "Take {x} off the thing that {they} rest{s} on and move {it} to {y}.": (
        "Wherever {the_x} {is}, take {it} from there and move {it} to {y}."
    ),
    "Get hold of {x} and drop {it} off on {y}.": "Get hold of {x} and set {it} down on {y}.",
    "Collect {x} and deliver {it} to the top of {y}.": "Collect {x} and deliver {it} to {y}.",
    "Would you kindly hunt for {x} and rest {it} upon {y}?": "Would you kindly hunt for {x} and set {it} upon {y}?",
    "Nobody knows where {the_x} {is}, but {they} must soon stand on {y}.": (
        "Nobody knows where {the_x} {is}, but {they} must soon be on {y}."
    ),
    "It would be great if {the_x} could stand on {y}.": "It would be great to have {the_x} on {y}.",
    "You could see {the_x}, so picking {it} up was better than {done}.": (
        "You could see {the_x}, so picking {it} up would have been better than {done}."
    ),
    "You could have picked up {the_x}, but you were busy {done}.": (
        "You could have picked up {the_x}, but you were {done} instead."
    ),
    "The correct choice was to take hold of {the_x}, not {done}.": (
        "The correct choice was to take hold of {the_x} instead of {done}."
    ),
    "You overlooked {the_x}: a pick would have beaten {done}.": (
        "You overlooked {the_x}: picking {it} up would have been wiser than {done}."
    ),
    "With {the_x} visible, a pick was wiser than {done}.": (
        "With {the_x} visible, picking {it} up was wiser than {done}."
    ),
    "You should have put {it} down on {y} instead of {done}.": (
        "You should have put {the_x} down on {y} instead of {done}."
    ),
    "You could see {y}, so put {it} there instead of {done}.": (
        "You could see {y}, so put {the_x} there instead of {done}."
    ),
    "Rather than {done}, you should have set {it} on {y}.": "Rather than {done}, you should have set {the_x} on {y}.",
    "It was time to place {it} on {y} instead of {done}.": "It was time to place {the_x} on {y} instead of {done}.",
    "Placing {it} on {y} was better than {done}.": "Placing {the_x} on {y} would have been better than {done}.",
    "You could have placed {it} on {y}, but you were busy {done}.": (
        "You could have placed {the_x} on {y}, but you were {done} instead."
    ),
    "The correct choice was to leave {it} on {y}, not {done}.": (
        "The correct choice was to leave {the_x} on {y} instead of {done}."
    ),
    "You overlooked {y}: setting {it} down would have beaten {done}.": (
        "You overlooked {y}: setting {the_x} down there would have been wiser than {done}."
    ),
    "With {y} visible, setting {it} down was wiser than {done}.": (
        "With {y} visible, setting {the_x} down there was wiser than {done}."
    ),
    "{doing}, not {done}, was part of the shortest way to {goal}.": (
        "{doing} was part of the shortest way to {goal}, but {done} was not."
    ),
}

REVISIONS = (1, 2)  # of the sentences: the benchmark's, and the mended ones


def revised(template: str, revision: int) -> str:
    """Return a template as a revision has it; the words and slots that were drawn for it still fit."""
    return MENDED.get(template, template) if revision == 2 else template
