"""Feedback as sentences: what the humanoid did, and what would have been better."""

from dataclasses import dataclass

import numpy as np

from chmarl_pb.catalog import BENCHMARK, Catalog, Name
from chmarl_pb.robots.pointing import verb_of
from chmarl_pb.tasks.language.actions import TRY, Verb, ways_to_say
from chmarl_pb.tasks.language.attributes import name_x, name_y
from chmarl_pb.tasks.language.choice import may_use_held_out, pick_from
from chmarl_pb.tasks.language.grammar import agreement, definite, sentence
from chmarl_pb.tasks.language.templates import DETOUR, MISSED_PICK, MISSED_PLACE, Templates, revised
from chmarl_pb.tasks.task import Task


@dataclass(frozen=True)
class Advice:
    """A humanoid's action and the better one.

    Attributes:
        done: name of the action that it took.
        succeeded: whether that could be done.
        better: name of the action that would have been better.
        holding: whether it had X in its gripper then.
    """

    done: str
    succeeded: bool
    better: str
    holding: bool


def say(task: Task, step: int, advice: Advice, known: Catalog = BENCHMARK, templates: int = 1) -> str:
    """Return an advice as a sentence; the task's seed and the step choose the words.

    Args:
        task: names X and Y.
        step: number of joint steps before the action.
        advice: what to say.
        known: the classes of X and Y.
        templates: revision of the sentences: 1, the benchmark's, or 2, mended.
    """
    rng = np.random.default_rng([task.seed, 2, step])
    held_out = may_use_held_out(task)
    template = revised(pick_from(templates_for(advice).pool(held_out), rng), templates)
    x, y = name_x(task, rng, known), name_y(task, rng, known)
    done = pick_from(ways_to_say(advice.done, held_out), rng)
    better = pick_from(ways_to_say(advice.better, held_out), rng)
    return phrase(template, x, y, advice, done, better)


def templates_for(advice: Advice) -> Templates:
    """Return the sentences that fit an advice."""
    return {"pick": MISSED_PICK, "place": MISSED_PLACE}.get(verb_of(advice.better), DETOUR)


def phrase(template: str, x: Name, y: Name, advice: Advice, done: Verb, better: Verb) -> str:
    """Return a feedback sentence.

    Args:
        template: the sentence with slots.
        x: name of the object.
        y: name of the receptacle.
        advice: what it says.
        done: words for the action that was taken.
        better: words for the action that would have been better.
    """
    slots = {"the_x": definite(x), "y": definite(y), **agreement(x)}
    slots |= {"goal": definite(y if advice.holding else x)}
    slots |= {"done": done.doing if advice.succeeded else f"{TRY.doing} {done.base}"}
    slots |= {"base": better.base, "past": better.past, "doing": better.doing}
    return sentence(template, slots)
